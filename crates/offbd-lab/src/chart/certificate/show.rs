//! The records as a drawing and as a table.

use super::measure::{Alarms, Delay, Measured};
use crate::chart::{Axis, Figure, Look, Panel, Scale, Series, Stroke, Table};
use offbd_core::maths::median;

/// Monitors of rigs are put together in so many groups, by what they promise.
const GROUPS: usize = 6;
/// Alarms below which a factor of two is chance.
const FEW: f64 = 3.0;
/// Rates and delays drawn.
const PER_H: (f64, f64) = (1e-3, 10.0);
const DELAYS_S: (f64, f64) = (0.2, 10.0);

/// Monitors that promise about the same, together.
struct Group {
    promised: f64,
    came: u32,
    watched_h: f64,
}

impl Group {
    fn of(alarms: &[&Alarms]) -> Self {
        Self {
            promised: alarms.iter().map(|a| a.promised_per_h * a.watched_h).sum(),
            came: alarms.iter().map(|a| a.came).sum(),
            watched_h: alarms.iter().map(|a| a.watched_h).sum(),
        }
    }

    /// What was promised and what came, per hour. Where nothing came, at most as
    /// much as one alarm in that time.
    fn point(&self) -> (f64, f64) {
        let came = f64::from(self.came.max(1));
        (self.promised / self.watched_h, came / self.watched_h)
    }
}

fn alarms(measured: &[Measured]) -> Vec<&Alarms> {
    let mut all: Vec<&Alarms> = measured.iter().flat_map(|m| &m.monitors).collect();
    all.sort_by(|a, b| a.promised_per_h.total_cmp(&b.promised_per_h));
    all
}

fn delays(measured: &[Measured]) -> impl Iterator<Item = &Delay> {
    measured.iter().flat_map(|m| &m.delays)
}

fn faults(measured: &[Measured]) -> Vec<&'static str> {
    let mut names: Vec<&str> = Vec::new();
    for delay in delays(measured) {
        if !names.contains(&delay.fault) {
            names.push(delay.fault);
        }
    }
    names
}

pub(super) fn figure(measured: &[Measured]) -> Figure {
    Figure {
        title: "Calibrations: what they promise and what comes".to_owned(),
        subtitle: conclusion(measured),
        columns: 2,
        panel_height: 900,
        panels: vec![rates(measured), soonness(measured)],
    }
}

fn rates(measured: &[Measured]) -> Panel {
    let all = alarms(measured);
    let groups: Vec<Group> = all.chunks(all.len().div_ceil(GROUPS).max(1)).map(Group::of).collect();
    let seen = |came: bool| groups.iter().filter(move |g| (g.came > 0) == came).map(Group::point);
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

fn soonness(measured: &[Measured]) -> Panel {
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

/// The line on which promises are kept, and those at twice and half of it.
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

fn conclusion(measured: &[Measured]) -> String {
    let all = Group::of(&alarms(measured));
    let learnt = measured.iter().filter(|m| m.refused.is_none()).count();
    let hours: f64 = measured.iter().filter_map(|m| m.monitors.first()).map(|a| a.watched_h).sum();
    let (kept, n) = kept(delays(measured));
    format!(
        "{learnt} of {} drawn rigs learnt; {:.1} false alarms promised in {hours:.0} h, {} came; \
         {kept} of {n} delays within a factor of 2",
        measured.len(),
        all.promised,
        all.came,
    )
}

/// Delays that came within a factor of two of the promise, of those promised. A
/// promise that a fault will not be found is kept if it was not.
fn kept<'a>(delays: impl Iterator<Item = &'a Delay>) -> (usize, usize) {
    delays.fold((0, 0), |(kept, n), delay| (kept + usize::from(is_kept(delay)), n + 1))
}

fn is_kept(delay: &Delay) -> bool {
    match (delay.promised_s, delay.came_s) {
        (Some(promised_s), Some(came_s)) => (0.5..=2.0).contains(&(came_s / promised_s)),
        (promised_s, came_s) => promised_s.is_none() && came_s.is_none(),
    }
}

/// False alarms by monitor, then delays by fault.
pub(super) fn table(measured: &[Measured]) -> Table {
    let heading = vec!["of", "promised", "came", "unit", "within a factor of 2"];
    let mut rows = Vec::new();
    for code in offbd_core::vocabulary::FaultCode::ALL {
        let of: Vec<&Alarms> =
            alarms(measured).into_iter().filter(|a| a.code == code.as_str()).collect();
        rows.push(row(&format!("{code}, false alarms"), &Group::of(&of)));
    }
    rows.push(row("all false alarms", &Group::of(&alarms(measured))));
    for fault in faults(measured) {
        let of = || delays(measured).filter(|d| d.fault == fault);
        let middle = |value: fn(&Delay) -> Option<f64>| {
            let mut values: Vec<f64> = of().map(|d| value(d).unwrap_or(f64::INFINITY)).collect();
            let middle = median(&mut values).filter(|s| s.is_finite());
            middle.map_or("> 10".to_owned(), |s| format!("{s:.2}"))
        };
        let (kept, n) = kept(of());
        let (promised, came) = (middle(|d| d.promised_s), middle(|d| d.came_s));
        rows.push(vec![fault.to_owned(), promised, came, "s".to_owned(), format!("{kept} of {n}")]);
    }
    Table { heading, right: vec![1, 2, 4], rows }
}

fn row(name: &str, group: &Group) -> Vec<String> {
    let ratio = f64::from(group.came) / group.promised;
    let kept = match (0.5..=2.0).contains(&ratio) {
        _ if group.promised.max(f64::from(group.came)) < FEW => "too few to tell",
        true => "yes",
        false => "no",
    };
    vec![
        name.to_owned(),
        // A sum of nothing is −0.
        format!("{:.1}", group.promised + 0.0),
        group.came.to_string(),
        format!("in {:.0} h", group.watched_h + 0.0),
        kept.to_owned(),
    ]
}
