//! The judgement of a stored recording, made again by the engine alone.

use offbd::wire::verdict::Verdict;
use offbd_core::diagnosis::FaultMemory;
use offbd_core::engine::{Engine, Input, Setup};
use offbd_core::vocabulary::FaultCode;

use super::stored::{StoredAction, StoredSession};
use crate::support::learnt;

/// What the engine says about the only session of an asset.
pub struct Replayed {
    pub hash: String,
    /// Code and status of each transition.
    pub transitions: Vec<(String, String)>,
    /// The fault memory after what was done to it once the session had ended.
    pub memory: FaultMemory,
}

/// Judges the recording of `session`, the only one of its asset, with the asset's `actions`.
pub fn replay(session: &StoredSession, actions: &[&StoredAction]) -> Replayed {
    let setup = Setup::new(learnt(&session.asset), None).unwrap();
    let (mut engine, mut verdict) =
        (Engine::new(setup, FaultMemory::default()), Verdict::default());
    let mut transitions = Vec::new();
    for input in inputs(session, actions) {
        let mut new = Vec::new();
        engine.handle(input, &mut new);
        verdict.take(engine.n_accepted(), &new);
        transitions.extend(new.iter().map(|t| (t.code.to_string(), t.status.to_string())));
    }
    let mut memory = engine.memory().clone();
    // Before the session there was no fault to change.
    for action in actions.iter().filter(|action| action.session.is_none() && !action.is_early) {
        match input(action) {
            Input::Clear(code) => memory.clear(code),
            Input::Acknowledge(code) => drop(memory.acknowledge(code)),
            _ => {}
        }
    }
    Replayed { hash: verdict.hash(), transitions, memory }
}

/// The inputs of the session: its samples and the actions after each, then its end.
fn inputs<'a>(
    session: &'a StoredSession,
    actions: &'a [&StoredAction],
) -> impl Iterator<Item = Input> + 'a {
    let n_samples = session.recording.len();
    let after = move |n: usize| {
        let is_here =
            move |a: &&&StoredAction| a.session.is_some() && a.after_index.min(n_samples) == n;
        actions.iter().filter(is_here).map(|action| input(action))
    };
    let samples = session.recording.iter().enumerate();
    let played = samples.flat_map(move |(i, sample)| after(i).chain([Input::NewSample(*sample)]));
    played.chain(after(n_samples)).chain([Input::End])
}

fn input(action: &StoredAction) -> Input {
    let code: FaultCode = action.code.parse().unwrap();
    match action.kind.as_str() {
        "clear" => Input::Clear(code),
        _ => Input::Acknowledge(code),
    }
}
