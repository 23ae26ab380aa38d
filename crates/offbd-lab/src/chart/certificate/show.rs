//! Presents the records as a drawing and as a table.

use super::measure::{DetectionDelay, FalseAlarms, RigResult};
use crate::chart::{Axis, ChartTable, Figure, Look, Panel, Scale, Series, Stroke};
use offbd_core::maths::median;

/// Number of groups of monitors, by predicted rate; chosen.
const GROUPS: usize = 6;
/// Number of alarms below which a factor of two is within chance; chosen.
const FEW: f64 = 3.0;
/// Range of the rates drawn, per hour.
const PER_H: (f64, f64) = (1e-3, 10.0);
/// Range of the delays drawn, s.
const DELAYS_S: (f64, f64) = (0.2, 10.0);

/// Monitors with about the same predicted rate.
struct MonitorGroup {
    promised: f64,
    came: u32,
    watched_h: f64,
}

impl MonitorGroup {
    fn of(alarms: &[&FalseAlarms]) -> Self {
        Self {
            promised: alarms.iter().map(|a| a.promised_per_h * a.watched_h).sum(),
            came: alarms.iter().map(|a| a.came).sum(),
            watched_h: alarms.iter().map(|a| a.watched_h).sum(),
        }
    }

    /// Returns the predicted and the observed rate, per hour. Without an alarm, the observed
    /// rate is that of one alarm, as an upper limit.
    fn point(&self) -> (f64, f64) {
        let came = f64::from(self.came.max(1));
        (self.promised / self.watched_h, came / self.watched_h)
    }
}

fn alarms(measured: &[RigResult]) -> Vec<&FalseAlarms> {
    let mut all: Vec<&FalseAlarms> = measured.iter().flat_map(|m| &m.monitors).collect();
    all.sort_by(|a, b| a.promised_per_h.total_cmp(&b.promised_per_h));
    all
}

fn delays(measured: &[RigResult]) -> impl Iterator<Item = &DetectionDelay> {
    measured.iter().flat_map(|m| &m.delays)
}

fn faults(measured: &[RigResult]) -> Vec<&'static str> {
    let mut names: Vec<&str> = Vec::new();
    for delay in delays(measured) {
        if !names.contains(&delay.fault) {
            names.push(delay.fault);
        }
    }
    names
}

pub(super) fn figure(measured: &[RigResult]) -> Figure {
    Figure {
        title: "Calibrations: what they promise and what comes".to_owned(),
        subtitle: conclusion(measured),
        columns: 2,
        panel_height: 900,
        panels: vec![rates(measured), delay_panel(measured)],
    }
}

fn rates(measured: &[RigResult]) -> Panel {
    let all = alarms(measured);
    let groups: Vec<MonitorGroup> =
        all.chunks(all.len().div_ceil(GROUPS).max(1)).map(MonitorGroup::of).collect();
    let seen =
        |came: bool| groups.iter().filter(move |g| (g.came > 0) == came).map(MonitorGroup::point);
    let scale = || Scale::Log(PER_H.0, PER_H.1);
    let mut panel = Panel::new(
        "false alarms of a monitor, in groups of equal size",
        Axis::new("promised per hour", scale()),
        Axis::new("came per hour", scale()),
    );
    panel.series.extend(within_two(PER_H));
    panel.series.push(Series::new("came", Look::of(0), Stroke::Markers, seen(true).collect()));
    let none = "none came: fewer than";
    panel.series.push(Series::new(none, Look::of(5), Stroke::Markers, seen(false).collect()));
    panel
}

fn delay_panel(measured: &[RigResult]) -> Panel {
    let scale = || Scale::Log(DELAYS_S.0, DELAYS_S.1);
    let mut panel = Panel::new(
        "median delay of a fault, each point a rig",
        Axis::new("promised (s)", scale()),
        Axis::new("came (s)", scale()),
    );
    panel.series.extend(within_two(DELAYS_S));
    for (i, fault) in faults(measured).into_iter().enumerate() {
        let of = delays(measured).filter(|d| d.fault == fault);
        let points = of.filter_map(|d| d.promised_s.zip(d.came_s)).collect();
        panel.series.push(Series::new(fault, Look::of(i), Stroke::Markers, points));
    }
    panel
}

/// Returns the line of equal predicted and observed values, and the lines at twice and
/// half of it.
fn within_two((low, high): (f64, f64)) -> [Series; 3] {
    let line = |name: &str, factor: f64, dash| {
        let look = Look { dash, ..Look::BLACK };
        let points = vec![
            (low.max(low / factor), low.max(low * factor)),
            (high.min(high / factor), high.min(high * factor)),
        ];
        Series::new(name, look, Stroke::Line, points)
    };
    [
        line("as promised", 1.0, None),
        line("within a factor of 2", 2.0, Some((6, 8))),
        line("within a factor of 2", 0.5, Some((6, 8))),
    ]
}

fn conclusion(measured: &[RigResult]) -> String {
    let all = MonitorGroup::of(&alarms(measured));
    let learnt = measured.iter().filter(|m| m.refused.is_none()).count();
    let hours: f64 = measured.iter().filter_map(|m| m.monitors.first()).map(|a| a.watched_h).sum();
    let (kept, n) = kept(delays(measured));
    let (quiet, monitors) = quiet(&alarms(measured));
    format!(
        "{learnt} of {} drawn rigs learnt; {:.1} false alarms promised in {hours:.0} h, {} came; \
         {quiet} of {monitors} monitors below the limit stated for 90 %; \
         {kept} of {n} delays within a factor of 2",
        measured.len(),
        all.promised,
        all.came,
    )
}

/// Counts the monitors that stayed below the rate that nine of ten are promised to stay below, and
/// all monitors.
fn quiet(alarms: &[&FalseAlarms]) -> (usize, usize) {
    let below = |a: &&&FalseAlarms| f64::from(a.came) <= a.most_per_h * a.watched_h;
    (alarms.iter().filter(below).count(), alarms.len())
}

/// Counts the delays within a factor of two of the prediction, and all predicted ones. A
/// prediction that a fault will not be detected is met if it was not.
fn kept<'a>(delays: impl Iterator<Item = &'a DetectionDelay>) -> (usize, usize) {
    delays.fold((0, 0), |(kept, n), delay| (kept + usize::from(is_kept(delay)), n + 1))
}

fn is_kept(delay: &DetectionDelay) -> bool {
    match (delay.promised_s, delay.came_s) {
        (Some(promised_s), Some(came_s)) => (0.5..=2.0).contains(&(came_s / promised_s)),
        (promised_s, came_s) => promised_s.is_none() && came_s.is_none(),
    }
}

/// Returns a table of the false alarms by monitor and of the delays by fault.
pub(super) fn table(measured: &[RigResult]) -> ChartTable {
    let heading = vec!["of", "promised", "came", "unit", "within a factor of 2"];
    let mut rows = Vec::new();
    for code in offbd_core::vocabulary::FaultCode::ALL {
        let of: Vec<&FalseAlarms> =
            alarms(measured).into_iter().filter(|a| a.code == code.as_str()).collect();
        rows.push(row(&format!("{code}, false alarms"), &MonitorGroup::of(&of)));
    }
    rows.push(row("all false alarms", &MonitorGroup::of(&alarms(measured))));
    let (quiet, n) = quiet(&alarms(measured));
    let share = format!("{:.0}", 100.0 * quiet as f64 / n.max(1) as f64);
    let name = "monitors below their limit".to_owned();
    rows.push(vec![name, "90".to_owned(), share, format!("% of {n}"), "-".to_owned()]);
    for fault in faults(measured) {
        let of = || delays(measured).filter(|d| d.fault == fault);
        let middle = |value: fn(&DetectionDelay) -> Option<f64>| {
            let mut values: Vec<f64> = of().map(|d| value(d).unwrap_or(f64::INFINITY)).collect();
            let middle = median(&mut values).filter(|s| s.is_finite());
            middle.map_or("> 10".to_owned(), |s| format!("{s:.2}"))
        };
        let (kept, n) = kept(of());
        let (promised, came) = (middle(|d| d.promised_s), middle(|d| d.came_s));
        rows.push(vec![fault.to_owned(), promised, came, "s".to_owned(), format!("{kept} of {n}")]);
    }
    ChartTable { heading, right: vec![1, 2, 4], rows }
}

fn row(name: &str, group: &MonitorGroup) -> Vec<String> {
    let ratio = f64::from(group.came) / group.promised;
    let kept = match (0.5..=2.0).contains(&ratio) {
        _ if group.promised.max(f64::from(group.came)) < FEW => "too few to tell",
        true => "yes",
        false => "no",
    };
    vec![
        name.to_owned(),
        // The sum of no values is −0; adding zero makes it 0.
        format!("{:.1}", group.promised + 0.0),
        group.came.to_string(),
        format!("in {:.0} h", group.watched_h + 0.0),
        kept.to_owned(),
    ]
}
