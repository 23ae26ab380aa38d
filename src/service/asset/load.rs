//! Loads an asset from the store. Its open session is evaluated again from the recording,
//! which restores the state of the engine.

use std::ops::ControlFlow;

use super::actor::{Asset, Provenance};
use super::learning_record::LearningRecord;
use super::session::OpenSession;
use super::session_rate::SessionRate;
use super::turn::Environment;
use crate::service::playback::play;
use crate::service::writing::EngineGeneration;
use crate::service::{ServiceError, views};
use crate::store::{FaultFilter, SessionRow, Store};
use crate::wire::stored::{StoredMemory, StoredRecord};
use offbd_core::diagnosis::FaultMemory;
use offbd_core::engine::{Input, Setup};
use offbd_core::vocabulary::FaultCode;

/// Loads the asset `name`.
///
/// # Errors
/// [`ServiceError::UnknownAsset`]; [`ServiceError::Store`]; [`ServiceError::Corrupt`].
pub(super) fn load(env: &Environment, name: &str) -> Result<Asset, ServiceError> {
    let row = env.handles.wait(env.handles.store.asset(name))?;
    let row = row.ok_or_else(|| ServiceError::UnknownAsset { name: name.to_owned() })?;
    let rig = views::rig(&row.document)?;
    let (memory, provenance) = env.handles.wait(stored_memory(&env.handles.store, name))?;
    let session = env.handles.wait(env.handles.store.open_session(name))?;
    let learning = env.handles.wait(env.handles.store.learning(name))?;
    let learning: LearningRecord =
        learning.as_deref().map(views::from_json).transpose()?.unwrap_or_default();
    let refines = learning.refines();
    let open = session.map(|session| reopen(env, &session, refines)).transpose()?;
    let (generation, deleted) = (EngineGeneration::default(), false);
    let session_rate = SessionRate::default();
    Ok(Asset { row, rig, memory, provenance, open, session_rate, learning, generation, deleted })
}

/// Returns the stored fault memory of `asset` and the provenance of its entries.
async fn stored_memory(
    store: &Store,
    asset: &str,
) -> Result<(FaultMemory, Provenance), ServiceError> {
    let filter = FaultFilter { asset: Some(asset.to_owned()), ..FaultFilter::default() };
    let rows = store.faults(&filter, FaultCode::COUNT as u32).await?;
    let mut provenance = Provenance::default();
    for row in &rows {
        let code: FaultCode = row.code.parse().map_err(ServiceError::corrupt)?;
        provenance[code as usize] = views::from_json(&row.provenance)?;
    }
    let records: Result<Vec<StoredRecord>, _> =
        rows.iter().map(|row| views::from_json(&row.record)).collect();
    let memory = StoredMemory { records: records? }.memory().map_err(ServiceError::corrupt)?;
    Ok((memory, provenance))
}

fn reopen(env: &Environment, row: &SessionRow, refines: bool) -> Result<OpenSession, ServiceError> {
    let setup = Setup::new(views::rig(&row.setup)?, None)?;
    let baseline = views::memory(&row.baseline)?;
    let mut open = OpenSession::new(row.id.clone(), row.name.clone(), setup, baseline, refines);
    play(&env.handles, row, |input| {
        match input {
            Input::NewSample(sample) => {
                open.take_new(&sample);
            }
            action => {
                open.judging.input(action);
            }
        }
        ControlFlow::Continue(())
    })?;
    open.n_transitions = env.handles.wait(env.handles.store.n_transitions(&row.id))?;
    if open.progress.n_samples != row.progress.n_samples {
        tracing::warn!(
            session = row.id,
            recorded = row.progress.n_samples,
            taken = open.progress.n_samples,
            "this version accepts other samples of the recording than the one that wrote it"
        );
    }
    open.progress = row.progress;
    open.importing = row.importing != 0;
    Ok(open)
}
