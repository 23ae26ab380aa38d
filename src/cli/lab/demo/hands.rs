//! What a visitor does to the demo's rig, through buttons on the page: breaks
//! it, repairs it, hands it back to the script. Mounted by the demo alone,
//! beside the interface.

use std::sync::{Arc, Mutex, PoisonError};

use axum::Json;
use axum::extract::State;
use axum::http::{Method, StatusCode};
use axum::routing::{delete, get, post};
use serde::{Deserialize, Serialize};
use tokio::sync::mpsc;

use crate::http::{More, Problem};
use crate::service::access::Right;
use offbd_lab::simulation::{Fault, FaultEffect};

/// Acts that wait for the show; the next is told to come again.
const MAX_WAITING: usize = 16;

/// Faults on buttons, as on the command line: one of each kind that the
/// diagnosis tells apart.
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

/// Something a visitor does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Act {
    Break(FaultEffect),
    Repair,
    /// The script goes on.
    Script,
}

/// The rig as the page shows it.
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct Shown {
    pub asset: String,
    /// Whether faults come and go by themselves.
    pub script: bool,
    /// What is broken now, as `x_servo:dead`.
    pub broken: Vec<String>,
    pub buttons: Vec<String>,
}

/// The show's side.
pub(super) struct Hands {
    acts: mpsc::Receiver<Act>,
    shown: Arc<Mutex<Shown>>,
}

/// The page's side.
#[derive(Clone)]
struct Desk {
    acts: mpsc::Sender<Act>,
    shown: Arc<Mutex<Shown>>,
}

/// Hands for the show, and the routes by which they are moved.
pub(super) fn hands(asset: &str) -> (Hands, More) {
    let (sender, acts) = mpsc::channel(MAX_WAITING);
    let buttons = BUTTONS.map(str::to_owned).to_vec();
    let asset = asset.to_owned();
    let shown = Shown { asset, script: true, broken: Vec::new(), buttons };
    let shown = Arc::new(Mutex::new(shown));
    let desk = Desk { acts: sender, shown: shown.clone() };
    let (look, break_it) = (get(look).with_state(desk.clone()), post(break_it));
    let (break_it, repair) = (break_it.with_state(desk.clone()), delete(repair));
    let (repair, script) = (repair.with_state(desk.clone()), post(script).with_state(desk));
    let routes = More::default()
        .route("/api/v1/demo", Method::GET, Right::Read, look)
        .route("/api/v1/demo/faults", Method::POST, Right::Operate, break_it)
        .route("/api/v1/demo/faults", Method::DELETE, Right::Operate, repair)
        .route("/api/v1/demo/script", Method::POST, Right::Operate, script);
    (Hands { acts, shown }, routes)
}

impl Hands {
    /// The next act. Safe to cancel.
    pub(super) async fn next(&mut self) -> Act {
        match self.acts.recv().await {
            Some(act) => act,
            None => std::future::pending().await,
        }
    }

    /// Tells the page how the rig is.
    pub(super) fn show(&self, script: bool, broken: Vec<String>) {
        let mut shown = self.shown.lock().unwrap_or_else(PoisonError::into_inner);
        (shown.script, shown.broken) = (script, broken);
    }
}

async fn look(State(desk): State<Desk>) -> Json<Shown> {
    Json(desk.shown.lock().unwrap_or_else(PoisonError::into_inner).clone())
}

#[derive(Deserialize)]
struct Wish {
    /// CODE:KIND[=SIZE], as on the command line.
    fault: String,
}

async fn break_it(State(desk): State<Desk>, Json(wish): Json<Wish>) -> Result<StatusCode, Problem> {
    // On the command line a fault has a time, too; here it is now.
    let fault: Fault = format!("{}@0", wish.fault).parse().map_err(|error| {
        let (status, title) = (StatusCode::UNPROCESSABLE_ENTITY, "No such fault");
        let error: offbd_lab::simulation::FaultSyntax = error;
        Problem::new(status, "invalid", title, error.to_string())
    })?;
    desk.act(Act::Break(fault.effect))
}

async fn repair(State(desk): State<Desk>) -> Result<StatusCode, Problem> {
    desk.act(Act::Repair)
}

async fn script(State(desk): State<Desk>) -> Result<StatusCode, Problem> {
    desk.act(Act::Script)
}

impl Desk {
    fn act(&self, act: Act) -> Result<StatusCode, Problem> {
        let full = |_| {
            let detail = "the demo has not done yet what was asked before";
            Problem::new(StatusCode::TOO_MANY_REQUESTS, "busy", "Too much at once", detail)
        };
        self.acts.try_send(act).map(|()| StatusCode::ACCEPTED).map_err(full)
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
