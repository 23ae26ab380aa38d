//! The output of a run: lines of text, the result first, or a JSON object.

use serde_json::{Value, json};

use super::scene_run::SceneRun;
use super::words;
use offbd_core::plant::Motion;
use offbd_lab::scene::{Event, Model, Pace, Stage, TriedCandidate};
use offbd_terminal::table;

/// Maximum number of events printed as text; chosen. JSON has all of them.
const SHOWN_EVENTS: usize = 12;

/// Returns the lines of text.
pub(super) fn lines(scene_run: &SceneRun) -> Vec<String> {
    let mut lines = vec![
        row("scene", &format!("{}, {} s", scene_run.name, scene_run.scene.duration_s)),
        end(scene_run),
        row("error", &error(scene_run)),
    ];
    lines.extend(events(scene_run));
    lines.push(String::new());
    lines.push(row("ran", &ran(scene_run)));
    lines.push(row("why", &why(scene_run)));
    lines.extend(effort(scene_run));
    lines.extend(stages(&scene_run.stages));
    lines.extend(tried(scene_run.decision.choice.as_ref().map_or(&[], |choice| &choice.tried)));
    lines
}

/// Returns the line of the result: where the body is at the end, or why the run failed.
fn end(scene_run: &SceneRun) -> String {
    match &scene_run.outcome {
        Ok(outcome) => {
            let p = outcome.end.position;
            row("end", &format!("x {:.6}, y {:.6}, z {:.6} m", p.x, p.y, p.z))
        }
        Err(failure) => row("failed", &failure.to_string()),
    }
}

/// Formats a name and its value, wrapped to 80 columns.
pub(super) fn row(word: &str, text: &str) -> String {
    table::wrapped(&format!("{word:<11}"), text)
}

/// Describes model, method and pace.
pub(super) fn ran(scene_run: &SceneRun) -> String {
    let in_one_pass = || {
        let models: Vec<&str> = scene_run.stages.iter().map(|stage| stage.model).collect();
        format!("in one pass: {}", models.join(", then "))
    };
    scene_run.decision.configuration.as_ref().map_or_else(in_one_pass, words::configuration)
}

fn why(scene_run: &SceneRun) -> String {
    let decision = &scene_run.decision;
    let wanted = decision.wanted_m.unwrap_or_default();
    let Some(by) = &decision.configuration else {
        return format!(
            "the cheapest models that keep {} m as the scene goes",
            words::plain(wanted)
        );
    };
    let Some(choice) = &decision.choice else {
        return match by.pace() {
            Pace::Tolerance(tolerance) if tolerance < wanted => {
                format!(
                    "asked for; the smaller tolerance is to keep {} m where the body lands or leaves",
                    words::plain(wanted)
                )
            }
            _ => "asked for".to_owned(),
        };
    };
    if choice.configuration == *by {
        return format!("the cheapest that meets {} m", words::plain(wanted));
    }
    let model = choice.configuration.model();
    if model == by.model() {
        format!("the {model} model meets {} m; the rest was asked for", words::plain(wanted))
    } else {
        format!("the {model} model would do, but what was asked for does not step it")
    }
}

fn error(scene_run: &SceneRun) -> String {
    if let Some(error_m) = estimated_error_m(scene_run) {
        return format!("about {}, estimated", words::metres(error_m));
    }
    let by = scene_run.decision.configuration;
    let model = match by.map(|by| by.model()) {
        Some(Model::Planar | Model::Rolling) => Some(scene_run.survey.rolling_error_m),
        Some(Model::Creeping) => Some(scene_run.survey.creeping_error_m),
        _ => None,
    };
    let method = match (by.map(|by| by.pace()), &scene_run.outcome) {
        (Some(Pace::Tolerance(_)), Ok(outcome)) => {
            format!("the method's about {}", words::metres(outcome.statistics.method_error_m))
        }
        _ => "the method's not estimated at fixed steps".to_owned(),
    };
    match model {
        Some(model) => format!("the model's about {}, {method}", words::metres(model)),
        None => method,
    }
}

/// Returns the estimated error of model and method together, m, where there is one.
fn estimated_error_m(scene_run: &SceneRun) -> Option<f64> {
    let decision = &scene_run.decision;
    match (&decision.configuration, &decision.choice, &scene_run.outcome) {
        (None, _, Ok(outcome)) => Some(outcome.statistics.method_error_m),
        (Some(by), Some(choice), _) if choice.configuration == *by => Some(choice.error_m),
        _ => None,
    }
}

/// Returns the models of a run in one pass as a table.
fn stages(stages: &[Stage]) -> Vec<String> {
    if stages.is_empty() {
        return Vec::new();
    }
    let mut rows = table::table(&["from s", "model", "by", "because"], &[0]);
    for stage in stages {
        let from = format!("{:.4}", stage.from_s);
        rows.add_row([&from, stage.model, stage.method, stage.why]);
    }
    std::iter::once(String::new()).chain(table::lines(&rows)).collect()
}

fn effort(scene_run: &SceneRun) -> Vec<String> {
    let Ok(outcome) = &scene_run.outcome else { return Vec::new() };
    let rejected = match outcome.statistics.rejected {
        0 => String::new(),
        n => format!(" and {n} rejected"),
    };
    let divided = match outcome.statistics.divided {
        0 => String::new(),
        n => format!("; {n} divided, where the contact changes"),
    };
    let choosing = match scene_run.decision.choosing_s {
        0.0 => String::new(),
        s => format!(", {} to choose", words::work(s)),
    };
    vec![
        row("steps", &format!("{}{rejected}{divided}", outcome.statistics.steps)),
        row("CPU time", &format!("{} to run{choosing}", words::work(scene_run.running_s))),
    ]
}

/// Returns the candidates in the order in which they were tried, as a table.
pub(super) fn tried(tried: &[TriedCandidate]) -> Vec<String> {
    if tried.is_empty() {
        return Vec::new();
    }
    let mut rows = table::table(&["tried", "by", "error", "verdict"], &[2]);
    for one in tried {
        let error = one.error_m.map(words::metres).unwrap_or_default();
        rows.add_row([one.model.name(), one.method.name(), &error, &one.verdict]);
    }
    std::iter::once(String::new()).chain(table::lines(&rows)).collect()
}

fn events(scene_run: &SceneRun) -> Vec<String> {
    if scene_run.events.is_empty() {
        return Vec::new();
    }
    let body = if scene_run.scene.body().turns() { "ball" } else { "block" };
    let mut lines = vec![String::new(), format!("what happens, by the sliding model: the {body}")];
    for event in scene_run.events.iter().take(SHOWN_EVENTS) {
        lines.push(format!("{:>10.4} s  {}", event.at_s, words::event(event, &scene_run.scene)));
    }
    if scene_run.events.len() > SHOWN_EVENTS {
        lines.push(format!("             and {} more", scene_run.events.len() - SHOWN_EVENTS));
    }
    lines
}

/// Returns the JSON object.
pub(super) fn object(scene_run: &SceneRun) -> Value {
    let SceneRun { decision, outcome, .. } = scene_run;
    let (step_s, tolerance_m) = match decision.configuration.map(|by| by.pace()) {
        Some(Pace::Step(step)) => (Some(step), None),
        Some(Pace::Tolerance(tolerance)) => (None, Some(tolerance)),
        None => (None, None),
    };
    let last = scene_run.stages.last();
    let by = decision.configuration.as_ref();
    let choice = decision.choice.as_ref();
    let statistics = outcome.as_ref().ok().map(|outcome| outcome.statistics);
    json!({
        "scene": scene_run.name,
        "duration_s": scene_run.scene.duration_s,
        "model": by.map(|by| by.model().name()).or(last.map(|stage| stage.model)),
        "method": by.map(|by| by.method().name()).or(last.map(|stage| stage.method)),
        "stages": scene_run.stages.iter().map(stage_object).collect::<Vec<_>>(),
        "step_s": step_s,
        "tolerance_m": tolerance_m,
        "why": why(scene_run),
        "wanted_m": decision.wanted_m,
        "error_m": estimated_error_m(scene_run),
        "friction_demand": scene_run.survey.demand,
        "tried": choice.map(|c| c.tried.iter().map(tried_object).collect::<Vec<_>>()),
        "steps": statistics.map(|t| t.steps),
        "rejected": statistics.map(|t| t.rejected),
        "divided": statistics.map(|t| t.divided),
        "cpu_s": scene_run.running_s,
        "choosing_cpu_s": decision.choosing_s,
        "end": outcome.as_ref().ok().map(|o| motion_object(&o.end)),
        "events": scene_run.events.iter().map(|e| event_object(e, scene_run)).collect::<Vec<_>>(),
        "warnings": scene_run.warnings,
        "failure": outcome.as_ref().err().map(ToString::to_string),
    })
}

fn stage_object(stage: &Stage) -> Value {
    let Stage { from_s, model, method, why } = stage;
    json!({ "from_s": from_s, "model": model, "method": method, "why": why })
}

fn tried_object(tried: &TriedCandidate) -> Value {
    json!({
        "model": tried.model.name(),
        "method": tried.method.name(),
        "error_m": tried.error_m,
        "verdict": tried.verdict,
    })
}

fn event_object(event: &Event, scene_run: &SceneRun) -> Value {
    json!({ "t_s": event.at_s, "what": words::event(event, &scene_run.scene) })
}

fn motion_object(at: &Motion) -> Value {
    let row = |v: &nalgebra::Vector3<f64>| [v.x, v.y, v.z];
    json!({
        "position_m": row(&at.position),
        "velocity_m_s": row(&at.velocity),
        "spin_rad_s": row(&at.spin),
    })
}
