//! Loads an asset from the store. The state of the engine of its open session is that of the
//! last snapshot; from there on, or from the start, the recording is evaluated again.

use std::ops::ControlFlow;

use super::actor::{Asset, Provenance};
use super::ended_session::EndedSession;
use super::learning_record::LearningRecord;
use super::link_health::LinkHealth;
use super::session::OpenSession;
use super::session_rate::SessionRate;
use crate::service::playback::play;
use crate::service::writing::{EngineGeneration, Handles};
use crate::service::{ServiceError, snapshots, views};
use crate::store::{FaultFilter, SessionRow, Snapshot, Store};
use crate::wire::stored::{StoredMemory, StoredRecord};
use offbd_core::diagnosis::FaultMemory;
use offbd_core::engine::{Input, Setup};
use offbd_core::vocabulary::FaultCode;

/// An asset as stored, whose open session is not up to date yet.
pub(super) struct StoredAsset {
    asset: Asset,
    /// The open session, its engine, and the number of samples that this has evaluated.
    open: Option<(SessionRow, OpenSession, i64)>,
}

impl StoredAsset {
    /// Reads the asset `name`, and the last snapshot of its engine; a fence must be complete
    /// since its last change. Blocks on the store.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`]; [`ServiceError::Store`]; [`ServiceError::Corrupt`].
    pub(super) fn read(handles: &Handles, name: &str) -> Result<Self, ServiceError> {
        let row = handles.wait(handles.store.asset(name))?;
        let row = row.ok_or_else(|| ServiceError::UnknownAsset { name: name.to_owned() })?;
        let rig = views::rig(&row.document)?;
        let (memory, provenance) = handles.wait(stored_memory(&handles.store, name))?;
        let session = handles.wait(handles.store.open_session(name))?;
        let learning = handles.wait(handles.store.learning(name))?;
        let learning: LearningRecord =
            learning.as_deref().map(views::from_json).transpose()?.unwrap_or_default();
        let refines = learning.refines();
        let ended = EndedSession::read(handles, name)?;
        let reopen = |session| reopen(handles, session, refines);
        Ok(Self {
            open: session.map(reopen).transpose()?,
            asset: Asset {
                row,
                rig,
                memory,
                provenance,
                open: None,
                session_rate: SessionRate::default(),
                link: LinkHealth::default(),
                malformed: Vec::new(),
                ended,
                learning,
                generation: EngineGeneration::default(),
                deleted: false,
                dropped: false,
                snapshots: Vec::new(),
            },
        })
    }

    /// Number of recorded samples that the engine has not evaluated yet.
    pub(super) fn n_behind(&self) -> i64 {
        self.open.as_ref().map_or(0, |(row, _, n_evaluated)| row.progress.n_samples - n_evaluated)
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
        if let Some((row, open, n_evaluated)) = open {
            let open = evaluate(handles, &row, open, n_evaluated, &mut asset.snapshots)?;
            asset.open = Some(Box::new(open));
        }
        Ok(asset)
    }
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

/// Returns the open session of `row` with its engine as of the last snapshot, or as at its
/// start, and the number of samples that the engine has evaluated.
fn reopen(
    handles: &Handles,
    row: SessionRow,
    refines: bool,
) -> Result<(SessionRow, OpenSession, i64), ServiceError> {
    let setup = Setup::new(views::rig(&row.setup)?, None)?;
    let baseline = views::memory(&row.baseline)?;
    let found = snapshots::last(handles, &row, &setup, i64::MAX)?;
    let mut open = OpenSession::new(&row, setup, baseline, refines);
    let counts_motion = open.motion.is_some();
    let Some((snapshot, restored)) = found.filter(|(_, r)| r.motion.is_some() == counts_motion)
    else {
        return Ok((row, open, 0));
    };
    (open.judging, open.motion) = (restored.judging, restored.motion);
    open.progress.n_samples = snapshot.n_samples;
    open.snapshot_at = snapshot.n_samples;
    Ok((row, open, snapshot.n_samples))
}

/// Evaluates the recording of the open session `row` from the sample `n_evaluated` on; adds
/// the snapshots that are due to `snapshots`.
fn evaluate(
    handles: &Handles,
    row: &SessionRow,
    mut open: OpenSession,
    n_evaluated: i64,
    due: &mut Vec<Snapshot>,
) -> Result<OpenSession, ServiceError> {
    let (mut n, mut failure) = (n_evaluated, None);
    play(handles, row, n_evaluated, |input| {
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
    open.n_transitions = handles.wait(handles.store.n_transitions(&row.id))?;
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
