//! The records as drawings and as a table.

use std::collections::BTreeSet;

use super::record::Record;
use crate::chart::{Axis, Figure, Look, Panel, Scale, Series, Stroke, Table, front};

/// Ours as they are drawn: a name, the models and methods in it.
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

/// Errors drawn, m.
const ERRORS_M: (f64, f64) = (1e-9, 3e-2);

fn scenes(records: &[Record]) -> Vec<&str> {
    let mut seen = BTreeSet::new();
    records.iter().map(|r| r.scene.as_str()).filter(|scene| seen.insert(*scene)).collect()
}

fn on<'a>(records: &'a [Record], scene: &'a str) -> impl Iterator<Item = &'a Record> {
    records.iter().filter(move |r| r.scene == scene)
}

/// Our models and methods, and, with peers, ours beside theirs.
pub(super) fn figures(ours: &[Record], peers: &[Record]) -> Vec<(&'static str, Figure)> {
    let mut figures = vec![("models", figure(ours, peers, own_panel, models_title(ours)))];
    if !peers.is_empty() {
        figures.insert(0, ("peers", figure(ours, peers, peer_panel, peers_title(ours, peers))));
    }
    figures
}

fn figure(
    ours: &[Record],
    peers: &[Record],
    panel: fn(&[Record], &[Record], &str, &Scale) -> Panel,
    (title, subtitle): (String, String),
) -> Figure {
    let costs = ours.iter().chain(peers).filter_map(Record::point);
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

/// Error across, cost up, so that down and left is better.
fn place(point: (f64, f64)) -> (f64, f64) {
    (point.1, point.0)
}

fn own_panel(ours: &[Record], _: &[Record], scene: &str, y: &Scale) -> Panel {
    let mut panel = empty(scene, y);
    panel.series.push(best(on(ours, scene), "Pareto front", Look::BLACK, Stroke::Front));
    for (i, (name, models, methods)) in FAMILIES.iter().enumerate() {
        let member = |r: &&Record| {
            r.asked_m.is_none()
                && models.contains(&r.model.as_str())
                && methods.contains(&r.method.as_str())
        };
        let points = on(ours, scene).filter(member).filter_map(Record::point).map(place);
        panel.series.push(Series::new(*name, Look::of(i), Stroke::Markers, points.collect()));
    }
    panel.series.push(chosen(ours, scene));
    panel
}

fn peer_panel(ours: &[Record], peers: &[Record], scene: &str, y: &Scale) -> Panel {
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
    panel.series.push(chosen(ours, scene));
    panel
}

/// The front of some records.
fn best<'a>(
    records: impl Iterator<Item = &'a Record>,
    name: &str,
    look: Look,
    stroke: Stroke,
) -> Series {
    let points: Vec<(f64, f64)> =
        records.filter(|r| r.asked_m.is_none()).filter_map(Record::point).map(place).collect();
    let mut points: Vec<(f64, f64)> = front(&points).into_iter().map(|on| on.point).collect();
    points.retain(|(error, _)| (ERRORS_M.0..=ERRORS_M.1).contains(error));
    Series::new(name, look, stroke, points)
}

/// What the program chose.
fn chosen(ours: &[Record], scene: &str) -> Series {
    let chosen = on(ours, scene).filter(|r| r.asked_m.is_some()).filter_map(Record::point);
    let look = Look { marker: crate::chart::Marker::Star, ..Look::BLACK };
    Series::new("chosen for 1e-2 to 1e-6 m", look, Stroke::Markers, chosen.map(place).collect())
}

/// The cheapest charted configuration of ours on `scene` within `error_m`.
fn cheapest<'a>(ours: &'a [Record], scene: &'a str, error_m: f64) -> Option<&'a Record> {
    let fits = on(ours, scene).filter(|r| r.asked_m.is_none());
    let fits = fits.filter(|r| r.point().is_some_and(|(_, error)| error <= error_m));
    fits.min_by(|a, b| cost(a).total_cmp(&cost(b)))
}

fn cost(record: &Record) -> f64 {
    record.cpu_us_per_s.unwrap_or(f64::INFINITY)
}

fn models_title(ours: &[Record]) -> (String, String) {
    let chosen: Vec<&Record> = ours.iter().filter(|r| r.asked_m.is_some()).collect();
    let kept = chosen.iter().filter(|r| r.error_m <= r.asked_m).count();
    let ratios =
        chosen.iter().filter_map(|r| Some(cost(r) / cost(cheapest(ours, &r.scene, r.asked_m?)?)));
    let worst = ratios.fold(0.0, f64::max);
    let subtitle = format!(
        "Down and left is better. Of {} accuracies asked for, the program's choice met {kept}, at up \
         to {worst:.1} times the cost of the cheapest charted configuration that meets them.",
        chosen.len()
    );
    ("Speed against accuracy: models and methods".to_owned(), subtitle)
}

fn peers_title(ours: &[Record], peers: &[Record]) -> (String, String) {
    const BODIES: [&str; 4] = ["drake", "mujoco", "pybullet", "rapier"];
    let within = |records: &[Record], error_m: f64, wanted: &dyn Fn(&Record) -> bool| {
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

/// What was chosen, beside the cheapest that was charted.
pub(super) fn table(ours: &[Record]) -> Table {
    let heading = vec![
        "scene",
        "asked m",
        "chosen",
        "error m",
        "µs/s",
        "choosing",
        "cheapest charted",
        "ratio",
    ];
    let mut table = Table { heading, right: vec![1, 3, 4, 5, 7], rows: Vec::new() };
    for record in ours.iter().filter(|r| r.asked_m.is_some()) {
        let asked = record.asked_m.unwrap_or(f64::NAN);
        let other = cheapest(ours, &record.scene, asked);
        let named = other.map(|o| format!("{} {} {:.0e}", o.model, o.method, o.value));
        let ratio = other.map(|o| format!("{:.2}", cost(record) / cost(o)));
        table.rows.push(vec![
            record.scene.clone(),
            format!("{asked:.0e}"),
            format!("{} {}", record.model, record.method),
            format!("{:.1e}", record.error_m.unwrap_or(f64::NAN)),
            format!("{:.2}", cost(record)),
            format!("{:.0}", record.choosing_us_per_s.unwrap_or(f64::NAN)),
            named.unwrap_or_default(),
            ratio.unwrap_or_default(),
        ]);
    }
    table
}
