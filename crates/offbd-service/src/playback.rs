//! Plays a recorded session: its samples and actions, in their original order.

use std::ops::ControlFlow;
use std::sync::mpsc;

use super::ServiceError;
use super::background::Priority;
use super::writing::Handles;
use offbd_core::engine::Input;
use offbd_core::vocabulary::FaultCode;
use offbd_store::{ActionKind, ActionRow, RecordingReader, SessionRow};

/// Inputs that are passed to another thread at once.
const BLOCK: usize = 1024;

/// Blocks that wait for the other thread; reading waits when there are more.
const MAX_WAITING_BLOCKS: usize = 4;

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

/// As [`play`] from the first sample on, but calls `take` on its own thread with this
/// `priority`. The recording is read on the current thread.
pub(super) fn play_in_background(
    handles: &Handles,
    session: &SessionRow,
    priority: Priority,
    mut take: impl FnMut(Input) -> ControlFlow<()> + Send,
) -> Result<(), ServiceError> {
    std::thread::scope(|scope| {
        let (send, blocks) = mpsc::sync_channel::<Vec<Input>>(MAX_WAITING_BLOCKS);
        let taking = priority.spawn(scope, move || {
            for input in blocks.into_iter().flatten() {
                let is_sample = matches!(input, Input::NewSample(_));
                if take(input).is_break() && is_sample {
                    return;
                }
            }
        })?;
        let mut block = Vec::new();
        let read = play(handles, session, 0, |input| {
            block.push(input);
            if block.len() < BLOCK {
                return ControlFlow::Continue(());
            }
            let sent = send.send(std::mem::take(&mut block));
            if sent.is_ok() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        // The other thread may have broken off.
        let _ = send.send(block);
        drop(send);
        let panicked = |_| ServiceError::Unavailable { what: "evaluating the recording failed" };
        taking.join().map_err(panicked)?;
        read
    })
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
