//! Lets visitors control the demo's rig through its page: inject a fault, repair it, resume
//! the script, or tune the rig's controller. Only the demo mounts these routes, in addition to the
//! interface.

use std::sync::{Arc, Mutex, PoisonError};

use axum::Json;
use axum::body::Bytes;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use serde::{Deserialize, Serialize};
use tokio::sync::mpsc;
use utoipa::ToSchema;
use utoipa_axum::routes;

use offbd_http::{ExtraRoutes, Problem, parse_json};
use offbd_lab::simulation::{Fault, FaultEffect, PidGains};
use offbd_service::access::Right;
use offbd_wire::problem::{BUSY, INVALID};

/// Capacity of the queue of commands; chosen. Further commands are refused.
const MAX_WAITING: usize = 16;

/// The faults on the buttons, as on the command line: one of each kind that the diagnosis
/// distinguishes.
const BUTTONS: [&str; 13] = [
    "x_servo:dead",
    "x_servo:hold",
    "x_servo:reversed",
    "x_servo:offset",
    "x_servo:slow",
    "y_servo:dead",
    "y_servo:hold",
    "y_servo:gain",
    "stuck_ball:glued",
    "sensor:freeze",
    "sensor:dropout",
    "sensor:noise",
    "sensor:jump",
];

/// A command of a visitor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum VisitorCommand {
    /// Inject a fault.
    Break(FaultEffect),
    /// Repair all faults.
    Repair,
    /// Resume the script.
    Script,
}

/// The state of the demo, for its page.
#[derive(Clone, Debug, Default, Serialize, ToSchema)]
pub(super) struct DemoStatus {
    /// The simulated rig.
    pub asset: String,
    /// Whether the script injects and repairs faults.
    pub script: bool,
    /// The active faults, as `x_servo:dead`.
    pub broken: Vec<String>,
    /// The faults on the buttons.
    pub buttons: Vec<String>,
}

/// The gains of the controller of the demo's rig, the same for both axes.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct DemoGains {
    /// Commanded angle per distance to the reference, rad/m.
    #[schema(minimum = 0, maximum = 10)]
    pub kp: f64,
    /// Commanded angle per distance and time, rad/(m·s).
    #[schema(minimum = 0, maximum = 4)]
    pub ki: f64,
    /// Commanded angle per velocity of the ball, rad·s/m: the damping.
    #[schema(minimum = 0, maximum = 7)]
    pub kd: f64,
}

/// How the controller of the demo's rig is tuned.
#[derive(Clone, Copy, Debug, Serialize, ToSchema)]
pub(super) struct DemoTuning {
    /// The gains in use.
    pub gains: DemoGains,
    /// The gains with which the demo began.
    pub initial: DemoGains,
}

impl From<DemoGains> for PidGains {
    fn from(gains: DemoGains) -> Self {
        Self { proportional: gains.kp, integral: gains.ki, derivative: gains.kd }
    }
}

impl From<PidGains> for DemoGains {
    fn from(gains: PidGains) -> Self {
        Self { kp: gains.proportional, ki: gains.integral, kd: gains.derivative }
    }
}

/// The receiving end of the controls, for the show.
pub(super) struct VisitorControls {
    commands: mpsc::Receiver<VisitorCommand>,
    status: Arc<Mutex<DemoStatus>>,
    gains: Arc<Mutex<PidGains>>,
}

/// The sending end of the controls, for the routes of the page.
#[derive(Clone)]
struct PageControls {
    commands: mpsc::Sender<VisitorCommand>,
    status: Arc<Mutex<DemoStatus>>,
    gains: Arc<Mutex<PidGains>>,
    initial: PidGains,
}

/// Creates the controls for the show, whose controller begins with `gains`, and the routes of
/// the page.
pub(super) fn visitor_controls(asset: &str, gains: PidGains) -> (VisitorControls, ExtraRoutes) {
    let (sender, commands) = mpsc::channel(MAX_WAITING);
    let buttons = BUTTONS.map(str::to_owned).to_vec();
    let asset = asset.to_owned();
    let status = DemoStatus { asset, script: true, broken: Vec::new(), buttons };
    let status = Arc::new(Mutex::new(status));
    let (initial, gains) = (gains, Arc::new(Mutex::new(gains)));
    let controls =
        PageControls { commands: sender, status: status.clone(), gains: gains.clone(), initial };
    let routes = ExtraRoutes::default()
        .routes(Right::Read, routes!(look), controls.clone())
        .routes(Right::Operate, routes!(break_it, repair), controls.clone())
        .routes(Right::Operate, routes!(script), controls.clone())
        .routes(Right::Read, routes!(look_at_gains), controls.clone())
        .routes(Right::Operate, routes!(tune), controls);
    (VisitorControls { commands, status, gains }, routes)
}

impl VisitorControls {
    /// Waits for the next command. Cancel safe.
    pub(super) async fn next(&mut self) -> VisitorCommand {
        match self.commands.recv().await {
            Some(command) => command,
            None => std::future::pending().await,
        }
    }

    /// Updates the state that the page shows.
    pub(super) fn show(&self, script: bool, broken: Vec<String>) {
        let mut status = self.status.lock().unwrap_or_else(PoisonError::into_inner);
        (status.script, status.broken) = (script, broken);
    }

    /// Returns the gains that the rig's controller is to have, all within their ranges.
    pub(super) fn gains(&self) -> PidGains {
        *self.gains.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Returns the state of the demo's rig: whether the script controls it, and its faults.
#[utoipa::path(get, path = "/api/v1/demo", tag = "demo", operation_id = "get_demo",
    responses((status = 200, body = DemoStatus)))]
async fn look(State(controls): State<PageControls>) -> Json<DemoStatus> {
    Json(controls.status.lock().unwrap_or_else(PoisonError::into_inner).clone())
}

/// A fault to inject.
#[derive(Default, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct FaultRequest {
    /// CODE:KIND[=SIZE], as on the command line.
    fault: String,
}

/// Injects a fault into the demo's rig, and suspends the script.
#[utoipa::path(post, path = "/api/v1/demo/faults", tag = "demo",
    operation_id = "inject_demo_fault", request_body = FaultRequest,
    responses((status = 202), (status = 422, body = Problem, description = "No such fault")))]
async fn break_it(
    State(controls): State<PageControls>,
    headers: HeaderMap,
    body: Bytes,
) -> Result<StatusCode, Problem> {
    let request: FaultRequest = parse_json(&headers, &body)?;
    // The syntax requires a time, which is ignored: the fault begins now.
    let fault: Fault = format!("{}@0", request.fault).parse().map_err(|error| {
        let error: offbd_lab::simulation::FaultSyntax = error;
        Problem::new(INVALID, error.to_string())
    })?;
    controls.send(VisitorCommand::Break(fault.effect))
}

/// Repairs the demo's rig.
#[utoipa::path(delete, path = "/api/v1/demo/faults", tag = "demo",
    operation_id = "repair_demo", responses((status = 202)))]
async fn repair(State(controls): State<PageControls>) -> Result<StatusCode, Problem> {
    controls.send(VisitorCommand::Repair)
}

/// Lets the script inject and repair faults again.
#[utoipa::path(post, path = "/api/v1/demo/script", tag = "demo",
    operation_id = "resume_demo_script", responses((status = 202)))]
async fn script(State(controls): State<PageControls>) -> Result<StatusCode, Problem> {
    controls.send(VisitorCommand::Script)
}

/// Returns the gains of the controller of the demo's rig.
#[utoipa::path(get, path = "/api/v1/demo/gains", tag = "demo", operation_id = "get_demo_gains",
    responses((status = 200, body = DemoTuning)))]
async fn look_at_gains(State(controls): State<PageControls>) -> Json<DemoTuning> {
    Json(controls.tuning())
}

/// Tunes the controller of the demo's rig, which uses the gains at once. Neither the script
/// nor a fault ends.
#[utoipa::path(put, path = "/api/v1/demo/gains", tag = "demo", operation_id = "tune_demo",
    request_body = DemoGains,
    responses((status = 200, body = DemoTuning), (status = 422, body = Problem,
        description = "A gain is out of range; `pointer` names it")))]
async fn tune(
    State(controls): State<PageControls>,
    headers: HeaderMap,
    body: Bytes,
) -> Result<Json<DemoTuning>, Problem> {
    let wanted: DemoGains = parse_json(&headers, &body)?;
    PidGains::from(wanted).check()?;
    *controls.gains.lock().unwrap_or_else(PoisonError::into_inner) = wanted.into();
    Ok(Json(controls.tuning()))
}

impl PageControls {
    fn tuning(&self) -> DemoTuning {
        let gains = *self.gains.lock().unwrap_or_else(PoisonError::into_inner);
        DemoTuning { gains: gains.into(), initial: self.initial.into() }
    }

    fn send(&self, command: VisitorCommand) -> Result<StatusCode, Problem> {
        let full = |_| {
            let detail = "the demo has not executed the previous commands yet";
            Problem::new(BUSY, detail)
        };
        self.commands.try_send(command).map(|()| StatusCode::ACCEPTED).map_err(full)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_button_is_a_fault() {
        for button in BUTTONS {
            let fault: Fault = format!("{button}@0").parse().unwrap();
            let words = format!("{}:{}", fault.effect.code(), fault.effect.kind());
            assert_eq!(words, button);
        }
    }

    /// The page asks for no gain beyond the ranges that the description states.
    #[test]
    fn the_described_ranges_of_the_gains_are_those_that_are_checked() {
        let schema = serde_json::to_value(<DemoGains as utoipa::PartialSchema>::schema()).unwrap();
        let ranges = [
            ("kp", PidGains::PROPORTIONAL),
            ("ki", PidGains::INTEGRAL),
            ("kd", PidGains::DERIVATIVE),
        ];
        for (name, range) in ranges {
            let described = &schema["properties"][name];
            assert_eq!(described["minimum"].as_f64(), Some(*range.start()), "{name}: {schema}");
            assert_eq!(described["maximum"].as_f64(), Some(*range.end()), "{name}: {schema}");
        }
    }
}
