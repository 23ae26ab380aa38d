//! Plays a recorded session: its samples and actions, in their original order.

use std::ops::ControlFlow;

use super::ServiceError;
use super::writing::Handles;
use offbd_core::engine::Input;
use offbd_core::vocabulary::FaultCode;
use offbd_store::{ActionKind, ActionRow, RecordingReader, SessionRow};

/// Passes the inputs of `session` from its sample `first` on to `take`, in their original
/// order, until it breaks at a sample. Blocks on the store, so it must not run on a thread
/// of the runtime.
pub(super) fn play(
    handles: &Handles,
    session: &SessionRow,
    first: i64,
    take: impl FnMut(Input) -> ControlFlow<()>,
) -> Result<(), ServiceError> {
    let rows = handles.wait(handles.store.actions(&session.id))?;
    play_inputs(handles, rows, handles.store.recording(session, first), first, take)
}

/// As [`play`], with the actions of the session and its recording from its sample `first` on.
pub(super) fn play_inputs(
    handles: &Handles,
    rows: Vec<ActionRow>,
    mut recording: RecordingReader,
    first: i64,
    mut take: impl FnMut(Input) -> ControlFlow<()>,
) -> Result<(), ServiceError> {
    let mut actions = Vec::new();
    for row in rows {
        let kind: ActionKind = row.kind.parse()?;
        let code: FaultCode = row.code.parse().map_err(ServiceError::corrupt)?;
        actions.push((row.after_index, input(kind, code)));
    }
    let mut actions = actions.into_iter().filter(|(after, _)| *after >= first).peekable();
    let mut n_played = first;
    while let Some(samples) = handles.wait(recording.next())? {
        for sample in samples {
            while let Some((_, action)) = actions.next_if(|(after, _)| *after <= n_played) {
                let _ = take(action);
            }
            if take(Input::NewSample(sample)).is_break() {
                return Ok(());
            }
            n_played += 1;
        }
    }
    actions.for_each(|(_, action)| {
        let _ = take(action);
    });
    Ok(())
}

/// Returns the engine's input for an action.
pub(super) const fn input(kind: ActionKind, code: FaultCode) -> Input {
    match kind {
        ActionKind::Clear => Input::Clear(code),
        ActionKind::Acknowledge => Input::Acknowledge(code),
    }
}
