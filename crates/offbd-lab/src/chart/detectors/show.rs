//! Presents the records as drawings and as a table.

use super::faults;
use super::method::METHODS;
use super::record::{CostResult, DetectorRecord, FaultResult, ThresholdResult, VERDICT};
use crate::chart::{
    Axis, Category, ChartTable, Figure, Look, Mark, Marker, Panel, Regions, Scale, Series, Stroke,
};

/// Upper end of the axis of false alarms, per hour. Chosen: at most 360, one every 10 s,
/// can be counted.
const MOST_PER_H: f64 = 600.0;

/// Range of the delays drawn, s.
const DELAYS_S: (f64, f64) = (0.1, 30.0);

fn curves(records: &[DetectorRecord]) -> impl Iterator<Item = &ThresholdResult> {
    records.iter().filter_map(|r| if let DetectorRecord::Method(c) = r { Some(c) } else { None })
}

fn kinds(records: &[DetectorRecord]) -> impl Iterator<Item = &FaultResult> {
    records.iter().filter_map(|r| if let DetectorRecord::Fault(k) = r { Some(k) } else { None })
}

fn prices(records: &[DetectorRecord]) -> impl Iterator<Item = &CostResult> {
    records.iter().filter_map(|r| if let DetectorRecord::Cost(p) = r { Some(p) } else { None })
}

/// Returns the names and looks of all methods, the engine's verdict last.
fn methods() -> Vec<(String, Look)> {
    let swept = METHODS.iter().enumerate().map(|(i, m)| (m.name(), Look::of(i)));
    swept.chain([(VERDICT.to_owned(), Look { marker: Marker::Star, ..Look::BLACK })]).collect()
}

pub(super) fn figures(records: &[DetectorRecord]) -> Vec<(&'static str, Figure)> {
    vec![("delay", delay(records)), ("faults", by_fault(records))]
}

/// Draws the delay and the detected share over the false alarms.
fn delay(records: &[DetectorRecord]) -> Figure {
    let seconds = Scale::Log(DELAYS_S.0, DELAYS_S.1);
    let seconds = Axis::new("median delay after the first chance (s)", seconds);
    let share = Axis::new("servo faults found (%)", Scale::Linear(0.0, 103.0));
    // A delay of zero is drawn at the lower edge.
    let median = |c: &ThresholdResult| c.found.median_s.map(|s| s.max(DELAYS_S.0));
    Figure {
        title: "Servo faults: how soon they are found, and for how many false alarms".to_owned(),
        subtitle: conclusion(records),
        columns: 2,
        panel_height: 900,
        panels: vec![
            panel(records, "how soon (missed: never)", seconds, true, median),
            panel(records, "how many", share, false, |c| Some(100.0 * c.found.detected())),
        ],
    }
}

/// Draws one quantity over the false alarms; `text`: with labels at the thresholds in use.
fn panel(
    records: &[DetectorRecord],
    title: &str,
    y: Axis,
    text: bool,
    value: impl Fn(&ThresholdResult) -> Option<f64>,
) -> Panel {
    let healthy_h = curves(records).map(|c| c.healthy_h).fold(0.0, f64::max);
    let x = Axis::new("false alarms per hour of healthy time", alarms(healthy_h));
    let mut panel = Panel::new(title, x, y);
    panel.series.push(edge(&panel.y.scale, healthy_h));
    for (name, look) in methods() {
        let shown = shown(records, &name);
        let at = |c: &ThresholdResult| Some((place(c), value(c)?));
        let points = shown.iter().filter_map(|c| at(c)).collect();
        let stroke = if name == VERDICT { Stroke::Markers } else { Stroke::LineAndMarkers };
        let chosen = shown.iter().filter(|c| c.chosen && name != VERDICT);
        let text = |c: &ThresholdResult| if text { setting(c) } else { String::new() };
        panel.marks.extend(chosen.filter_map(|c| Some(mark(text(c), at(c)?))));
        panel.series.push(Series::new(name, look, stroke, points));
    }
    panel
}

/// Returns the line that separates the thresholds without a false alarm, on its left.
fn edge(y: &Scale, healthy_h: f64) -> Series {
    let (look, x) = (Look { dash: Some((4, 10)), ..Look::BLACK }, 0.7 / healthy_h);
    let line = vec![(x, y.ends().0), (x, y.ends().1)];
    let most = brief(3.0 / healthy_h);
    let name = format!("left of it: none in {} h (95 %: fewer than {most}/h)", brief(healthy_h));
    Series::new(name, look, Stroke::Line, line)
}

fn alarms(healthy_h: f64) -> Scale {
    Scale::Log(0.25 / healthy_h, MOST_PER_H)
}

/// Returns the x coordinate of a result: its rate; without an alarm in T hours, a value
/// left of 1/T.
fn place(curve: &ThresholdResult) -> f64 {
    match curve.false_alarms {
        0 => 0.4 / curve.healthy_h,
        _ => curve.per_h(),
    }
}

/// Returns the results drawn: of the thresholds without a false alarm only the least, as
/// greater ones only increase the delay, and those in use.
fn shown<'a>(records: &'a [DetectorRecord], method: &str) -> Vec<&'a ThresholdResult> {
    let mut silent = 0;
    let all = curves(records).filter(|c| c.method == method);
    all.filter(|c| {
        silent += u32::from(c.false_alarms == 0);
        silent < 2 || c.chosen
    })
    .collect()
}

fn mark(text: String, at: (f64, f64)) -> Mark {
    Mark { name: "thresholds that are in use".to_owned(), text, at }
}

/// Returns the threshold with its unit.
fn setting(curve: &ThresholdResult) -> String {
    match curve.threshold {
        Some(threshold) => format!("{} {}", brief(threshold), curve.unit),
        None => curve.unit.clone(),
    }
}

/// Rounds to two significant digits.
fn brief(value: f64) -> String {
    let digits = 1 - value.abs().log10().floor() as i32;
    if digits <= 0 {
        let unit = 10_f64.powi(-digits);
        return format!("{:.0}", (value / unit).round() * unit);
    }
    let text = format!("{value:.*}", digits as usize);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Returns the operating points, in the order of the records.
fn working(records: &[DetectorRecord]) -> Vec<&ThresholdResult> {
    curves(records).filter(|c| c.working).collect()
}

/// Draws the detected and the correctly isolated share: a row per fault, a column per
/// method.
fn by_fault(records: &[DetectorRecord]) -> Figure {
    let mut faults: Vec<&str> = Vec::new();
    for kind in kinds(records) {
        if kind.found.n_faults > 0 && !faults.contains(&kind.fault.as_str()) {
            faults.push(&kind.fault);
        }
    }
    // Rows are numbered from the bottom.
    faults.reverse();
    let panel = |title: &str, share: fn(&FaultResult) -> f64| {
        let columns = columns().iter().map(|(short, _)| (*short).to_owned()).collect();
        let rows = faults.iter().map(|f| faults::words(f)).collect();
        let x = Axis::new("", Scale::Names(columns));
        let mut panel = Panel::new(title, x, Axis::new("", Scale::Names(rows)));
        panel.regions = Some(grid(records, &faults, share));
        panel
    };
    Figure {
        title: "What each method finds, and whether it accuses what is broken".to_owned(),
        subtitle: working_points(records),
        columns: 2,
        panel_height: 130 + 42 * faults.len() as u32,
        panels: vec![
            panel("found", |k| k.found.detected()),
            panel("found, and what is broken accused", |k| k.found.right()),
        ],
    }
}

/// Returns the shares as a map of shades.
fn grid(records: &[DetectorRecord], faults: &[&str], share: fn(&FaultResult) -> f64) -> Regions {
    let shade = |(i, name): (usize, &&str)| Category {
        name: (*name).to_owned(),
        look: Look::step(i, SHARES.len()),
    };
    let cell = |fault: &str, method: &str| {
        let kind = kinds(records).find(|k| k.fault == fault && k.method == method);
        kind.map_or(SHARES.len(), |k| LEAST.iter().filter(|least| share(k) >= **least).count())
    };
    let cells = faults.iter().flat_map(|f| columns().map(|(_, method)| cell(f, &method)));
    let edges = |n: usize| (0..=n).map(|i| i as f64 - 0.5).collect();
    Regions {
        categories: SHARES.iter().enumerate().map(shade).collect(),
        x_edges: edges(columns().len()),
        y_edges: edges(faults.len()),
        cells: cells.collect(),
    }
}

/// Lower limits of the shades but the first.
const LEAST: [f64; 4] = [0.05, 0.5, 0.8, 0.95];
/// Names of the shades.
const SHARES: [&str; 5] = ["below 5 %", "5 to 50 %", "50 to 80 %", "80 to 95 %", "95 % and more"];

/// The methods compared by fault, with a short name.
fn columns() -> [(&'static str, String); 4] {
    [
        ("chapter", METHODS[1].name()),
        ("debounced", METHODS[2].name()),
        ("CUSUM", METHODS[4].name()),
        ("offbd", VERDICT.to_owned()),
    ]
}

/// Describes the operating points in words.
fn working_points(records: &[DetectorRecord]) -> String {
    let all = columns().into_iter().filter_map(|(short, method)| {
        let at = working(records).into_iter().find(|c| c.method == method)?;
        let median = at.found.median_s.map_or_else(|| "never".to_owned(), brief);
        Some(format!("{short} {} ({}/h, {median} s)", setting(at), per_h(at)))
    });
    format!(
        "Shares of the faults that had a chance. Set to (false alarms, median delay for servos): {}. Only the verdict can \
         accuse ball or readings.",
        all.collect::<Vec<_>>().join("; ")
    )
}

/// Describes the rate of false alarms in words.
fn rate(curve: &ThresholdResult) -> String {
    match curve.fewer_than_per_h {
        Some(most) => format!("fewer than {} false alarms an hour", brief(most)),
        None => format!("{} false alarms an hour", brief(curve.per_h())),
    }
}

/// Returns the rate of false alarms per hour as text.
fn per_h(curve: &ThresholdResult) -> String {
    match curve.fewer_than_per_h {
        Some(most) => format!("< {}", brief(most)),
        None => brief(curve.per_h()),
    }
}

fn conclusion(records: &[DetectorRecord]) -> String {
    let at = |method: &str| working(records).into_iter().find(|c| c.method == method);
    let said = |name: &str, c: &ThresholdResult| {
        let median = c.found.median_s.map_or_else(|| "–".to_owned(), |s| format!("{s:.1} s"));
        let found = 100.0 * c.found.detected();
        format!("{name} finds {found:.0} % (median delay {median}) with {}", rate(c))
    };
    let verdict = at(VERDICT).map(|c| said("offbd's verdict", c));
    let residual = METHODS[2].name();
    let silent = at(&residual).map(|c| said("the debounced residual", c));
    let chapter = at(&METHODS[1].name()).map(|c| said("the chapter's rule at its 0.01 m/s²", c));
    let all: Vec<String> = [verdict, silent, chapter].into_iter().flatten().collect();
    format!("Of servo faults with a chance, {}.", all.join("; "))
}

/// Returns a table of the thresholds in use, the operating points and the costs.
pub(super) fn table(records: &[DetectorRecord]) -> ChartTable {
    let mut table = ChartTable {
        heading: vec!["method", "set to", "false/h", "found %", "right %", "median s", "90 % s"],
        right: vec![2, 3, 4, 5, 6],
        rows: curves(records).filter(|c| c.chosen || c.working).map(row).collect(),
    };
    table.rows.extend(prices(records).map(|p| {
        let (ns, ratio) = (format!("{} ns", brief(p.cost_ns)), format!("{:.3}", p.ratio));
        let blank = String::new;
        vec![p.what.clone(), "CPU/sample".to_owned(), ns, ratio, blank(), blank(), blank()]
    }));
    table
}

fn row(c: &ThresholdResult) -> Vec<String> {
    let seconds = |s: Option<f64>| s.map_or_else(|| "never".to_owned(), |s| format!("{s:.2}"));
    let percent = |share: f64| format!("{:.0}", 100.0 * share);
    vec![
        c.method.clone(),
        setting(c),
        per_h(c),
        percent(c.found.detected()),
        percent(c.found.right()),
        seconds(c.found.median_s),
        seconds(c.found.p90_s),
    ]
}
