//! The faults of a component: the fault memory of a rig.

use axum::extract::{RawQuery, State};
use axum::http::StatusCode;
use axum::{Extension, Json};
use serde::Deserialize;
use serde_json::Value;

use super::{AssetItemPath, AssetPath, Problem, Query, SchemaQuery, answer, recordings};
use offbd_core::vocabulary::Invalid;
use offbd_service::access::Caller;
use offbd_service::{Service, ServiceError};
use offbd_wire::service::FaultEntryView;
use offbd_wire::sovd::{
    SCOPE, SovdFaultDetailView, SovdFaultRecordingView, SovdFaultView, SovdFaultsView,
    SovdStatusView, fault_detail, fault_item,
};
use offbd_wire::words::{CodeWord, StatusFilter, StatusWord};

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct FaultsQuery {
    /// Only faults of this severity.
    #[param(format = Int32, minimum = 1, maximum = 4)]
    severity: Option<u32>,
    /// Only faults of this scope.
    scope: Option<String>,
}

/// Name in the audit log of a caller without a token.
const UNKNOWN: &str = "unknown";

fn actor(caller: &Caller) -> String {
    caller.name().unwrap_or(UNKNOWN).to_owned()
}

/// Returns the pairs of `status[key]=value` in a query.
///
/// # Errors
/// [`Invalid`] if there is no such key or value.
fn status_pairs(query: Option<&str>) -> Result<Vec<(String, String)>, Invalid> {
    let mut pairs = Vec::new();
    for (name, value) in form_urlencoded::parse(query.unwrap_or_default().as_bytes()) {
        let Some(rest) = name.strip_prefix("status") else { continue };
        let key = rest.strip_prefix('[').and_then(|rest| rest.strip_suffix(']'));
        let key = key.ok_or_else(|| Invalid::new("?status", "is not of the form status[KEY]"))?;
        if SovdStatusView::default().matches(key, &value).is_none() {
            let reason = "is not a key of the status, or its value is not 0, 1, true or false";
            return Err(Invalid::new(format!("?status[{key}]"), reason));
        }
        pairs.push((key.to_owned(), value.into_owned()));
    }
    Ok(pairs)
}

/// Whether a fault has one of the wanted statuses, or none is wanted.
fn has_status(fault: &SovdFaultView, pairs: &[(String, String)]) -> bool {
    let matches = |(key, value): &(String, String)| fault.status.matches(key, value) == Some(true);
    pairs.is_empty() || pairs.iter().any(matches)
}

/// Lists the faults of a rig that are on record; with `status`, also those that were cleared.
/// `severity` and `scope` select further; several `status` are alternatives.
#[utoipa::path(get, path = "/v1/components/{asset}/faults", tag = "sovd",
    operation_id = "sovd_faults",
    params(("asset" = String, description = "Name of the asset"), FaultsQuery, SchemaQuery,
        ("status" = Option<BTreeMap<String, String>>, Query, style = DeepObject, explode,
            description = "Keys of the status with a value, as `status[confirmedDTC]=1`; \
                several are alternatives")),
    responses((status = 200, body = SovdFaultsView), (status = 400, body = Problem),
        (status = 404, body = Problem)))]
pub(super) async fn list(
    State(service): State<Service>,
    AssetPath(asset): AssetPath,
    RawQuery(raw): RawQuery,
    Query(filter): Query<FaultsQuery>,
    Query(query): Query<SchemaQuery>,
) -> Result<Json<Value>, Problem> {
    let pairs = status_pairs(raw.as_deref())?;
    let page = service.asset_faults(&asset, Some(StatusFilter::All)).await?;
    let mut items = Vec::new();
    for entry in &page.items {
        let fault = fault_item(entry);
        // A cleared fault is one that is not there, unless a status is asked for.
        let is_there = !pairs.is_empty() || entry.record.status != StatusWord::Cleared;
        let is_wanted = filter.severity.is_none_or(|severity| severity == fault.severity)
            && filter.scope.as_ref().is_none_or(|scope| scope == SCOPE);
        if has_status(&fault, &pairs) && is_wanted && is_there {
            items.push(fault);
        }
    }
    Ok(answer(&SovdFaultsView { items }, "SovdFaults", &query))
}

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct DetailQuery {
    /// Whether the answer has counters and times; `true` by default.
    #[serde(rename = "include-extended-data")]
    #[param(rename = "include-extended-data")]
    extended: Option<bool>,
    /// Whether the answer has the freeze frame and the path of the recording; `true` by default.
    #[serde(rename = "include-snapshot-data")]
    #[param(rename = "include-snapshot-data")]
    snapshots: Option<bool>,
}

/// Returns a reference to the recording of the last occurrence, unless it has been deleted.
async fn recording(
    service: &Service,
    entry: &FaultEntryView,
) -> Result<Option<SovdFaultRecordingView>, Problem> {
    let Some(last) = &entry.provenance.last_occurrence else { return Ok(None) };
    let session = match service.session(&last.session_id).await {
        Ok(session) => session,
        Err(ServiceError::UnknownSession { .. }) => return Ok(None),
        Err(error) => return Err(error.into()),
    };
    Ok(Some(SovdFaultRecordingView {
        kind: "recording".to_owned(),
        bulk_data_uri: format!("{}/{}", recordings::path(&session.asset), session.id),
        name: session.name,
    }))
}

/// Returns a fault with the environment in which it occurred. The environment is the freeze frame,
/// counters and times, and the path of the recording.
#[utoipa::path(get, path = "/v1/components/{asset}/faults/{code}", tag = "sovd",
    operation_id = "sovd_fault",
    params(("asset" = String, description = "Name of the asset"),
        ("code" = CodeWord, description = "Fault code"), DetailQuery, SchemaQuery),
    responses((status = 200, body = SovdFaultDetailView), (status = 404, body = Problem)))]
pub(super) async fn get(
    State(service): State<Service>,
    AssetItemPath(asset, code): AssetItemPath,
    Query(detail): Query<DetailQuery>,
    Query(query): Query<SchemaQuery>,
) -> Result<Json<Value>, Problem> {
    let entry = service.fault(&asset, &code).await?;
    let (extended, snapshots) = (detail.extended.unwrap_or(true), detail.snapshots.unwrap_or(true));
    let recording = if snapshots { recording(&service, &entry).await? } else { None };
    Ok(answer(&fault_detail(entry, extended, snapshots, recording), "SovdFaultDetail", &query))
}

/// Clears a fault: erases its record. The recordings and the history are kept.
#[utoipa::path(delete, path = "/v1/components/{asset}/faults/{code}", tag = "sovd",
    operation_id = "sovd_clear_fault",
    params(("asset" = String, description = "Name of the asset"),
        ("code" = CodeWord, description = "Fault code")),
    responses((status = 204), (status = 404, body = Problem)))]
pub(super) async fn clear(
    State(service): State<Service>,
    AssetItemPath(asset, code): AssetItemPath,
    Extension(caller): Extension<Caller>,
) -> Result<StatusCode, Problem> {
    service.clear(&asset, &code, actor(&caller)).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Clears all faults of a rig. The recordings and the history are kept.
#[utoipa::path(delete, path = "/v1/components/{asset}/faults", tag = "sovd",
    operation_id = "sovd_clear_faults",
    params(("asset" = String, description = "Name of the asset")),
    responses((status = 204), (status = 404, body = Problem)))]
pub(super) async fn clear_all(
    State(service): State<Service>,
    AssetPath(asset): AssetPath,
    Extension(caller): Extension<Caller>,
) -> Result<StatusCode, Problem> {
    let page = service.asset_faults(&asset, Some(StatusFilter::All)).await?;
    for entry in page.items {
        service.clear(&asset, entry.record.code.as_str(), actor(&caller)).await?;
    }
    Ok(StatusCode::NO_CONTENT)
}

#[cfg(test)]
mod tests {
    use super::status_pairs;

    #[test]
    fn a_status_that_does_not_exist_is_refused_whatever_is_on_record() {
        for query in ["status[colour]=1", "status[testFailed]=2", "status[mask]=x", "status=1"] {
            assert!(status_pairs(Some(query)).is_err(), "{query}");
        }
        let pairs = status_pairs(Some("status%5BtestFailed%5D=1&severity=2")).unwrap();
        assert_eq!(pairs, [("testFailed".to_owned(), "1".to_owned())]);
    }
}
