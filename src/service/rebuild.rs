//! A running asset out of the store: the open session is judged again, from
//! its recording, and so comes to the state it was in.

use super::commit::Life;
use super::running::{OpenSession, Running, input};
use super::shard::Context;
use super::{ServiceError, views};
use crate::engine::Setup;
use crate::store::{ActionKind, SessionRow};
use crate::vocabulary::FaultCode;

/// The asset `name` as the store has it.
pub(super) fn load(context: &Context, name: &str) -> Result<Running, ServiceError> {
    let row = context.wait(context.store.asset(name))?;
    let row = row.ok_or_else(|| ServiceError::UnknownAsset { name: name.to_owned() })?;
    let rig = views::rig(&row.document)?;
    let memory = context.wait(views::stored_memory(&context.store, name))?;
    let session = context.wait(context.store.open_session(name))?;
    let open = session.map(|session| reopen(context, &session)).transpose()?;
    Ok(Running { row, rig, memory, open, life: Life::default(), deleted: false })
}

fn reopen(context: &Context, row: &SessionRow) -> Result<OpenSession, ServiceError> {
    let setup = Setup::new(views::rig(&row.setup)?, None)?;
    let baseline = views::memory(&row.baseline)?;
    let mut open = OpenSession::new(row.id.clone(), row.name.clone(), setup, baseline);
    let mut actions = context.wait(context.store.actions(&row.id))?.into_iter().peekable();
    let mut act = |open: &mut OpenSession| -> Result<(), ServiceError> {
        while let Some(action) = actions.next_if(|a| a.after_index <= open.progress.n_samples) {
            let kind: ActionKind = action.kind.parse()?;
            let code: FaultCode = action.code.parse().map_err(ServiceError::corrupt)?;
            open.input(input(kind, code));
        }
        Ok(())
    };
    while let Some((_, samples)) =
        context.wait(context.store.chunk_from(&row.id, open.progress.n_samples))?
    {
        for sample in &samples {
            act(&mut open)?;
            open.take(sample);
        }
    }
    act(&mut open)?;
    open.progress.n_rejected = row.progress.n_rejected;
    open.n_transitions = context.wait(context.store.n_transitions(&row.id))?;
    if open.progress.n_samples != row.progress.n_samples {
        tracing::warn!(
            session = row.id,
            recorded = row.progress.n_samples,
            taken = open.progress.n_samples,
            "this version takes other samples of the recording than the one that made it"
        );
        open.progress.n_samples = row.progress.n_samples;
    }
    Ok(open)
}
