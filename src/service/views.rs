//! Rows to views and back: the documents inside the store's rows.

use data_encoding::{HEXLOWER, HEXLOWER_PERMISSIVE};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::ServiceError;
use super::clock::rfc3339;
use super::running::Provenance;
use crate::store::{FaultFilter, FaultRow, SessionRow, Store};
use crate::wire::asset;
use crate::wire::memory::{self, FaultRecordView, MemoryView};
use crate::wire::provenance::ProvenanceView;
use crate::wire::service::{FaultEntryView, Page, SessionView};
use offbd_core::diagnosis::{FaultMemory, FaultRecord, MemoryRules};
use offbd_core::engine::Rig;
use offbd_core::vocabulary::{FaultCode, Invalid};

pub(super) fn to_json<T: Serialize>(view: &T) -> Result<String, ServiceError> {
    serde_json::to_string(view).map_err(ServiceError::corrupt)
}

pub(super) fn from_json<T: DeserializeOwned>(document: &str) -> Result<T, ServiceError> {
    serde_json::from_str(document).map_err(ServiceError::corrupt)
}

/// The rig of a stored asset file.
pub(super) fn rig(document: &str) -> Result<Rig, ServiceError> {
    asset::parse(document.as_bytes()).map_err(ServiceError::corrupt)
}

/// The fault memory of a stored document.
pub(super) fn memory(document: &str) -> Result<FaultMemory, ServiceError> {
    let view: MemoryView = from_json(document)?;
    memory::memory(&view).map_err(ServiceError::corrupt)
}

/// The fault memory that the store has for `asset`, and what it knows beside.
pub(super) async fn stored_memory(
    store: &Store,
    asset: &str,
) -> Result<(FaultMemory, Provenance), ServiceError> {
    let filter = FaultFilter { asset: Some(asset.to_owned()), ..FaultFilter::default() };
    let rows = store.faults(&filter, FaultCode::COUNT as u32).await?;
    let mut provenance = Provenance::default();
    for row in &rows {
        let code: FaultCode = row.code.parse().map_err(ServiceError::corrupt)?;
        provenance[code as usize] = from_json(&row.provenance)?;
    }
    let records: Result<Vec<FaultRecordView>, _> =
        rows.iter().map(|row| from_json(&row.record)).collect();
    let memory = memory::memory(&MemoryView { records: records? });
    Ok((memory.map_err(ServiceError::corrupt)?, provenance))
}

pub(super) fn fault(row: FaultRow) -> Result<FaultEntryView, ServiceError> {
    Ok(FaultEntryView {
        record: from_json(&row.record)?,
        provenance: from_json(&row.provenance)?,
        asset: row.asset,
        changed_at: rfc3339(row.changed_at),
        monitor: None,
    })
}

pub(super) fn session(row: SessionRow) -> Result<SessionView, ServiceError> {
    let count = |n: i64| u64::try_from(n).unwrap_or_default();
    Ok(SessionView {
        id: row.id,
        asset: row.asset,
        name: row.name,
        state: row.state,
        opened_at: rfc3339(row.opened_at),
        ended_at: row.ended_at.map(rfc3339),
        samples: count(row.progress.n_samples),
        rejected: count(row.progress.n_rejected),
        first_t_s: row.progress.first_t_s,
        last_t_s: row.progress.last_t_s,
        last_seq: row.progress.last_seq.map(count),
        verdict: row.verdict.as_deref().map(from_json).transpose()?,
    })
}

/// What is said of a code that has no row: it never failed.
pub(super) async fn never_failed(
    store: &Store,
    name: &str,
    code: FaultCode,
) -> Result<FaultEntryView, ServiceError> {
    let row = store.asset(name).await?;
    let changed_at = row.map(|row| rfc3339(row.created_at)).unwrap_or_default();
    let (record, rules) = (FaultRecord::default(), MemoryRules::default());
    Ok(FaultEntryView {
        asset: name.to_owned(),
        changed_at,
        record: memory::record_view(code, &record, &rules),
        provenance: ProvenanceView::default(),
        monitor: None,
    })
}

/// A page out of `rows`, of which there is one more than `limit` if another
/// page follows.
pub(super) fn page<R, V, K: Serialize>(
    mut rows: Vec<R>,
    limit: u32,
    key: impl Fn(&R) -> K,
    view: impl FnMut(R) -> Result<V, ServiceError>,
) -> Result<Page<V>, ServiceError> {
    let more = rows.len() > limit as usize;
    rows.truncate(limit as usize);
    let next = match rows.last().filter(|_| more) {
        Some(last) => Some(HEXLOWER.encode(to_json(&key(last))?.as_bytes())),
        None => None,
    };
    let items = rows.into_iter().map(view).collect::<Result<_, _>>()?;
    Ok(Page { items, next })
}

/// The key in a cursor that [`page`] gave.
pub(super) fn cursor<K: DeserializeOwned>(cursor: &str) -> Result<K, ServiceError> {
    let invalid = || Invalid::new("?cursor", "is not one that a page gave as `next`");
    let bytes = HEXLOWER_PERMISSIVE.decode(cursor.as_bytes()).ok();
    let key = bytes.and_then(|bytes| serde_json::from_slice(&bytes).ok());
    Ok(key.ok_or_else(invalid)?)
}
