//! Snapshots of the engines of sessions, so that an engine need not judge a long recording
//! again from its start. The recording is what counts: without a usable snapshot, it is
//! judged from the start.

use super::ServiceError;
use super::views;
use super::writing::Handles;
use offbd_core::engine::{JUDGEMENT, SNAPSHOT_FORMAT, Setup, UsableMotion};
use offbd_store::{SessionRow, Snapshot, StoreError};
use offbd_wire::basis::Basis;
use offbd_wire::judging::Judging;

/// Of the snapshots of a session, one in as many is kept, so that a stretch of a long
/// recording can be judged again by itself: some 0.3 s of one core.
const KEPT_OF: i64 = 16;

/// The engine in a snapshot.
pub(super) struct RestoredEngine {
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

/// Returns whether the snapshot of a session after `n_samples` samples is kept; `last` is the
/// number of samples at the previous one, and `interval` the usual one between two.
pub(super) const fn is_kept(n_samples: i64, last: i64, interval: i64) -> bool {
    n_samples / (KEPT_OF * interval) > last / (KEPT_OF * interval)
}

/// Returns the last snapshot of `session` that is not after the sample `at_most`, with the
/// engine in it; `None` if there is none for `setup`. Blocks on the store.
pub(super) fn last(
    handles: &Handles,
    session: &SessionRow,
    setup: &Setup,
    at_most: i64,
) -> Result<Option<(Snapshot, RestoredEngine)>, ServiceError> {
    let at_most = at_most.min(session.progress.n_samples);
    let snapshot = handles.wait(handles.store.snapshot(&session.id, &version(), at_most));
    restore(snapshot, session, setup)
}

/// Returns the `snapshot` of `session` that was read, with the engine in it; `None` if it is
/// damaged, or not one for `setup`.
pub(super) fn restore(
    snapshot: Result<Option<Snapshot>, StoreError>,
    session: &SessionRow,
    setup: &Setup,
) -> Result<Option<(Snapshot, RestoredEngine)>, ServiceError> {
    let basis = Basis::of(setup);
    let found = undamaged(snapshot, session)?;
    Ok(found.filter(|(_, restored)| *restored.judging.basis() == basis))
}

/// Returns the `snapshot` of `session` that was read, with the engine in it; `None` if it is
/// damaged, which is logged.
pub(super) fn undamaged(
    snapshot: Result<Option<Snapshot>, StoreError>,
    session: &SessionRow,
) -> Result<Option<(Snapshot, RestoredEngine)>, ServiceError> {
    match snapshot.map_err(ServiceError::from).and_then(|s| s.map(read).transpose()) {
        Err(error @ ServiceError::Corrupt { .. }) => {
            tracing::error!(session = session.id, %error, "a snapshot is not used");
            Ok(None)
        }
        read => read,
    }
}

fn read(snapshot: Snapshot) -> Result<(Snapshot, RestoredEngine), ServiceError> {
    let (judging, motion) =
        rmp_serde::from_slice(&snapshot.state).map_err(ServiceError::corrupt)?;
    Ok((snapshot, RestoredEngine { judging, motion }))
}

/// Returns the engine of `session` with `setup` at or before the sample `at_most`, and the
/// number of samples it has evaluated: from a snapshot if there is one for `setup`, otherwise
/// at the start of the session. Blocks on the store.
pub(super) fn engine_before(
    handles: &Handles,
    session: &SessionRow,
    setup: Setup,
    at_most: i64,
) -> Result<(i64, Judging), ServiceError> {
    match last(handles, session, &setup, at_most)? {
        Some((snapshot, restored)) => Ok((snapshot.n_samples, restored.judging)),
        None => Ok((0, Judging::new(setup, views::memory(&session.baseline)?))),
    }
}
