//! `/faults` and `/assets/{asset}/faults`: the fault memory of the fleet and of an asset.

use axum::extract::State;
use axum::http::header::CONTENT_TYPE;
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use axum::{Extension, Json};
use serde::Deserialize;

use super::{
    AssetItemPath, AssetPath, PageQuery, Problem, Query, page_limit, query_word, session_format,
};
use offbd_service::access::Caller;
use offbd_service::{FaultQuery, RecordingWindow, Service};
use offbd_wire::recording::{RecordingColumnsView, RecordingView, write_csv};
use offbd_wire::service::{FaultEntryView, HistoryView, Page};
use offbd_wire::session_file::SessionFormat;
use offbd_wire::words::{CodeWord, FaultSort, StatusFilter};

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct StatusQuery {
    /// `active` (pending or confirmed) by default.
    #[param(inline, value_type = Option<StatusFilter>)]
    status: Option<String>,
}

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct FleetFaultsQuery {
    /// `active` (pending or confirmed) by default.
    #[param(inline, value_type = Option<StatusFilter>)]
    status: Option<String>,
    asset: Option<String>,
    #[param(value_type = Option<CodeWord>)]
    code: Option<String>,
    acknowledged: Option<bool>,
    /// `-changed_at` (the latest change first) by default.
    #[param(inline, value_type = Option<FaultSort>)]
    sort: Option<String>,
    /// `next` of the previous page, which must have the same `sort`.
    cursor: Option<String>,
    /// Items per page, 1 to 500; 50 by default.
    #[param(format = Int32, minimum = 1, maximum = 500)]
    limit: Option<u32>,
}

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct ActorQuery {
    /// Name of the person, stored with the action. Ignored if the request has a token,
    /// whose name is stored instead.
    by: Option<String>,
}

/// Longest stored name of a person, bytes; a longer one is truncated.
const MAX_ACTOR: usize = 100;

impl ActorQuery {
    pub(super) fn actor(self, caller: &Caller) -> String {
        self.known_actor(caller).unwrap_or_else(|| "unknown".to_owned())
    }

    /// Like [`Self::actor`]; `None` if the request names nobody.
    pub(super) fn known_actor(self, caller: &Caller) -> Option<String> {
        let mut actor = caller.name().map(str::to_owned).or(self.by)?;
        while actor.len() > MAX_ACTOR {
            actor.pop();
        }
        Some(actor)
    }
}

/// Lists the fault memory of an asset. By default only active faults: pending or confirmed ones.
/// All are in one page.
#[utoipa::path(get, path = "/assets/{asset}/faults", tag = "faults",
    operation_id = "list_asset_faults",
    params(("asset" = String, description = "Name of the asset"), StatusQuery),
    responses((status = 200, body = Page<FaultEntryView>), (status = 400, body = Problem),
        (status = 404, body = Problem)))]
pub(super) async fn of_asset(
    State(service): State<Service>,
    AssetPath(asset): AssetPath,
    Query(query): Query<StatusQuery>,
) -> Result<Json<Page<FaultEntryView>>, Problem> {
    let status = query_word("?status", query.status.as_deref())?;
    Ok(Json(service.asset_faults(&asset, status).await?))
}

/// Returns the fault memory entry of one code. It has the status byte of ISO 14229, the evidence
/// at the first failure, counters and times.
#[utoipa::path(get, path = "/assets/{asset}/faults/{code}", tag = "faults",
    operation_id = "get_fault",
    params(("asset" = String, description = "Name of the asset"),
        ("code" = CodeWord, description = "Fault code")),
    responses((status = 200, body = FaultEntryView), (status = 404, body = Problem)))]
pub(super) async fn get(
    State(service): State<Service>,
    AssetItemPath(asset, code): AssetItemPath,
) -> Result<Json<FaultEntryView>, Problem> {
    Ok(Json(service.fault(&asset, &code).await?))
}

/// Clears a code: erases its fault memory entry. The recordings of the sessions and the history of
/// the code are kept. A fault that is still there is found again.
#[utoipa::path(delete, path = "/assets/{asset}/faults/{code}", tag = "faults",
    operation_id = "clear_fault",
    params(("asset" = String, description = "Name of the asset"),
        ("code" = CodeWord, description = "Fault code"),
        ActorQuery),
    responses((status = 204), (status = 404, body = Problem)))]
pub(super) async fn clear(
    State(service): State<Service>,
    AssetItemPath(asset, code): AssetItemPath,
    Query(query): Query<ActorQuery>,
    Extension(caller): Extension<Caller>,
) -> Result<StatusCode, Problem> {
    service.clear(&asset, &code, query.actor(&caller)).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Acknowledges the current occurrence of a code. An acknowledged fault stays on record; its next
/// occurrence needs another acknowledgement.
#[utoipa::path(post, path = "/assets/{asset}/faults/{code}/acknowledge", tag = "faults",
    operation_id = "acknowledge_fault",
    params(("asset" = String, description = "Name of the asset"),
        ("code" = CodeWord, description = "Fault code"),
        ActorQuery),
    responses((status = 200, body = FaultEntryView), (status = 404, body = Problem),
        (status = 409, body = Problem, description = "No current occurrence")))]
pub(super) async fn acknowledge(
    State(service): State<Service>,
    AssetItemPath(asset, code): AssetItemPath,
    Query(query): Query<ActorQuery>,
    Extension(caller): Extension<Caller>,
) -> Result<Json<FaultEntryView>, Problem> {
    Ok(Json(service.acknowledge(&asset, &code, query.actor(&caller)).await?))
}

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct WindowQuery {
    /// Time before the onset, s, 0 to 60; 10 by default.
    #[param(minimum = 0, maximum = 60)]
    before_s: Option<f64>,
    /// Time after the confirmation, or after the failure if it was not confirmed, s, 0 to
    /// 60; 10 by default.
    #[param(minimum = 0, maximum = 60)]
    after_s: Option<f64>,
}

/// Default time before the onset and after the confirmation, s.
const DEFAULT_WINDOW_S: f64 = 10.0;

/// Returns the telemetry around the last occurrence of a fault, with measured and twin
/// acceleration, residual, limit and gate. To compute them, the service evaluates the
/// recording again from the start of its session (at most 10 million samples, two
/// recordings at a time). JSON columns, or CSV if `Accept` prefers `text/csv`. Available
/// until the session is deleted, by request or by retention.
#[utoipa::path(get, path = "/assets/{asset}/faults/{code}/recording", tag = "faults",
    operation_id = "get_fault_recording",
    params(("asset" = String, description = "Name of the asset"),
        ("code" = CodeWord, description = "Fault code"),
        WindowQuery),
    responses((status = 200, content((RecordingView = "application/json"),
            (String = "text/csv"))),
        (status = 400, body = Problem), (status = 404, body = Problem),
        (status = 406, body = Problem),
        (status = 413, body = Problem,
            description = "Too many samples before the fault, or in the window"),
        (status = 429, body = Problem)))]
pub(super) async fn recording(
    State(service): State<Service>,
    AssetItemPath(asset, code): AssetItemPath,
    Query(query): Query<WindowQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let format = session_format::negotiate(&headers, &session_format::TABLES, SessionFormat::Json)?;
    let window = RecordingWindow {
        before_s: query.before_s.unwrap_or(DEFAULT_WINDOW_S),
        after_s: query.after_s.unwrap_or(DEFAULT_WINDOW_S),
    };
    let (mut view, rows) = service.fault_recording(&asset, &code, window).await?;
    if format == SessionFormat::Json {
        view.columns = RecordingColumnsView::of(&rows);
        return Ok(Json(view).into_response());
    }
    let mut text = Vec::new();
    // Writing to a vector cannot fail.
    let _ = write_csv(&mut text, &rows);
    Ok(([(CONTENT_TYPE, session_format::content_type(format))], text).into_response())
}

/// Lists the history of a code, newest first: its transitions, and who acknowledged or cleared it.
/// It is kept when the code is cleared.
#[utoipa::path(get, path = "/assets/{asset}/faults/{code}/history", tag = "faults",
    operation_id = "get_fault_history",
    params(("asset" = String, description = "Name of the asset"),
        ("code" = CodeWord, description = "Fault code"),
        PageQuery),
    responses((status = 200, body = Page<HistoryView>), (status = 400, body = Problem),
        (status = 404, body = Problem)))]
pub(super) async fn history(
    State(service): State<Service>,
    AssetItemPath(asset, code): AssetItemPath,
    Query(page): Query<PageQuery>,
) -> Result<Json<Page<HistoryView>>, Problem> {
    let limit = page_limit(page.limit);
    Ok(Json(service.history(&asset, &code, page.cursor.as_deref(), limit).await?))
}

/// Lists the faults of the fleet. By default only active faults: pending or confirmed ones. The
/// other parameters select by asset, code and acknowledgement, and sort.
#[utoipa::path(get, path = "/faults", tag = "faults", operation_id = "list_faults",
    params(FleetFaultsQuery),
    responses((status = 200, body = Page<FaultEntryView>), (status = 400, body = Problem),
        (status = 404, body = Problem, description = "No such asset or code")))]
pub(super) async fn of_fleet(
    State(service): State<Service>,
    Query(query): Query<FleetFaultsQuery>,
) -> Result<Json<Page<FaultEntryView>>, Problem> {
    let FleetFaultsQuery { status, asset, code, acknowledged, sort, cursor, limit } = query;
    let status = query_word("?status", status.as_deref())?;
    let sort = query_word("?sort", sort.as_deref())?;
    let query = FaultQuery { status, asset, code, acknowledged, sort, cursor };
    Ok(Json(service.faults(query, page_limit(limit)).await?))
}
