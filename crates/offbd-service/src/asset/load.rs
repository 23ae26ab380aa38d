//! Loads assets from the store, several at once. The state of the engine of an open session is
//! that of the last snapshot; from there on, or from the start, the recording is evaluated
//! again.

use std::collections::HashMap;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::slice::from_ref;

use super::actor::{Asset, Provenance};
use super::ended_session::EndedSession;
use super::learning_record::LearningRecord;
use super::link_health::LinkHealth;
use super::session::OpenSession;
use super::session_rate::SessionRate;
use crate::playback::play_inputs;
use crate::writing::{EngineGeneration, Handles};
use crate::{ServiceError, snapshots, views};
use offbd_core::diagnosis::FaultMemory;
use offbd_core::engine::{Input, Setup};
use offbd_core::vocabulary::FaultCode;
use offbd_store::{AssetRecord, FaultRow, SessionInputs, SessionRow, Snapshot, Store, StoreError};
use offbd_wire::stored::{StoredMemory, StoredRecord};

/// Samples of all recordings that are read at once. Chosen: a few megabytes. Those of more are
/// read one after the other.
const SAMPLES_AT_ONCE: i64 = 100_000;

/// An asset as stored, whose open session is not up to date yet.
pub(super) struct StoredAsset {
    asset: Asset,
    open: Option<OutdatedSession>,
}

/// An open session with an engine that has evaluated the first `n_evaluated` samples of it.
struct OutdatedSession {
    row: SessionRow,
    session: OpenSession,
    n_evaluated: i64,
    /// What the engine takes next, if it is read already.
    inputs: Option<SessionInputs>,
}

/// Reads the assets `names`, which differ, and the last snapshots of their engines; a barrier
/// must be complete since their last change. Returns for each either the asset or the reason
/// why it cannot be read: [`ServiceError::UnknownAsset`], [`ServiceError::Store`],
/// [`ServiceError::Corrupt`]. Blocks on the store.
pub(super) fn read(handles: &Handles, names: &[String]) -> Vec<Result<StoredAsset, ServiceError>> {
    match handles.wait(handles.store.asset_records(names, &snapshots::version())) {
        Ok(mut records) => names.iter().map(|name| take_record(&mut records, name)).collect(),
        // What is damaged may concern one of them.
        Err(error) if names.len() > 1 && !error.is_outage() => {
            names.iter().flat_map(|name| read(handles, from_ref(name))).collect()
        }
        Err(error) => {
            let error = ServiceError::from(error);
            names.iter().map(|_| Err(error.clone())).collect()
        }
    }
}

fn take_record(
    records: &mut HashMap<String, AssetRecord>,
    name: &str,
) -> Result<StoredAsset, ServiceError> {
    let record = records.remove(name);
    let record = record.ok_or_else(|| ServiceError::UnknownAsset { name: name.to_owned() })?;
    unless_panicking(name, || record.try_into())
}

/// Returns the asset `name` with the engine of its open session in the last stored state, without
/// the samples after it, the fault memory and the ended sessions: for a question about an asset
/// that is not loaded.
///
/// # Errors
/// Those of [`read`].
pub(crate) async fn stored(store: &Store, name: &str) -> Result<Asset, ServiceError> {
    let mut records = store.open_records(&[name.to_owned()], &snapshots::version()).await?;
    let StoredAsset { mut asset, open } = take_record(&mut records, name)?;
    asset.open = open.map(|OutdatedSession { row, session, .. }| {
        Box::new(OpenSession { progress: row.progress, ..session })
    });
    Ok(asset)
}

/// Returns the result of `work`, in which a panic costs the asset `name` alone.
fn unless_panicking<T>(
    name: &str,
    work: impl FnOnce() -> Result<T, ServiceError>,
) -> Result<T, ServiceError> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|_| {
        tracing::error!(asset = name, "rebuilding the engine panicked");
        Err(ServiceError::Unavailable { what: "the engine of the asset cannot be rebuilt" })
    })
}

impl TryFrom<AssetRecord> for StoredAsset {
    type Error = ServiceError;
    fn try_from(record: AssetRecord) -> Result<Self, ServiceError> {
        let AssetRecord { row, learning, faults, open, ended, has_sessions } = record;
        let rig = views::rig(&row.document)?;
        let (memory, provenance) = stored_memory(&faults)?;
        let learning: LearningRecord =
            learning.as_deref().map(views::from_json).transpose()?.unwrap_or_default();
        let refines = learning.refines();
        let open = open.map(|(row, snapshot)| OutdatedSession::new(row, snapshot, refines));
        let asset = Asset {
            row,
            rig,
            memory,
            provenance,
            open: None,
            session_rate: SessionRate::default(),
            link: LinkHealth::default(),
            malformed: Vec::new(),
            batch_at: None,
            ended: ended.into_iter().map(EndedSession::stored).collect(),
            has_sessions,
            learning,
            generation: EngineGeneration::default(),
            deleted: false,
            dropped: false,
            snapshots: Vec::new(),
        };
        Ok(Self { asset, open: open.transpose()? })
    }
}

/// Returns the fault memory in `rows` and the provenance of its entries.
fn stored_memory(rows: &[FaultRow]) -> Result<(FaultMemory, Provenance), ServiceError> {
    let mut provenance = Provenance::default();
    for row in rows {
        let code: FaultCode = row.code.parse().map_err(ServiceError::corrupt)?;
        provenance[code as usize] = views::from_json(&row.provenance)?;
    }
    let records: Result<Vec<StoredRecord>, _> =
        rows.iter().map(|row| views::from_json(&row.record)).collect();
    let memory = StoredMemory { records: records? }.memory().map_err(ServiceError::corrupt)?;
    Ok((memory, provenance))
}

impl OutdatedSession {
    /// Returns the open session of `row` with its engine as of the `snapshot` or, without a
    /// usable one, as at its start.
    fn new(
        row: SessionRow,
        snapshot: Result<Option<Snapshot>, StoreError>,
        refines: bool,
    ) -> Result<Self, ServiceError> {
        let setup = Setup::new(views::rig(&row.setup)?, None)?;
        let baseline = views::memory(&row.baseline)?;
        let found = snapshots::restore(snapshot, &row, &setup)?;
        let mut session = OpenSession::new(&row, setup, baseline, refines);
        let counts_motion = session.motion.is_some();
        let mut n_evaluated = 0;
        if let Some((snapshot, restored)) =
            found.filter(|(_, restored)| restored.motion.is_some() == counts_motion)
        {
            (session.judging, session.motion) = (restored.judging, restored.motion);
            session.progress.n_samples = snapshot.n_samples;
            session.snapshot_at = snapshot.n_samples;
            n_evaluated = snapshot.n_samples;
        }
        Ok(Self { row, session, n_evaluated, inputs: None })
    }

    const fn n_behind(&self) -> i64 {
        self.row.progress.n_samples - self.n_evaluated
    }
}

/// Reads what the engines of `assets` take next, as far as that is little. The rest is read by
/// [`StoredAsset::catch_up`]. Blocks on the store.
///
/// # Errors
/// [`ServiceError::Store`] if the database is unavailable.
pub(super) fn read_ahead<'a>(
    handles: &Handles,
    assets: impl Iterator<Item = &'a mut StoredAsset>,
) -> Result<(), ServiceError> {
    let mut room = SAMPLES_AT_ONCE;
    let fits = |open: &&mut OutdatedSession| {
        let fits = open.n_behind() <= room;
        room -= if fits { open.n_behind() } else { 0 };
        fits
    };
    let mut open: Vec<_> = assets.filter_map(|asset| asset.open.as_mut()).filter(fits).collect();
    let wanted: Vec<_> = open.iter().map(|open| (&open.row, open.n_evaluated)).collect();
    match handles.wait(handles.store.session_inputs(&wanted)) {
        Ok(read) => {
            for (open, inputs) in open.iter_mut().zip(read) {
                open.inputs = Some(inputs);
            }
            Ok(())
        }
        Err(error) if error.is_outage() => Err(error.into()),
        // What is damaged may concern one of them, which fails when it is read alone.
        Err(_) => Ok(()),
    }
}

impl StoredAsset {
    /// Number of recorded samples that the engine has not evaluated yet.
    pub(super) fn n_behind(&self) -> i64 {
        self.open.as_ref().map_or(0, OutdatedSession::n_behind)
    }

    /// Evaluates the rest of the recording. Blocks on the store.
    ///
    /// # Errors
    /// [`ServiceError::Unavailable`] if the service is shutting down;
    /// [`ServiceError::Store`]; [`ServiceError::Corrupt`].
    pub(super) fn catch_up(self, handles: &Handles) -> Result<Asset, ServiceError> {
        let n_behind = self.n_behind().unsigned_abs();
        metrics::counter!("offbd_samples_reevaluated_total").increment(n_behind);
        let Self { mut asset, open } = self;
        let Some(open) = open else { return Ok(asset) };
        let name = asset.row.name.clone();
        unless_panicking(&name, || {
            let session = evaluate(handles, open, &mut asset.snapshots)?;
            asset.open = Some(Box::new(session));
            Ok(asset)
        })
    }
}

/// Evaluates the rest of the recording of `outdated`; adds the snapshots that are due to `due`.
fn evaluate(
    handles: &Handles,
    outdated: OutdatedSession,
    due: &mut Vec<Snapshot>,
) -> Result<OpenSession, ServiceError> {
    let OutdatedSession { row, session: mut open, n_evaluated, inputs } = outdated;
    let SessionInputs { actions, recording, n_transitions } = match inputs {
        Some(inputs) => inputs,
        None => handles.wait(handles.store.inputs_of(&row, n_evaluated))?,
    };
    open.acted_at = actions.last().map(|action| action.after_index);
    let (mut n, mut failure) = (n_evaluated, None);
    play_inputs(handles, actions, recording, n_evaluated, |input| {
        let Input::NewSample(sample) = input else {
            open.judging.input(input);
            return ControlFlow::Continue(());
        };
        open.take_new(&sample);
        n += 1;
        match open.snapshot_if_due(n, handles.sessions.snapshot_interval) {
            Ok(None) => {}
            Ok(Some(_)) if handles.closing.is_cancelled() => {
                let what = "the service is shutting down";
                failure = Some(ServiceError::Unavailable { what });
            }
            Ok(Some(snapshot)) => {
                due.retain(|earlier| earlier.kept);
                due.push(snapshot);
            }
            Err(error) => failure = Some(error),
        }
        if failure.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    if let Some(error) = failure {
        return Err(error);
    }
    open.n_transitions = n_transitions;
    if open.progress.n_samples != row.progress.n_samples {
        tracing::warn!(
            session = row.id,
            recorded = row.progress.n_samples,
            taken = open.progress.n_samples,
            "this version accepts other samples of the recording than the one that wrote it"
        );
    }
    open.progress = row.progress;
    Ok(open)
}

#[cfg(test)]
mod tests;
