//! Converts rows of the store, and the JSON documents in them, to views and back.

use data_encoding::{HEXLOWER, HEXLOWER_PERMISSIVE};
use std::str::FromStr;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::ServiceError;
use super::clock::rfc3339;
use offbd_core::diagnosis::{FaultMemory, FaultRecord, MemoryRules};
use offbd_core::engine::Rig;
use offbd_core::vocabulary::{FaultCode, Invalid, UnknownWord};
use offbd_store::{FaultRow, SessionRow, Store};
use offbd_wire::asset;
use offbd_wire::memory;
use offbd_wire::provenance::ProvenanceView;
use offbd_wire::service::{FaultEntryView, Page, SessionView};
use offbd_wire::session_file::SessionInfo;
use offbd_wire::stored::{StoredMemory, StoredProvenance, StoredRecord};

pub(super) fn to_json<T: Serialize>(view: &T) -> Result<String, ServiceError> {
    serde_json::to_string(view).map_err(ServiceError::corrupt)
}

pub(super) fn from_json<T: DeserializeOwned>(document: &str) -> Result<T, ServiceError> {
    serde_json::from_str(document).map_err(ServiceError::corrupt)
}

/// Parses a column with a closed set of values.
pub(super) fn word<T: FromStr<Err = UnknownWord>>(column: &str) -> Result<T, ServiceError> {
    column.parse().map_err(ServiceError::corrupt)
}

/// Parses the rig of a stored asset file.
pub(super) fn rig(document: &str) -> Result<Rig, ServiceError> {
    asset::parse(document.as_bytes()).map_err(ServiceError::corrupt)
}

/// Parses a stored fault memory.
pub(super) fn memory(document: &str) -> Result<FaultMemory, ServiceError> {
    let stored: StoredMemory = from_json(document)?;
    stored.memory().map_err(ServiceError::corrupt)
}

pub(super) fn fault(row: FaultRow) -> Result<FaultEntryView, ServiceError> {
    let stored: StoredRecord = from_json(&row.record)?;
    let provenance: StoredProvenance = from_json(&row.provenance)?;
    let record = stored.record().map_err(ServiceError::corrupt)?;
    Ok(FaultEntryView {
        record: memory::record_view(stored.code.into(), &record, &MemoryRules::default()),
        provenance: provenance.into(),
        asset: row.asset,
        changed_at: rfc3339(row.changed_at),
        monitor: None,
        session_open: None,
        communication_lost_since: None,
    })
}

/// What a file says about the session, beside its samples.
pub(super) fn session_info(row: &SessionRow) -> Result<SessionInfo, ServiceError> {
    Ok(SessionInfo {
        session: row.name.clone(),
        opened_at: Some(rfc3339(row.opened_at)),
        first_t_s: row.progress.first_t_s,
        asset_file: Some(row.setup.clone()),
        calibration_id: rig(&row.setup)?.calibration.as_deref().map(asset::calibration_id),
        verdict_hash: row.verdict_hash.clone(),
    })
}

pub(super) fn session(row: SessionRow) -> Result<SessionView, ServiceError> {
    let count = |n: i64| u64::try_from(n).unwrap_or_default();
    Ok(SessionView {
        id: row.id,
        asset: row.asset,
        name: row.name,
        state: word(&row.state)?,
        opened_at: rfc3339(row.opened_at),
        ended_at: row.ended_at.map(rfc3339),
        samples: count(row.progress.n_samples),
        rejected: count(row.progress.n_rejected),
        first_t_s: row.progress.first_t_s,
        last_t_s: row.progress.last_t_s,
        last_seq: row.progress.last_seq.map(count),
        part: count(row.part),
        first_part: row.first_part,
        verdict: row.verdict.as_deref().map(from_json).transpose()?,
    })
}

/// Returns the entry of a code without a row, which has never failed.
pub(super) async fn never_failed(
    store: &Store,
    name: &str,
    code: FaultCode,
) -> Result<FaultEntryView, ServiceError> {
    let unknown = || ServiceError::UnknownAsset { name: name.to_owned() };
    let changed_at = rfc3339(store.asset_created_at(name).await?.ok_or_else(unknown)?);
    let (record, rules) = (FaultRecord::default(), MemoryRules::default());
    Ok(FaultEntryView {
        asset: name.to_owned(),
        changed_at,
        record: memory::record_view(code, &record, &rules),
        provenance: ProvenanceView::default(),
        monitor: None,
        session_open: None,
        communication_lost_since: None,
    })
}

/// Returns a page of `rows`, which has one row more than `limit` if another page follows.
pub(super) fn page<R, V, K: Serialize>(
    mut rows: Vec<R>,
    limit: u32,
    key: impl Fn(&R) -> K,
    view: impl FnMut(R) -> Result<V, ServiceError>,
) -> Result<Page<V>, ServiceError> {
    let has_next = rows.len() > limit as usize;
    rows.truncate(limit as usize);
    let next = rows.last().filter(|_| has_next).map(|last| to_cursor(&key(last))).transpose()?;
    let items = rows.into_iter().map(view).collect::<Result<_, _>>()?;
    Ok(Page { items, next })
}

/// Encodes a key as a cursor.
pub(super) fn to_cursor<K: Serialize>(key: &K) -> Result<String, ServiceError> {
    Ok(HEXLOWER.encode(to_json(key)?.as_bytes()))
}

/// Decodes the key in a cursor that [`page`] returned.
pub(super) fn cursor<K: DeserializeOwned>(cursor: &str) -> Result<K, ServiceError> {
    let invalid = || Invalid::new("?cursor", "not the `next` of a previous page");
    let bytes = HEXLOWER_PERMISSIVE.decode(cursor.as_bytes()).ok();
    let key = bytes.and_then(|bytes| serde_json::from_slice(&bytes).ok());
    Ok(key.ok_or_else(invalid)?)
}
