//! Application 1: the plate in closed loop.

use nalgebra::Vector2;
use serde_json::{Value, json};

use super::SceneArgs;
use super::files::OutputFolder;
use super::scene_run::{RunRequest, Sampled, SceneRun};
use super::{laws, plots, report};
use offbd_core::plant::{Ball, Contact, GRAVITY_M_S2, Plate};
use offbd_core::vocabulary::{Invalid, Sample};
use offbd_lab::chart::Figure;
use offbd_lab::scene::{ControlLoop, ControlStep, ControlledPlate, Push, Scene, Subject};
use offbd_terminal::output::{self, OutputFormat};

/// Duration of the scene, s; chosen.
const DURATION_S: f64 = 30.0;

/// Start of the ball, m; chosen: off the centre along both axes.
const START_M: [f64; 2] = [0.08, -0.05];

/// Force of the chapter's impulse along x as a share of the ball's weight.
const PUSH_SHARE: f64 = 0.1;
/// Time of the chapter's impulse, s.
const PUSH_AT_S: f64 = 10.0;
/// Duration of the impulse, s. Chosen, because an ideal impulse has no force.
const PUSH_S: f64 = 0.1;

/// Distance from the centre that the exercise requires, m.
const NEAR_M: f64 = 0.02;
/// Time by which it requires it, s.
const BACK_BY_S: f64 = 17.0;

pub(super) fn run(args: &SceneArgs, impulse: bool) -> anyhow::Result<()> {
    let ball = Ball::default();
    let scene = scene(ball)?;
    let pushes = if impulse { vec![push(&ball)] } else { Vec::new() };
    let mut drive = ControlledPlate::new(ControlLoop::chapter(&ball), pushes);
    let name = if impulse { "pid-impulse" } else { "pid" };
    let plan = RunRequest { how: &args.how, sample: args.sample, sampled: true };
    let scene_run = plan.run(name, &scene, &mut drive).inspect_err(laws::print_tried)?;
    let answer = ControlResult::of(&scene_run.samples, impulse);
    if let Some(folder) = OutputFolder::new(args.output.as_deref())? {
        write(&folder, &scene_run, drive.control_steps())?;
    }
    laws::warn(&scene_run);
    match args.format {
        OutputFormat::Table => output::print_line(&lines(&scene_run, &answer).join("\n"))?,
        OutputFormat::Json => {
            let mut object = report::object(&scene_run);
            object["control"] = answer.object();
            output::print_line(&object.to_string())?;
        }
    }
    laws::failed(std::slice::from_ref(&scene_run))
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

/// The performance of the control loop.
struct ControlResult {
    /// Time from which on the ball stayed within 2 cm, before any push, s.
    settled_s: Option<f64>,
    /// Largest distance after the push, m, and its time, s.
    farthest: Option<(f64, f64)>,
    /// Last time beyond 2 cm after the push, s; `None`: never beyond.
    beyond_s: Option<f64>,
    /// Whether the ball stayed within 2 cm from 17 s to the end; `None` without a push, or
    /// if the run ended before.
    back: Option<bool>,
}

impl ControlResult {
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

fn lines(scene_run: &SceneRun, answer: &ControlResult) -> Vec<String> {
    let mut lines = report::lines(scene_run);
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

fn back(answer: &ControlResult) -> String {
    match (answer.back, answer.beyond_s) {
        (Some(true), None) => "yes: within 2 cm of the centre by 17 s, and all the time".to_owned(),
        (Some(true), Some(t)) => {
            format!("yes: within 2 cm of the centre by 17 s, from {t:.2} s on")
        }
        (Some(false), _) => "no: beyond 2 cm of the centre after 17 s".to_owned(),
        (None, _) => "the run ended before 17 s".to_owned(),
    }
}

fn write(folder: &OutputFolder, scene_run: &SceneRun, steps: &[ControlStep]) -> anyhow::Result<()> {
    folder.trajectory("trajectory.csv", &scene_run.samples)?;
    folder.session(&steps.iter().map(sample).collect::<Vec<_>>())?;
    folder.figure("position", &plots::position(scene_run))?;
    folder.figure("path", &plots::path(scene_run))?;
    folder.figure("control", &figure(scene_run, steps))
}

/// Returns the row that a device would have logged at this sampling instant.
fn sample(step: &ControlStep) -> Sample {
    Sample {
        seq: None,
        t_s: step.at_s,
        cmd_qx_rad: Some(step.command.x),
        cmd_qy_rad: Some(step.command.y),
        x_m: Some(step.position.x),
        y_m: Some(step.position.y),
    }
}

/// Draws both errors above both outputs.
fn figure(scene_run: &SceneRun, steps: &[ControlStep]) -> Figure {
    let over = |name: &str, i: usize, of: fn(&ControlStep, usize) -> f64| {
        plots::line(name, i, steps.iter().map(|step| (step.at_s, of(step, i))).collect())
    };
    let errors = ["along x", "along y"].into_iter().enumerate();
    let errors = errors.map(|(i, name)| over(name, i, |step, i| -step.position[i])).collect();
    // The x servo turns qy.
    let outputs = ["along x", "along y"].into_iter().enumerate();
    let outputs = outputs.map(|(i, name)| over(name, i, |step, i| step.command[1 - i])).collect();
    let mut figure = plots::figure(
        format!("{}: two PID loops every 10 ms", scene_run.name),
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
