//! The statements of changes without their own file.

use sqlx::AnyConnection;

use super::group::GroupCommit;
use crate::execute::execute;
use crate::rows::published_counter;
use crate::{
    ActionRow, AssetRow, CalibrationRow, CommunicationChange, FaultRow, Micros, PartitionId,
    ReplayRow, SessionEnd, SessionRow, StoreError, TransitionRow, TrendRow, alarm, snapshot,
};

pub(super) async fn create_asset(
    db: &mut AnyConnection,
    partition: PartitionId,
    row: &AssetRow,
) -> Result<(), StoreError> {
    execute!(
        db, "INSERT INTO asset (partition, name, document, revision, created_at, updated_at)
         VALUES ($1, $2, $3, $4, $5, $6)";
        partition.bound(), &row.name, &row.document, row.revision, row.created_at, row.updated_at
    )
}

pub(super) async fn update_asset(db: &mut AnyConnection, row: &AssetRow) -> Result<(), StoreError> {
    execute!(
        db, "UPDATE asset SET document = $2, revision = $3, updated_at = $4 WHERE name = $1";
        &row.name, &row.document, row.revision, row.updated_at
    )
}

pub(super) async fn open_session(
    db: &mut AnyConnection,
    row: &SessionRow,
) -> Result<(), StoreError> {
    execute!(
        db, "INSERT INTO session (id, asset, name, state, opened_at, setup, baseline, importing,
         part, first_part, n_samples, n_rejected)
         VALUES ($1, $2, $3, 'open', $4, $5, $6, $7, $8, $9, 0, 0)";
        &row.id, &row.asset, &row.name, row.opened_at, &row.setup, &row.baseline, row.importing,
        row.part, &row.first_part
    )
}

/// Numbers and stores a change of communication; one that changes nothing is not an event.
pub(super) async fn change_communication(
    db: &mut AnyConnection,
    group: &mut GroupCommit<'_>,
    row: &mut CommunicationChange,
) -> Result<(), StoreError> {
    row.id = group.events.next(db).await?;
    if !alarm::change_communication(db, row).await? {
        row.id = 0;
    }
    Ok(())
}

pub(super) async fn insert_action(
    db: &mut AnyConnection,
    group: &mut GroupCommit<'_>,
    row: &mut ActionRow,
) -> Result<(), StoreError> {
    row.id = group.events.next(db).await?;
    execute!(
        db, "INSERT INTO action (id, asset, session, after_index, kind, code, actor, at, event)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9)";
        row.id, &row.asset, &row.session, row.after_index, &row.kind, &row.code, &row.actor,
        row.at, &row.event
    )
}

pub(super) async fn insert_transition(
    db: &mut AnyConnection,
    group: &mut GroupCommit<'_>,
    row: &mut TransitionRow,
) -> Result<(), StoreError> {
    row.id = group.events.next(db).await?;
    execute!(
        db, "INSERT INTO transition (id, asset, session, ordinal, t_s, code, status, at, document)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9)";
        row.id, &row.asset, &row.session, row.ordinal, row.t_s, &row.code, &row.status, row.at,
        &row.document
    )
}

pub(super) async fn put_fault(db: &mut AnyConnection, row: &FaultRow) -> Result<(), StoreError> {
    execute!(
        db, "INSERT INTO fault (asset, code, status, acknowledged, changed_at, record, provenance)
         VALUES ($1, $2, $3, $4, $5, $6, $7)
         ON CONFLICT (asset, code) DO UPDATE SET status = excluded.status,
         acknowledged = excluded.acknowledged, changed_at = excluded.changed_at,
         record = excluded.record, provenance = excluded.provenance";
        &row.asset, &row.code, &row.status, row.acknowledged, row.changed_at, &row.record,
        &row.provenance
    )
}

pub(super) async fn insert_trend(db: &mut AnyConnection, row: &TrendRow) -> Result<(), StoreError> {
    execute!(
        db, "INSERT INTO trend (session, axis, asset, ended_at, n_samples, calibration_id, gain,
         gain_error, offset_m_s2, offset_error_m_s2, delay_s, delay_error_s, motion_s, warnings)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13, $14)";
        &row.session, &row.axis, &row.asset, row.ended_at, row.n_samples, &row.calibration_id,
        row.gain, row.gain_error, row.offset_m_s2, row.offset_error_m_s2, row.delay_s,
        row.delay_error_s, row.motion_s, &row.warnings
    )
}

/// Stores a replay, unless its session has been deleted.
pub(super) async fn put_replay(db: &mut AnyConnection, row: &ReplayRow) -> Result<(), StoreError> {
    let session = sqlx::query("SELECT 1 FROM session WHERE id = $1").bind(&row.session);
    if session.fetch_optional(&mut *db).await?.is_none() {
        return Ok(());
    }
    execute!(
        db, "INSERT INTO replay (id, session, state, settings, created_at, finished_at, result,
         error) VALUES ($1, $2, $3, $4, $5, $6, $7, $8)
         ON CONFLICT (id) DO UPDATE SET state = excluded.state,
         finished_at = excluded.finished_at, result = excluded.result, error = excluded.error";
        &row.id, &row.session, &row.state, &row.settings, row.created_at, row.finished_at,
        &row.result, &row.error
    )
}

pub(super) async fn put_calibration(
    db: &mut AnyConnection,
    row: &CalibrationRow,
) -> Result<(), StoreError> {
    execute!(
        db, "INSERT INTO calibration (id, asset, state, sessions, made_at, active, document, error,
         made_by) VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9)
         ON CONFLICT (id) DO UPDATE SET state = excluded.state, document = excluded.document,
         error = excluded.error";
        &row.id, &row.asset, &row.state, &row.sessions, row.made_at, row.active, &row.document,
        &row.error, &row.made_by
    )
}

pub(super) async fn activate(
    db: &mut AnyConnection,
    asset: &str,
    id: &str,
    (by, at): (Option<&str>, Micros),
) -> Result<(), StoreError> {
    execute!(&mut *db, "UPDATE calibration SET active = 0 WHERE asset = $1 AND active = 1"; asset)?;
    execute!(
        db, "UPDATE calibration SET active = 1, activated_by = $3, activated_at = $4
         WHERE asset = $1 AND id = $2";
        asset, id, by, at
    )
}

pub(super) async fn put_learning(
    db: &mut AnyConnection,
    asset: &str,
    document: &str,
) -> Result<(), StoreError> {
    execute!(db, "UPDATE asset SET learning = $2 WHERE name = $1"; asset, document)
}

pub(super) async fn published(
    db: &mut AnyConnection,
    bus: &str,
    event: i64,
) -> Result<(), StoreError> {
    let sql = "INSERT INTO counter (name, value) VALUES ($1, $2)
        ON CONFLICT (name) DO UPDATE SET value = excluded.value";
    execute!(db, sql; published_counter(bus), event)
}

impl GroupCommit<'_> {
    /// Ends a session, whose samples leave the journal.
    pub(super) async fn end_session(
        &mut self,
        db: &mut AnyConnection,
        partition: PartitionId,
        row: &SessionEnd,
    ) -> Result<(), StoreError> {
        self.fold_ended(db, partition, &row.session).await?;
        snapshot::remove(db, &row.session).await?;
        execute!(
            db, "UPDATE session SET state = 'ended', importing = 0, ended_at = $2, verdict = $3,
             verdict_hash = $4, found_fault = $5,
             n_bytes = (SELECT CAST(COALESCE(SUM(LENGTH(data)), 0) AS BIGINT) FROM chunk
                        WHERE chunk.session = session.id)
                 + LENGTH(setup) + LENGTH(baseline) + LENGTH($3)
             WHERE id = $1";
            &row.session, row.ended_at, &row.verdict, &row.hash, i64::from(row.found_fault)
        )
    }
}
