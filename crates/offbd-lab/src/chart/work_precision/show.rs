//! Presents the records as drawings and as a table.

use std::collections::BTreeSet;

use super::record::WorkPrecisionRecord;
use crate::chart::{Axis, ChartTable, Figure, Look, Panel, Scale, Series, Stroke, front};

/// Groups of offbd's configurations as they are drawn: a name, models and methods.
const FAMILIES: [(&str, &[&str], &[&str]); 6] = [
    ("rolling", &["rolling"], &["midpoint", "rk4", "dopri5"]),
    ("creeping", &["creeping"], &["midpoint", "rk4", "dopri5"]),
    ("sliding, with events", &["sliding"], &["dopri5"]),
    ("compliant, contact step", &["compliant"], &["contact-step"]),
    ("compliant, RODAS", &["compliant"], &["rodas3", "rodas4"]),
    (
        "compliant, explicit",
        &["compliant"],
        &["euler", "semi-implicit-euler", "midpoint", "rk4", "dopri5"],
    ),
];

/// Range of the errors drawn, m.
const ERRORS_M: (f64, f64) = (1e-9, 3e-2);

fn scenes(records: &[WorkPrecisionRecord]) -> Vec<&str> {
    let mut seen = BTreeSet::new();
    records.iter().map(|r| r.scene.as_str()).filter(|scene| seen.insert(*scene)).collect()
}

fn on<'a>(
    records: &'a [WorkPrecisionRecord],
    scene: &'a str,
) -> impl Iterator<Item = &'a WorkPrecisionRecord> {
    records.iter().filter(move |r| r.scene == scene)
}

/// Draws offbd's models and methods, and, if there are peers, offbd beside them.
pub(super) fn figures(
    ours: &[WorkPrecisionRecord],
    peers: &[WorkPrecisionRecord],
) -> Vec<(&'static str, Figure)> {
    let mut figures = vec![("models", figure(ours, peers, own_panel, models_title(ours)))];
    if !peers.is_empty() {
        figures.insert(0, ("peers", figure(ours, peers, peer_panel, peers_title(ours, peers))));
    }
    figures
}

fn figure(
    ours: &[WorkPrecisionRecord],
    peers: &[WorkPrecisionRecord],
    panel: fn(&[WorkPrecisionRecord], &[WorkPrecisionRecord], &str, &Scale) -> Panel,
    (title, subtitle): (String, String),
) -> Figure {
    let costs = ours.iter().chain(peers).filter_map(WorkPrecisionRecord::point);
    let costs = costs.filter(|(_, error)| (ERRORS_M.0..ERRORS_M.1).contains(error)).map(|p| p.0);
    let y = Scale::log_around(costs, 0.05);
    let scenes = scenes(ours);
    let panels: Vec<Panel> = scenes.iter().map(|scene| panel(ours, peers, scene, &y)).collect();
    Figure { title, subtitle, columns: panels.len().min(3), panel_height: 640, panels }
}

fn empty(scene: &str, y: &Scale) -> Panel {
    let contact = if scene.ends_with("-soft") { "soft contact" } else { "hard contact" };
    let law = scene.trim_end_matches("-soft");
    let x = Axis::new("worst error of position (m)", Scale::Log(ERRORS_M.0, ERRORS_M.1));
    let y = Axis::new("CPU time (µs per simulated second)", y.clone());
    Panel::new(format!("{law}, {contact}"), x, y)
}

/// Swaps cost and error: error along x, cost along y, so that down and left is better.
fn place(point: (f64, f64)) -> (f64, f64) {
    (point.1, point.0)
}

fn own_panel(
    ours: &[WorkPrecisionRecord],
    _: &[WorkPrecisionRecord],
    scene: &str,
    y: &Scale,
) -> Panel {
    let mut panel = empty(scene, y);
    panel.series.push(best(on(ours, scene), "Pareto front", Look::BLACK, Stroke::Front));
    for (i, (name, models, methods)) in FAMILIES.iter().enumerate() {
        let member = |r: &&WorkPrecisionRecord| {
            r.asked_m.is_none()
                && models.contains(&r.model.as_str())
                && methods.contains(&r.method.as_str())
        };
        let points =
            on(ours, scene).filter(member).filter_map(WorkPrecisionRecord::point).map(place);
        panel.series.push(Series::new(*name, Look::of(i), Stroke::Markers, points.collect()));
    }
    panel.series.push(in_one_pass(ours, scene));
    panel
}

fn peer_panel(
    ours: &[WorkPrecisionRecord],
    peers: &[WorkPrecisionRecord],
    scene: &str,
    y: &Scale,
) -> Panel {
    let mut panel = empty(scene, y);
    let engines: BTreeSet<&str> = peers.iter().map(|r| r.engine.as_str()).collect();
    for (i, engine) in engines.iter().enumerate() {
        let theirs = on(peers, scene).filter(|r| r.engine == *engine);
        panel.series.push(best(theirs, engine, Look::of(i), Stroke::LineAndMarkers));
    }
    panel.series.push(best(
        on(ours, scene),
        "offbd, all that is charted",
        Look::BLACK,
        Stroke::Front,
    ));
    panel.series.push(in_one_pass(ours, scene));
    panel
}

/// Returns the Pareto front of some records as a series.
fn best<'a>(
    records: impl Iterator<Item = &'a WorkPrecisionRecord>,
    name: &str,
    look: Look,
    stroke: Stroke,
) -> Series {
    let points: Vec<(f64, f64)> = records
        .filter(|r| r.asked_m.is_none())
        .filter_map(WorkPrecisionRecord::point)
        .map(place)
        .collect();
    let mut points: Vec<(f64, f64)> = front(&points).into_iter().map(|on| on.point).collect();
    points.retain(|(error, _)| (ERRORS_M.0..=ERRORS_M.1).contains(error));
    Series::new(name, look, stroke, points)
}

/// Returns the runs in one pass as a series; errors too small to be drawn at the edge.
fn in_one_pass(ours: &[WorkPrecisionRecord], scene: &str) -> Series {
    let runs = on(ours, scene).filter(|r| r.asked_m.is_some());
    let points = runs.filter_map(|r| Some((r.error_m?.max(ERRORS_M.0), r.cpu_us_per_s?)));
    let look = Look { marker: crate::chart::Marker::Star, ..Look::BLACK };
    Series::new("one pass within 1e-2 to 1e-6 m", look, Stroke::Markers, points.collect())
}

/// Returns the cheapest charted configuration of offbd on `scene` within `error_m`.
fn cheapest<'a>(
    ours: &'a [WorkPrecisionRecord],
    scene: &'a str,
    error_m: f64,
) -> Option<&'a WorkPrecisionRecord> {
    let fits = on(ours, scene).filter(|r| r.asked_m.is_none());
    let fits = fits.filter(|r| r.point().is_some_and(|(_, error)| error <= error_m));
    fits.min_by(|a, b| cost(a).total_cmp(&cost(b)))
}

fn cost(record: &WorkPrecisionRecord) -> f64 {
    record.cpu_us_per_s.unwrap_or(f64::INFINITY)
}

fn models_title(ours: &[WorkPrecisionRecord]) -> (String, String) {
    let asked: Vec<&WorkPrecisionRecord> = ours.iter().filter(|r| r.asked_m.is_some()).collect();
    let kept = asked.iter().filter(|r| r.error_m <= r.asked_m).count();
    let ratios =
        asked.iter().filter_map(|r| Some(cost(r) / cost(cheapest(ours, &r.scene, r.asked_m?)?)));
    let mut ratios: Vec<f64> = ratios.collect();
    ratios.sort_by(f64::total_cmp);
    let [median, worst] = [ratios.len() / 2, ratios.len().saturating_sub(1)]
        .map(|i| ratios.get(i).copied().unwrap_or(f64::NAN));
    let subtitle = format!(
        "Down and left is better. Of {} accuracies asked for, one pass kept {kept}, at {median:.1} \
         times the cost of the cheapest charted configuration that meets them (median; at most \
         {worst:.0}).",
        asked.len()
    );
    ("Speed against accuracy: models and methods".to_owned(), subtitle)
}

fn peers_title(ours: &[WorkPrecisionRecord], peers: &[WorkPrecisionRecord]) -> (String, String) {
    const BODIES: [&str; 4] = ["drake", "mujoco", "pybullet", "rapier"];
    let within = |records: &[WorkPrecisionRecord],
                  error_m: f64,
                  wanted: &dyn Fn(&WorkPrecisionRecord) -> bool| {
        let fits = on(records, "sine").filter(|r| r.asked_m.is_none() && wanted(r));
        let fits = fits.filter(|r| r.point().is_some_and(|(_, error)| error <= error_m));
        fits.map(cost).fold(f64::INFINITY, f64::min)
    };
    let own = within(ours, 1e-4, &|_| true);
    let bodies = within(peers, 1e-4, &|r| BODIES.iter().any(|b| r.engine.starts_with(b)));
    let solvers = within(peers, 1e-4, &|r| !BODIES.iter().any(|b| r.engine.starts_with(b)));
    let subtitle = format!(
        "Down and left is better. Within 1e-4 m on the hard sine: offbd {own:.1} µs per simulated \
         second, the best solver of others {solvers:.1}, the best rigid-body engine {bodies:.0}."
    );
    ("Speed against accuracy: beside other people's engines and solvers".to_owned(), subtitle)
}

/// Returns a table of the runs in one pass, with the cheapest charted configuration.
pub(super) fn table(ours: &[WorkPrecisionRecord]) -> ChartTable {
    let heading =
        vec!["scene", "asked m", "in one pass", "error m", "µs/s", "cheapest charted", "ratio"];
    let mut table = ChartTable { heading, right: vec![1, 3, 4, 6], rows: Vec::new() };
    for record in ours.iter().filter(|r| r.asked_m.is_some()) {
        let asked = record.asked_m.unwrap_or(f64::NAN);
        let other = cheapest(ours, &record.scene, asked);
        let named = other.map(|o| format!("{} {} {:.0e}", o.model, o.method, o.value));
        let ratio = other.map(|o| format!("{:.2}", cost(record) / cost(o)));
        table.rows.push(vec![
            record.scene.clone(),
            format!("{asked:.0e}"),
            record.model.clone(),
            format!("{:.1e}", record.error_m.unwrap_or(f64::NAN)),
            format!("{:.2}", cost(record)),
            named.unwrap_or_default(),
            ratio.unwrap_or_default(),
        ]);
    }
    table
}
