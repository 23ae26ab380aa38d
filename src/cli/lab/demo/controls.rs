//! Lets visitors control the demo's rig through buttons on its page: inject a fault,
//! repair it, or resume the script. Only the demo mounts these routes, in addition to the
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

use crate::http::{ExtraRoutes, Problem, parse_json};
use crate::service::access::Right;
use offbd_lab::simulation::{Fault, FaultEffect};

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

/// The receiving end of the controls, for the show.
pub(super) struct VisitorControls {
    commands: mpsc::Receiver<VisitorCommand>,
    status: Arc<Mutex<DemoStatus>>,
}

/// The sending end of the controls, for the routes of the page.
#[derive(Clone)]
struct PageControls {
    commands: mpsc::Sender<VisitorCommand>,
    status: Arc<Mutex<DemoStatus>>,
}

/// Creates the controls for the show, and the routes of the page.
pub(super) fn visitor_controls(asset: &str) -> (VisitorControls, ExtraRoutes) {
    let (sender, commands) = mpsc::channel(MAX_WAITING);
    let buttons = BUTTONS.map(str::to_owned).to_vec();
    let asset = asset.to_owned();
    let status = DemoStatus { asset, script: true, broken: Vec::new(), buttons };
    let status = Arc::new(Mutex::new(status));
    let controls = PageControls { commands: sender, status: status.clone() };
    let routes = ExtraRoutes::default()
        .routes(Right::Read, routes!(look), controls.clone())
        .routes(Right::Operate, routes!(break_it, repair), controls.clone())
        .routes(Right::Operate, routes!(script), controls);
    (VisitorControls { commands, status }, routes)
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
        let (status, title) = (StatusCode::UNPROCESSABLE_ENTITY, "No such fault");
        let error: offbd_lab::simulation::FaultSyntax = error;
        Problem::new(status, "invalid", title, error.to_string())
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

impl PageControls {
    fn send(&self, command: VisitorCommand) -> Result<StatusCode, Problem> {
        let full = |_| {
            let detail = "the demo has not executed the previous commands yet";
            Problem::new(StatusCode::TOO_MANY_REQUESTS, "busy", "Too many requests", detail)
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
}
