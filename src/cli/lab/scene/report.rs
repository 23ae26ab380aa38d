//! What is printed of a course: lines for people, or an object for programs.

use serde_json::{Value, json};

use super::course::Course;
use super::words;
use crate::cli::table;
use offbd_core::plant::Motion;
use offbd_lab::scene::{Event, Model, Pace, Tried};

/// Events that are printed; there are more in JSON.
const SHOWN_EVENTS: usize = 12;

/// Lines for people.
pub(super) fn lines(course: &Course) -> Vec<String> {
    let mut lines = vec![
        row("scene", &format!("{}, {} s", course.name, course.scene.duration_s)),
        row("ran", &words::configuration(&course.decision.configuration)),
        row("why", &why(course)),
        row("error", &error(course)),
    ];
    lines.extend(effort(course));
    lines.extend(tried(course.decision.choice.as_ref().map_or(&[], |choice| &choice.tried)));
    lines.extend(events(course));
    lines
}

/// A word and what it stands for, within 80 columns.
pub(super) fn row(word: &str, text: &str) -> String {
    table::wrapped(&format!("{word:<11}"), text)
}

fn why(course: &Course) -> String {
    let decision = &course.decision;
    let (Some(wanted), Some(choice)) = (decision.wanted_m, &decision.choice) else {
        return "asked for".to_owned();
    };
    if choice.configuration == decision.configuration {
        return format!("the cheapest that meets {} m", words::plain(wanted));
    }
    let model = choice.configuration.model();
    if model == decision.configuration.model() {
        format!("the {model} model meets {} m; the rest was asked for", words::plain(wanted))
    } else {
        format!("the {model} model would do, but what was asked for does not step it")
    }
}

fn error(course: &Course) -> String {
    let decision = &course.decision;
    if let Some(choice) =
        decision.choice.as_ref().filter(|c| c.configuration == decision.configuration)
    {
        return format!("about {}, estimated", words::metres(choice.error_m));
    }
    let model = match decision.configuration.model() {
        Model::Planar | Model::Rolling => Some(course.survey.rolling_error_m),
        Model::Creeping => Some(course.survey.creeping_error_m),
        Model::Sliding | Model::Compliant => None,
    };
    let method = match (decision.configuration.pace(), &course.outcome) {
        (Pace::Tolerance(_), Ok(outcome)) => {
            format!("the method's about {}", words::metres(outcome.tally.method_error_m))
        }
        _ => "the method's not estimated at fixed steps".to_owned(),
    };
    match model {
        Some(model) => format!("the model's about {}, {method}", words::metres(model)),
        None => method,
    }
}

fn effort(course: &Course) -> Vec<String> {
    let Ok(outcome) = &course.outcome else {
        let failure = course.outcome.as_ref().err().map(ToString::to_string).unwrap_or_default();
        return vec![row("failed", &failure)];
    };
    let rejected = match outcome.tally.rejected {
        0 => String::new(),
        n => format!(" and {n} tried in vain"),
    };
    let choosing = match course.decision.choosing_s {
        0.0 => String::new(),
        s => format!(", {} to choose", words::work(s)),
    };
    let p = outcome.end.position;
    vec![
        row("steps", &format!("{}{rejected}", outcome.tally.steps)),
        row("CPU time", &format!("{} to run{choosing}", words::work(course.running_s))),
        row("end", &format!("x {:.6}, y {:.6}, z {:.6} m", p.x, p.y, p.z)),
    ]
}

/// What was tried, in its order, as a table.
pub(super) fn tried(tried: &[Tried]) -> Vec<String> {
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

fn events(course: &Course) -> Vec<String> {
    if course.events.is_empty() {
        return Vec::new();
    }
    let body = if course.scene.body().turns() { "ball" } else { "block" };
    let mut lines = vec![String::new(), format!("what happens, by the sliding model: the {body}")];
    for event in course.events.iter().take(SHOWN_EVENTS) {
        lines.push(format!("{:>10.4} s  {}", event.at_s, words::event(event, &course.scene)));
    }
    if course.events.len() > SHOWN_EVENTS {
        lines.push(format!("             and {} more", course.events.len() - SHOWN_EVENTS));
    }
    lines
}

/// An object for programs.
pub(super) fn object(course: &Course) -> Value {
    let Course { decision, outcome, .. } = course;
    let (step_s, tolerance_m) = match decision.configuration.pace() {
        Pace::Step(step) => (Some(step), None),
        Pace::Tolerance(tolerance) => (None, Some(tolerance)),
    };
    let choice = decision.choice.as_ref();
    let tally = outcome.as_ref().ok().map(|outcome| outcome.tally);
    json!({
        "scene": course.name,
        "duration_s": course.scene.duration_s,
        "model": decision.configuration.model().name(),
        "method": decision.configuration.method().name(),
        "step_s": step_s,
        "tolerance_m": tolerance_m,
        "why": why(course),
        "wanted_m": decision.wanted_m,
        "error_m": choice.filter(|c| c.configuration == decision.configuration).map(|c| c.error_m),
        "friction_demand": course.survey.demand,
        "tried": choice.map(|c| c.tried.iter().map(tried_object).collect::<Vec<_>>()),
        "steps": tally.map(|t| t.steps),
        "rejected": tally.map(|t| t.rejected),
        "cpu_s": course.running_s,
        "choosing_cpu_s": decision.choosing_s,
        "end": outcome.as_ref().ok().map(|o| motion_object(&o.end)),
        "events": course.events.iter().map(|e| event_object(e, course)).collect::<Vec<_>>(),
        "warnings": course.warnings,
        "failure": outcome.as_ref().err().map(ToString::to_string),
    })
}

fn tried_object(tried: &Tried) -> Value {
    json!({
        "model": tried.model.name(),
        "method": tried.method.name(),
        "error_m": tried.error_m,
        "verdict": tried.verdict,
    })
}

fn event_object(event: &Event, course: &Course) -> Value {
    json!({ "t_s": event.at_s, "what": words::event(event, &course.scene) })
}

fn motion_object(at: &Motion) -> Value {
    let row = |v: &nalgebra::Vector3<f64>| [v.x, v.y, v.z];
    json!({
        "position_m": row(&at.position),
        "velocity_m_s": row(&at.velocity),
        "spin_rad_s": row(&at.spin),
    })
}
