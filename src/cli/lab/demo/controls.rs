//! Lets visitors control the demo's rig through buttons on its page: inject a fault,
//! repair it, or resume the script. Only the demo mounts these routes, in addition to the
//! interface.

use std::sync::{Arc, Mutex, PoisonError};

use axum::Json;
use axum::extract::State;
use axum::http::{Method, StatusCode};
use axum::routing::{delete, get, post};
use serde::{Deserialize, Serialize};
use tokio::sync::mpsc;

use crate::http::{ExtraRoutes, Problem};
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
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct DemoStatus {
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
    let (look, break_it) = (get(look).with_state(controls.clone()), post(break_it));
    let (break_it, repair) = (break_it.with_state(controls.clone()), delete(repair));
    let (repair, script) = (repair.with_state(controls.clone()), post(script).with_state(controls));
    let routes = ExtraRoutes::default()
        .route("/api/v1/demo", Method::GET, Right::Read, look)
        .route("/api/v1/demo/faults", Method::POST, Right::Operate, break_it)
        .route("/api/v1/demo/faults", Method::DELETE, Right::Operate, repair)
        .route("/api/v1/demo/script", Method::POST, Right::Operate, script);
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

async fn look(State(controls): State<PageControls>) -> Json<DemoStatus> {
    Json(controls.status.lock().unwrap_or_else(PoisonError::into_inner).clone())
}

#[derive(Deserialize)]
struct FaultRequest {
    /// CODE:KIND[=SIZE], as on the command line.
    fault: String,
}

async fn break_it(
    State(controls): State<PageControls>,
    Json(request): Json<FaultRequest>,
) -> Result<StatusCode, Problem> {
    // The syntax requires a time, which is ignored: the fault begins now.
    let fault: Fault = format!("{}@0", request.fault).parse().map_err(|error| {
        let (status, title) = (StatusCode::UNPROCESSABLE_ENTITY, "No such fault");
        let error: offbd_lab::simulation::FaultSyntax = error;
        Problem::new(status, "invalid", title, error.to_string())
    })?;
    controls.send(VisitorCommand::Break(fault.effect))
}

async fn repair(State(controls): State<PageControls>) -> Result<StatusCode, Problem> {
    controls.send(VisitorCommand::Repair)
}

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
