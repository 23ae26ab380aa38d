//! Presents the records as drawings and as a table.

use super::family::{DRAWN, FAMILIES, Family};
use super::record::EstimatorRecord;
use crate::chart::{Axis, ChartTable, Figure, Look, Mark, Panel, Scale, Series, Stroke};

/// Range of the delays drawn, ms.
const DELAYS_MS: (f64, f64) = (5.0, 500.0);

/// Largest error drawn, m/s². Chosen: about ten times the rms of the signal.
const LARGEST: f64 = 3.0;

/// Rounds to two significant digits.
fn brief(value: f64) -> String {
    let digits = 1 - value.abs().log10().floor() as i32;
    if digits <= 0 {
        let unit = 10_f64.powi(-digits);
        return format!("{:.0}", (value / unit).round() * unit);
    }
    format!("{value:.*}", digits as usize)
}

fn millimetres(noise_m: f64) -> String {
    format!("{} mm", (noise_m * 1e6).round() * 1e-3)
}

/// Groups the records by rate and noise, in their order.
fn groups(records: &[EstimatorRecord]) -> Vec<&[EstimatorRecord]> {
    records.chunk_by(|a, b| a.rate_hz == b.rate_hz && a.noise_m == b.noise_m).collect()
}

/// Draws error over delay, and cost over the length of the window.
pub(super) fn figures(records: &[EstimatorRecord], nothing: f64) -> Vec<(&'static str, Figure)> {
    let mut groups = groups(records);
    let columns = groups.iter().filter(|g| g[0].noise_m == records[0].noise_m).count();
    // One row of panels per noise.
    groups.sort_by(|a, b| a[0].noise_m.total_cmp(&b[0].noise_m));
    let least = records.iter().map(|r| r.error_m_s2).fold(LARGEST / 10.0, f64::min);
    let y = Scale::Log(0.8 * least, LARGEST);
    let panels = groups.iter().map(|group| panel(group, nothing, &y)).collect();
    let errors = Figure {
        title: "Acceleration from noisy positions: error against delay".to_owned(),
        subtitle: conclusion(records),
        columns,
        panel_height: if columns > 1 { 540 } else { 900 },
        panels,
    };
    vec![("error", errors), ("cost", cost(records))]
}

/// Returns the records of `family` without the engine's own.
fn of<'a>(group: &'a [EstimatorRecord], family: &str) -> impl Iterator<Item = &'a EstimatorRecord> {
    group.iter().filter(move |r| r.family == family && !r.offbd)
}

fn panel(group: &[EstimatorRecord], nothing: f64, y: &Scale) -> Panel {
    let title = format!("{} Hz, noise {}", group[0].rate_hz, millimetres(group[0].noise_m));
    let x = Axis::new("delay (ms)", Scale::Log(DELAYS_MS.0, DELAYS_MS.1));
    let mut panel = Panel::new(title, x, Axis::new("rms error (m/s²)", y.clone()));
    let point = |r: &EstimatorRecord| (r.delay_s * 1e3, r.error_m_s2);
    let mut front: Vec<(f64, f64)> = group.iter().filter(|r| r.front).map(point).collect();
    front.sort_by(|a, b| a.0.total_cmp(&b.0));
    panel.series.push(Series::new("Pareto front", Look::BLACK, Stroke::Front, front));
    let line = vec![(DELAYS_MS.0, nothing), (DELAYS_MS.1, nothing)];
    let dotted = Look { dash: Some((4, 10)), ..Look::BLACK };
    panel.series.push(Series::new("always saying zero", dotted, Stroke::Line, line));
    for (name, look) in drawn() {
        let points = of(group, &name).map(point).collect();
        panel.series.push(Series::new(name, look, Stroke::LineAndMarkers, points));
    }
    let own = group.iter().filter(|r| r.offbd);
    panel.marks.extend(own.map(|r| mark(r, point(r))));
    panel
}

fn mark(own: &EstimatorRecord, at: (f64, f64)) -> Mark {
    let name = format!("offbd's setting: {} s", own.value);
    Mark { name, text: String::new(), at }
}

/// Returns names and looks of the drawn families.
fn drawn() -> Vec<(String, Look)> {
    let look = |i: usize| if i == 6 { Look { dash: None, ..Look::of(6) } } else { Look::of(i) };
    FAMILIES[..DRAWN].iter().enumerate().map(|(i, f)| (f.name(), look(i))).collect()
}

/// Draws CPU time per sample over the window in samples, at all rates.
fn cost(records: &[EstimatorRecord]) -> Figure {
    let noise_m = records[0].noise_m;
    let x = Axis::new(
        "window (samples; of recursive filters twice the delay)",
        Scale::Log(2.0, 1500.0),
    );
    let costs = records.iter().map(|r| r.cost_ns);
    let y = Axis::new("CPU time per sample (ns)", Scale::log_around(costs, 0.06));
    let mut panel = Panel::new("", x, y);
    let memory_s =
        |r: &EstimatorRecord| if r.setting == "window_s" { r.value } else { 2.0 * r.delay_s };
    let point = |r: &EstimatorRecord| (memory_s(r) * r.rate_hz + 1.0, r.cost_ns);
    for (name, look) in drawn() {
        let mut points: Vec<(f64, f64)> =
            of(records, &name).filter(|r| r.noise_m == noise_m).map(point).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        panel.series.push(Series::new(name, look, Stroke::LineAndMarkers, points));
    }
    let own = records.iter().filter(|r| r.offbd && r.noise_m == noise_m);
    panel.marks.extend(own.map(|r| mark(r, point(r))));
    Figure {
        title: "What an acceleration estimate costs".to_owned(),
        subtitle: cost_conclusion(records),
        columns: 1,
        panel_height: 800,
        panels: vec![panel],
    }
}

fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, 0.0), |(low, high), v| (low.min(v), high.max(v)))
}

/// Writes `low to high`, or one number if both round to the same.
fn span((low, high): (f64, f64)) -> String {
    let (low, high) = (brief(low), brief(high));
    if low == high { low } else { format!("{low} to {high}") }
}

/// Returns the drawn record with the least error among those with no more delay than `own`
/// plus a millisecond.
fn best_as_quick<'a>(
    group: &'a [EstimatorRecord],
    own: &EstimatorRecord,
) -> Option<&'a EstimatorRecord> {
    let names: Vec<String> = drawn().into_iter().map(|(name, _)| name).collect();
    let quick =
        group.iter().filter(|r| names.contains(&r.family) && r.delay_s < own.delay_s + 1e-3);
    quick.min_by(|a, b| a.error_m_s2.total_cmp(&b.error_m_s2))
}

fn conclusion(records: &[EstimatorRecord]) -> String {
    let own: Vec<&EstimatorRecord> = records.iter().filter(|r| r.offbd).collect();
    let Some(first) = own.first() else { return String::new() };
    let window = first.value;
    let of_own = |part: fn(&EstimatorRecord) -> f64| span(range(own.iter().map(|r| part(r))));
    let (errors, noise) = (of_own(|r| r.error_m_s2), of_own(|r| r.noise_m_s2));
    let ratios = groups(records).into_iter().filter_map(|group| {
        let own = group.iter().find(|r| r.offbd)?;
        Some(own.error_m_s2 / best_as_quick(group, own)?.error_m_s2)
    });
    let ratios = span(range(ratios));
    let raw = span(range(groups(records).into_iter().filter_map(rawest)));
    format!(
        "offbd's quadratic over {window} s errs by {errors} m/s², by {noise} from noise and else from \
         smoothing, which its twin shares; the best with no more delay errs {ratios} times less, \
         second differences of raw positions by {raw} m/s²."
    )
}

/// Returns the error of the second difference with the shortest window.
fn rawest(group: &[EstimatorRecord]) -> Option<f64> {
    let name = Family::Difference.name();
    of(group, &name).min_by(|a, b| a.value.total_cmp(&b.value)).map(|r| r.error_m_s2)
}

fn cost_conclusion(records: &[EstimatorRecord]) -> String {
    let most = |family: Family| range(of(records, &family.name()).map(|r| r.cost_ns)).1;
    let own = range(records.iter().filter(|r| r.offbd).map(|r| r.cost_ns)).1;
    format!(
        "offbd's fit over real time stamps costs {} ns whatever its window, a Kalman filter {} ns, \
         a weighted sum up to {} ns.",
        brief(own),
        brief(most(Family::Kalman)),
        brief(most(FAMILIES[3])),
    )
}

/// Returns a table for the middle group of rate and noise: the engine's own estimator, and
/// of each family the one with the least error among those with no more delay.
pub(super) fn table(records: &[EstimatorRecord]) -> ChartTable {
    let groups = groups(records);
    let group = groups[groups.len() / 2];
    let mut table = ChartTable {
        heading: vec!["estimator", "tuned to", "delay ms", "error m/s²", "ns/sample"],
        right: vec![1, 2, 3, 4],
        rows: Vec::new(),
    };
    let Some(own) = group.iter().find(|r| r.offbd) else { return table };
    table.rows.push(row("offbd's own", own, Family::SlidingFit));
    for family in FAMILIES {
        let name = family.name();
        let quick = of(group, &name).filter(|r| r.delay_s < own.delay_s + 1e-3);
        let best = quick.min_by(|a, b| a.error_m_s2.total_cmp(&b.error_m_s2));
        table.rows.extend(best.map(|r| row(&r.family, r, family)));
    }
    table
}

fn row(name: &str, record: &EstimatorRecord, family: Family) -> Vec<String> {
    vec![
        name.to_owned(),
        family.tuning(record.value),
        format!("{:.0}", record.delay_s * 1e3),
        brief(record.error_m_s2),
        brief(record.cost_ns),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_two_digits() {
        for (value, text) in [(0.0563, "0.056"), (4899.0, "4900"), (1.04, "1.0"), (37.2, "37")] {
            assert_eq!(brief(value), text);
        }
        assert_eq!([millimetres(1e-4), millimetres(2e-3)], ["0.1 mm", "2 mm"]);
    }
}
