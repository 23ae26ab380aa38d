//! Drawings of runs: position over time, the path on the plate, two bodies side by side.

use super::report;
use super::scene_run::{Sampled, SceneRun};
use super::words;
use offbd_core::plant::{Motion, Plate, PlateShape};
use offbd_lab::chart::{Axis, Figure, Look, Mark, Panel, Scale, Series, Stroke, equal_scales};

/// Maximum number of marked events; chosen: more would hide the line.
const MOST_MARKS: usize = 4;

/// Interval below which events share their text, as a share of the scene; chosen.
const CLOSE: f64 = 0.08;

/// Height of a panel over time, pixels; chosen.
const PANEL_HEIGHT: u32 = 760;

/// Margin around the data as a share of its extent; chosen.
const MARGIN: f64 = 0.06;

/// Range drawn beyond the plate if the ball falls off, as a share of the plate's half
/// extent; chosen.
const BEYOND: f64 = 0.8;

pub(super) fn line(name: &str, look: usize, points: Vec<(f64, f64)>) -> Series {
    Series::new(name, Look::of(look), Stroke::Line, points)
}

/// Returns a panel of the series, with time from 0 to `duration_s` along x.
pub(super) fn time_panel(y: &str, duration_s: f64, series: Vec<Series>) -> Panel {
    let values = series.iter().flat_map(|series| series.points.iter()).map(|p| p.1);
    let values = Scale::linear_around(values, MARGIN);
    let mut panel = Panel::new("", time_axis(duration_s), Axis::new(y, values));
    panel.series = series;
    panel
}

pub(super) fn time_axis(duration_s: f64) -> Axis {
    Axis::new("time (s)", Scale::Linear(0.0, duration_s))
}

pub(super) fn figure(
    title: String,
    subtitle: String,
    columns: usize,
    panels: Vec<Panel>,
) -> Figure {
    Figure { title, subtitle, columns, panel_height: PANEL_HEIGHT, panels }
}

fn ran(scene_run: &SceneRun) -> String {
    let configuration = report::ran(scene_run);
    let mut chars = configuration.chars();
    let first = chars.next().map(|c| c.to_uppercase().to_string()).unwrap_or_default();
    format!("{first}{}.", chars.as_str())
}

/// Draws x and y over time.
pub(super) fn position(scene_run: &SceneRun) -> Figure {
    let of = |name: &str, i: usize| {
        line(name, i, scene_run.samples.iter().map(|(t, at)| (*t, at.position[i])).collect())
    };
    let series = vec![of("x", 0), of("y", 1)];
    let mut panel = time_panel("position on the plate (m)", scene_run.scene.duration_s, series);
    panel.marks = marks(scene_run, |t, at| {
        let (x, y) = (at.position.x, at.position.y);
        (t, if x.abs() > y.abs() { x } else { y })
    });
    figure(format!("{}: position over time", scene_run.name), ran(scene_run), 1, vec![panel])
}

/// Returns marks for the first events after the start, each at the point that `place`
/// returns. Texts that would overlap are joined.
fn marks(scene_run: &SceneRun, place: impl Fn(f64, &Motion) -> (f64, f64)) -> Vec<Mark> {
    let mut marks: Vec<Mark> = Vec::new();
    let mut named: Option<(usize, f64)> = None;
    for event in scene_run.events.iter().skip(1).take(MOST_MARKS) {
        let Some((_, at)) = scene_run.samples.iter().find(|(t, _)| *t >= event.at_s) else { break };
        let what = words::event(event, &scene_run.scene);
        let near = |t: f64| event.at_s - t < CLOSE * scene_run.scene.duration_s;
        let text = match named.filter(|&(_, t)| near(t)) {
            Some((first, _)) => {
                marks[first].text += &format!(", {what}");
                String::new()
            }
            None => {
                named = Some((marks.len(), event.at_s));
                what.to_owned()
            }
        };
        let name = "what happens (sliding model)".to_owned();
        marks.push(Mark { name, text, at: place(event.at_s, at) });
    }
    marks
}

/// Draws the path on the plate, with the outline of the plate if it has edges.
pub(super) fn path(scene_run: &SceneRun) -> Figure {
    let points: Vec<(f64, f64)> = scene_run.samples.iter().map(place).collect();
    let mut ranges = [0, 1].map(|i| range(&points, i));
    let mut series = Vec::new();
    if scene_run.scene.edges {
        let outline = outline(&scene_run.scene.plate);
        for (i, range) in ranges.iter_mut().enumerate() {
            *range = beside_the_plate(*range, self::range(&outline, i));
        }
        series.push(Series::new("edge of the plate", Look::BLACK, Stroke::Line, outline));
    }
    let [x, y] = with_margin(ranges);
    // Points outside the axes are not drawn, so the path ends at the first one.
    let seen = |p: &&(f64, f64)| (x.0..=x.1).contains(&p.0) && (y.0..=y.1).contains(&p.1);
    let path = points.iter().take_while(seen).copied().collect();
    series.push(line("path of the centre", 0, path));
    let (x, y, panel_height) = equal_scales(x, y);
    let mut panel = Panel::new("", Axis::new("x (m)", x), Axis::new("y (m)", y));
    panel.series = series;
    if let Some(start) = points.first() {
        let name = "start".to_owned();
        panel.marks.push(Mark { text: name.clone(), name, at: *start });
    }
    panel.marks.extend(edge(scene_run));
    Figure {
        title: format!("{}: path on the plate", scene_run.name),
        subtitle: format!("{} Plate frame, {} s.", ran(scene_run), scene_run.scene.duration_s),
        columns: 1,
        panel_height,
        panels: vec![panel],
    }
}

/// Returns the mark where the ball passes the edge, if it does.
fn edge(scene_run: &SceneRun) -> Option<Mark> {
    let falls = scene_run.events.iter().find(|event| event.what == "falls")?;
    let sample = scene_run.samples.iter().find(|(t, _)| *t >= falls.at_s)?;
    let name = "past the edge".to_owned();
    Some(Mark { text: format!("{:.3} s", falls.at_s), name, at: place(sample) })
}

fn place((_, at): &Sampled) -> (f64, f64) {
    (at.position.x, at.position.y)
}

fn range(points: &[(f64, f64)], i: usize) -> (f64, f64) {
    let values = points.iter().map(|p| if i == 0 { p.0 } else { p.1 }).filter(|v| v.is_finite());
    let (low, high) =
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    if low <= high { (low, high) } else { (0.0, 0.0) }
}

/// Returns the range of the plate's `edge`, extended by the part of the path's `range` near
/// it.
fn beside_the_plate(range: (f64, f64), edge: (f64, f64)) -> (f64, f64) {
    let beyond = BEYOND * (edge.1 - edge.0) / 2.0;
    (range.0.clamp(edge.0 - beyond, edge.0), range.1.clamp(edge.1, edge.1 + beyond))
}

/// Adds a margin to both ranges, and widens one that is narrow against the other.
fn with_margin(ranges: [(f64, f64); 2]) -> [(f64, f64); 2] {
    let longest = ranges.iter().map(|(low, high)| high - low).fold(1e-9, f64::max);
    ranges.map(|(low, high)| {
        let length = (high - low).max(0.2 * longest);
        let middle = f64::midpoint(low, high);
        let half = length / 2.0 + MARGIN * longest;
        (middle - half, middle + half)
    })
}

/// Returns the corners of a rectangular plate, or points around a round one.
fn outline(plate: &Plate) -> Vec<(f64, f64)> {
    match plate.shape() {
        PlateShape::Rectangle { length_m, width_m } => {
            let (x, y) = (length_m / 2.0, width_m / 2.0);
            vec![(-x, -y), (x, -y), (x, y), (-x, y), (-x, -y)]
        }
        PlateShape::Round { diameter_m } => (0..=180)
            .map(|i| f64::from(i) * std::f64::consts::TAU / 180.0)
            .map(|angle| (diameter_m / 2.0 * angle.cos(), diameter_m / 2.0 * angle.sin()))
            .collect(),
    }
}

/// Draws the distance of each body from its start on a linear and a logarithmic axis; the
/// latter shows a body that creeps beside one that rolls.
pub(super) fn side_by_side(scene_runs: &[SceneRun]) -> Figure {
    let duration_s =
        scene_runs.iter().map(|scene_run| scene_run.scene.duration_s).fold(0.0, f64::max);
    let panel = |points: fn(&SceneRun) -> Vec<(f64, f64)>| {
        let lines = scene_runs.iter().enumerate();
        let lines =
            lines.map(|(i, scene_run)| line(body(scene_run), i, points(scene_run))).collect();
        time_panel("way from the start (m)", duration_s, lines)
    };
    let (plain, mut log) = (panel(distance), panel(distance));
    let distances = log.series.iter().flat_map(|series| series.points.iter());
    log.y.scale = Scale::log_around(distances.map(|p| p.1), MARGIN);
    let names: Vec<&str> = scene_runs.iter().map(body).collect();
    let subtitle = "On the same plate; linear on the left, logarithmic on the right.".to_owned();
    figure(format!("The {} side by side", names.join(" and the ")), subtitle, 2, vec![plain, log])
}

fn body(scene_run: &SceneRun) -> &'static str {
    if scene_run.scene.body().turns() { "ball" } else { "block" }
}

fn distance(scene_run: &SceneRun) -> Vec<(f64, f64)> {
    let start = scene_run.scene.initial.position.xy();
    scene_run.samples.iter().map(|(t, at)| (*t, (at.position.xy() - start).norm())).collect()
}
