//! Application 1: the plate in closed loop.

use nalgebra::Vector2;
use serde_json::{Value, json};

use super::SceneArgs;
use super::course::{Course, Plan, Sampled};
use super::files::Folder;
use super::{laws, plots, report};
use crate::cli::output::{self, Format};
use offbd_core::plant::{Ball, Contact, GRAVITY_M_S2, Plate};
use offbd_core::vocabulary::{Invalid, Sample};
use offbd_lab::chart::Figure;
use offbd_lab::scene::{Controlled, Loop, Push, Scene, Subject, Turn};

const DURATION_S: f64 = 30.0;

/// Where the ball starts, m: off the centre along both axes.
const START_M: [f64; 2] = [0.08, -0.05];

/// The chapter's impulse, 10 % of the ball's weight along x at 10 s. An impulse
/// has no force; it is taken as a pulse of 0.1 s.
const PUSH_SHARE: f64 = 0.1;
const PUSH_AT_S: f64 = 10.0;
const PUSH_S: f64 = 0.1;

/// What the exercise asks: back within 2 cm of the centre by 17 s.
const NEAR_M: f64 = 0.02;
const BACK_BY_S: f64 = 17.0;

pub(super) fn run(args: &SceneArgs, impulse: bool) -> anyhow::Result<()> {
    let ball = Ball::default();
    let scene = scene(ball)?;
    let pushes = if impulse { vec![push(&ball)] } else { Vec::new() };
    let mut drive = Controlled::new(Loop::chapter(&ball), pushes);
    let name = if impulse { "pid-impulse" } else { "pid" };
    let plan = Plan { how: &args.how, sample: args.sample, sampled: true };
    let course = plan.run(name, &scene, &mut drive).inspect_err(laws::say_tried)?;
    let answer = Answer::of(&course.samples, impulse);
    if let Some(folder) = Folder::new(args.output.as_deref())? {
        write(&folder, &course, drive.turns())?;
    }
    laws::warn(&course);
    match args.format {
        Format::Table => output::line(&lines(&course, &answer).join("\n"))?,
        Format::Json => {
            let mut object = report::object(&course);
            object["control"] = answer.object();
            output::line(&object.to_string())?;
        }
    }
    laws::failed(std::slice::from_ref(&course))
}

fn scene(ball: Ball) -> Result<Scene, Invalid> {
    let subject = Subject::Ball(ball);
    let mut scene = Scene::new(subject, Plate::CHAPTER, Contact::CHAPTER, DURATION_S)?;
    scene.edges = true;
    [scene.initial.position.x, scene.initial.position.y] = START_M;
    Ok(scene)
}

fn push(ball: &Ball) -> Push {
    let force = PUSH_SHARE * ball.mass_kg() * GRAVITY_M_S2;
    Push { force: Vector2::new(force, 0.0), start_s: PUSH_AT_S, duration_s: PUSH_S }
}

/// What the loop achieved.
struct Answer {
    /// From when on the ball was within 2 cm, before any push, s.
    settled_s: Option<f64>,
    /// After the push: the largest distance, m, and when, s.
    farthest: Option<(f64, f64)>,
    /// The last moment beyond 2 cm after the push, s; none: never beyond.
    beyond_s: Option<f64>,
    /// Whether it was near from 17 s on, to the end.
    back: Option<bool>,
}

impl Answer {
    fn of(samples: &[Sampled], impulse: bool) -> Self {
        let before_s = if impulse { PUSH_AT_S } else { f64::INFINITY };
        let far = |s: &Sampled| s.1.position.xy().norm();
        let (before, after): (Vec<&Sampled>, Vec<&Sampled>) =
            samples.iter().partition(|(t, _)| *t < before_s);
        let last_far = before.iter().rposition(|s| far(s) > NEAR_M);
        let settled_s = before.get(last_far.map_or(0, |i| i + 1)).map(|s| s.0);
        let farthest = after.iter().map(|s| (far(s), s.0)).max_by(|a, b| a.0.total_cmp(&b.0));
        let beyond_s = after.iter().rev().find(|s| far(s) > NEAR_M).map(|s| s.0);
        let reached = samples.last().is_some_and(|s| s.0 >= BACK_BY_S);
        let back = (impulse && reached).then(|| beyond_s.is_none_or(|t| t < BACK_BY_S));
        Self { settled_s, farthest, beyond_s, back }
    }

    fn object(&self) -> Value {
        json!({
            "settled_s": self.settled_s,
            "farthest_m": self.farthest.map(|f| f.0),
            "farthest_s": self.farthest.map(|f| f.1),
            "beyond_2_cm_until_s": self.beyond_s,
            "back_by_17_s": self.back,
        })
    }
}

fn lines(course: &Course, answer: &Answer) -> Vec<String> {
    let mut lines = report::lines(course);
    lines.push(String::new());
    let settled = answer.settled_s.map_or_else(
        || "not within 2 cm of the centre".to_owned(),
        |t| format!("within 2 cm of the centre from {t:.2} s on"),
    );
    lines.push(report::row("settled", &settled));
    let Some((far, at)) = answer.farthest else { return lines };
    let push = format!(
        "{:.4} N along x, 10 % of the ball's weight, as a pulse of {PUSH_S} s at {PUSH_AT_S} s",
        PUSH_SHARE * Ball::default().mass_kg() * GRAVITY_M_S2
    );
    lines.push(report::row("pushed", &push));
    lines.push(report::row(
        "farthest",
        &format!("{:.1} mm from the centre, at {at:.2} s", far * 1e3),
    ));
    lines.push(report::row("back", &back(answer)));
    lines
}

fn back(answer: &Answer) -> String {
    match (answer.back, answer.beyond_s) {
        (Some(true), None) => "yes: within 2 cm of the centre by 17 s, and all the time".to_owned(),
        (Some(true), Some(t)) => {
            format!("yes: within 2 cm of the centre by 17 s, from {t:.2} s on")
        }
        (Some(false), _) => "no: beyond 2 cm of the centre after 17 s".to_owned(),
        (None, _) => "the run did not come to 17 s".to_owned(),
    }
}

fn write(folder: &Folder, course: &Course, turns: &[Turn]) -> anyhow::Result<()> {
    folder.trajectory("trajectory.csv", &course.samples)?;
    folder.session(&turns.iter().map(sample).collect::<Vec<_>>())?;
    folder.figure("position", &plots::position(course))?;
    folder.figure("path", &plots::path(course))?;
    folder.figure("control", &figure(course, turns))
}

/// What a device would have logged at this turn.
fn sample(turn: &Turn) -> Sample {
    Sample {
        seq: None,
        t_s: turn.at_s,
        cmd_qx_rad: Some(turn.command.x),
        cmd_qy_rad: Some(turn.command.y),
        x_m: Some(turn.position.x),
        y_m: Some(turn.position.y),
    }
}

/// Both errors above both outputs.
fn figure(course: &Course, turns: &[Turn]) -> Figure {
    let over = |name: &str, i: usize, of: fn(&Turn, usize) -> f64| {
        plots::line(name, i, plots::over_time(turns, |turn| (turn.at_s, of(turn, i))))
    };
    let errors = ["along x", "along y"].into_iter().enumerate();
    let errors = errors.map(|(i, name)| over(name, i, |turn, i| -turn.position[i])).collect();
    // The x servo turns qy.
    let outputs = ["along x", "along y"].into_iter().enumerate();
    let outputs = outputs.map(|(i, name)| over(name, i, |turn, i| turn.command[1 - i])).collect();
    let mut figure = plots::figure(
        format!("{}: two PID loops every 10 ms", course.name),
        "Errors (wanted minus measured position) and outputs: qy moves the ball along x, qx along y."
            .to_owned(),
        1,
        vec![
            plots::time_panel("error (m)", DURATION_S, errors),
            plots::time_panel("output: qy and qx (rad)", DURATION_S, outputs),
        ],
    );
    figure.panel_height = 560;
    figure
}
