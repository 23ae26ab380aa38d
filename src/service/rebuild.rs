//! A running asset out of the store: the open session is judged again, from
//! its recording, and so comes to the state it was in.

use super::commit::Life;
use super::learning::Record;
use super::playback::{Flow, play};
use super::running::{OpenSession, Running};
use super::shard::Context;
use super::{ServiceError, views};
use crate::store::SessionRow;
use offbd_core::engine::{Input, Setup};

/// The asset `name` as the store has it.
pub(super) fn load(context: &Context, name: &str) -> Result<Running, ServiceError> {
    let row = context.handles.wait(context.handles.store.asset(name))?;
    let row = row.ok_or_else(|| ServiceError::UnknownAsset { name: name.to_owned() })?;
    let rig = views::rig(&row.document)?;
    let (memory, provenance) =
        context.handles.wait(views::stored_memory(&context.handles.store, name))?;
    let session = context.handles.wait(context.handles.store.open_session(name))?;
    let learning = context.handles.wait(context.handles.store.learning(name))?;
    let learning: Record =
        learning.as_deref().map(views::from_json).transpose()?.unwrap_or_default();
    let refines = learning.refines();
    let open = session.map(|session| reopen(context, &session, refines)).transpose()?;
    let (life, deleted) = (Life::default(), false);
    Ok(Running { row, rig, memory, provenance, open, learning, life, deleted })
}

fn reopen(context: &Context, row: &SessionRow, refines: bool) -> Result<OpenSession, ServiceError> {
    let setup = Setup::new(views::rig(&row.setup)?, None)?;
    let baseline = views::memory(&row.baseline)?;
    let mut open = OpenSession::new(row.id.clone(), row.name.clone(), setup, baseline, refines);
    play(&context.handles, &row.id, |input| {
        match input {
            Input::Sample(sample) => {
                open.take(&sample);
            }
            action => {
                open.judging.input(action);
            }
        }
        Flow::More
    })?;
    open.n_transitions = context.handles.wait(context.handles.store.n_transitions(&row.id))?;
    if open.progress.n_samples != row.progress.n_samples {
        tracing::warn!(
            session = row.id,
            recorded = row.progress.n_samples,
            taken = open.progress.n_samples,
            "this version takes other samples of the recording than the one that made it"
        );
    }
    open.progress = row.progress;
    Ok(open)
}
