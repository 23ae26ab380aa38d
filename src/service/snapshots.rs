//! Snapshots of the engines of sessions, so that an engine need not judge a long recording
//! again from its start. The recording is what counts: without a usable snapshot, it is
//! judged from the start.

use super::ServiceError;
use super::views;
use super::writing::Handles;
use crate::judging::Judging;
use crate::store::{SessionRow, Snapshot};
use crate::wire::basis::Basis;
use offbd_core::engine::{JUDGEMENT, SNAPSHOT_FORMAT, Setup, UsableMotion};

/// Samples of a session between two snapshots. Chosen: judging as many again takes some 20 ms,
/// and the snapshots, of about 15 kB each, are a tenth of what the samples themselves take.
pub(super) const INTERVAL: i64 = 16_384;

/// Samples of a session between two snapshots that are kept, so that a stretch of a long
/// recording can be judged again by itself: some 0.3 s of one core.
pub(super) const KEPT_INTERVAL: i64 = 1 << 18;

/// The engine of a session at some sample.
pub(super) struct RestoredEngine {
    /// Samples after which it had this state.
    pub(super) n_samples: i64,
    pub(super) judging: Judging,
    /// The motion counted for a calibration, if it was counted.
    pub(super) motion: Option<UsableMotion>,
}

/// The version of a snapshot; others cannot be read, or would be continued differently.
pub(super) fn version() -> String {
    format!("{JUDGEMENT}.{SNAPSHOT_FORMAT}")
}

/// Returns the serialised state of an engine.
pub(super) fn state(
    judging: &Judging,
    motion: Option<&UsableMotion>,
) -> Result<Vec<u8>, ServiceError> {
    rmp_serde::to_vec(&(judging, motion)).map_err(ServiceError::corrupt)
}

/// Returns a snapshot of the engine of `session` after `n_samples` samples; `last` is the
/// number of samples at the previous one.
pub(super) fn take(
    session: &str,
    n_samples: i64,
    last: i64,
    judging: &Judging,
    motion: Option<&UsableMotion>,
) -> Result<Snapshot, ServiceError> {
    Ok(Snapshot {
        session: session.to_owned(),
        n_samples,
        kept: n_samples / KEPT_INTERVAL > last / KEPT_INTERVAL,
        version: version(),
        state: state(judging, motion)?,
    })
}

/// Returns the last snapshot of `session` that is not after the sample `at_most`, with the
/// engine in it; `None` if there is none for the settings of the session. Blocks on the
/// store.
pub(super) fn last(
    handles: &Handles,
    session: &SessionRow,
    at_most: i64,
) -> Result<Option<(Snapshot, RestoredEngine)>, ServiceError> {
    let at_most = at_most.min(session.progress.n_samples);
    let snapshot = handles.wait(handles.store.snapshot(&session.id, &version(), at_most));
    let read = snapshot.map_err(ServiceError::from).and_then(|s| s.map(read).transpose());
    let found = match read {
        Ok(found) => found,
        Err(error @ ServiceError::Corrupt { .. }) => {
            tracing::error!(session = session.id, %error, "a snapshot is not used");
            None
        }
        Err(error) => return Err(error),
    };
    let basis = Basis::of(&Setup::new(views::rig(&session.setup)?, None)?);
    Ok(found.filter(|(_, restored)| *restored.judging.basis() == basis))
}

fn read(snapshot: Snapshot) -> Result<(Snapshot, RestoredEngine), ServiceError> {
    let (judging, motion) =
        rmp_serde::from_slice(&snapshot.state).map_err(ServiceError::corrupt)?;
    let restored = RestoredEngine { n_samples: snapshot.n_samples, judging, motion };
    Ok((snapshot, restored))
}

/// Returns the engine of `session` with `setup` at or before the sample `at_most`: from a
/// snapshot if there is one for this set-up, otherwise at the start of the session. Blocks on
/// the store.
pub(super) fn engine_before(
    handles: &Handles,
    session: &SessionRow,
    setup: Setup,
    at_most: i64,
) -> Result<(i64, Judging), ServiceError> {
    let found = last(handles, session, at_most)?.map(|(_, restored)| restored);
    let fits = |restored: &RestoredEngine| *restored.judging.basis() == Basis::of(&setup);
    if let Some(restored) = found.filter(fits) {
        return Ok((restored.n_samples, restored.judging));
    }
    Ok((0, Judging::new(setup, views::memory(&session.baseline)?)))
}
