//! A recorded session once more: its samples and what people did, in order.

use super::ServiceError;
use super::handles::Handles;
use super::running::input;
use crate::store::ActionKind;
use offbd_core::engine::Input;
use offbd_core::vocabulary::FaultCode;

/// Gives the inputs of `session` to `take`, in the order in which they came,
/// until it says that it is enough. Waits for the store on the calling thread,
/// which must not be one of the runtime's.
pub(super) fn play(
    handles: &Handles,
    session: &str,
    mut take: impl FnMut(Input) -> Flow,
) -> Result<(), ServiceError> {
    let mut actions = Vec::new();
    for row in handles.wait(handles.store.actions(session))? {
        let kind: ActionKind = row.kind.parse()?;
        let code: FaultCode = row.code.parse().map_err(ServiceError::corrupt)?;
        actions.push((row.after_index, input(kind, code)));
    }
    let mut actions = actions.into_iter().peekable();
    let mut n_played = 0;
    while let Some(samples) = handles.wait(handles.store.samples_from(session, n_played))? {
        for sample in samples {
            while let Some((_, action)) = actions.next_if(|(after, _)| *after <= n_played) {
                take(action);
            }
            if take(Input::Sample(sample)) == Flow::Enough {
                return Ok(());
            }
            n_played += 1;
        }
    }
    actions.for_each(|(_, action)| {
        take(action);
    });
    Ok(())
}

/// Whether to go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Flow {
    More,
    Enough,
}
