//! Fault memory: of one asset and across the fleet.

use axum::extract::State;
use axum::http::header::CONTENT_TYPE;
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use axum::{Extension, Json};
use serde::Deserialize;

use super::sessions::Form;
use super::{Asset, OfAsset, PageQuery, Problem, Query, page_limit};
use crate::service::access::Caller;
use crate::service::{Around, FaultQuery, Service};
use crate::wire::recording::{ColumnsView, RecordingView, write_csv};
use crate::wire::service::{FaultEntryView, HistoryView, Page};

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct StatusQuery {
    /// `active` (pending or confirmed; the default), `pending`, `confirmed`,
    /// `healed`, `cleared` or `all`.
    #[param(pattern = "^(active|pending|confirmed|healed|cleared|all)$")]
    status: Option<String>,
}

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct FleetQuery {
    /// `active` (pending or confirmed; the default), `pending`, `confirmed`,
    /// `healed`, `cleared` or `all`.
    #[param(pattern = "^(active|pending|confirmed|healed|cleared|all)$")]
    status: Option<String>,
    asset: Option<String>,
    code: Option<String>,
    acknowledged: Option<bool>,
    /// `-changed_at` (the default), `changed_at` or `asset`.
    #[param(pattern = "^(-changed_at|changed_at|asset)$")]
    sort: Option<String>,
    /// `next` of the page before; with the same `sort`.
    cursor: Option<String>,
    /// Items on the page, brought into 1 to 500; 50 without it.
    #[param(format = Int64, maximum = 4_294_967_295_u32)]
    limit: Option<u32>,
}

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct ActorQuery {
    /// Who does it; kept with the act. With a token it is the token's name.
    by: Option<String>,
}

/// Longest name of who did it, bytes; a longer one is cut.
const MAX_ACTOR: usize = 100;

impl ActorQuery {
    fn actor(self, caller: &Caller) -> String {
        let known = caller.name().map(str::to_owned).or(self.by);
        let mut actor = known.unwrap_or_else(|| "unknown".to_owned());
        while actor.len() > MAX_ACTOR {
            actor.pop();
        }
        actor
    }
}

/// The fault memory of an asset.
#[utoipa::path(get, path = "/assets/{asset}/faults", tag = "faults",
    operation_id = "list_asset_faults",
    params(("asset" = String, description = "Name of the asset"), StatusQuery),
    responses((status = 200, body = Page<FaultEntryView>), (status = 400, body = Problem),
        (status = 404, body = Problem)))]
pub(super) async fn of_asset(
    State(service): State<Service>,
    Asset(asset): Asset,
    Query(query): Query<StatusQuery>,
) -> Result<Json<Page<FaultEntryView>>, Problem> {
    Ok(Json(service.asset_faults(&asset, query.status).await?))
}

/// What is remembered of one code.
#[utoipa::path(get, path = "/assets/{asset}/faults/{code}", tag = "faults",
    operation_id = "get_fault",
    params(("asset" = String, description = "Name of the asset"), ("code" = String, description = "Fault code")),
    responses((status = 200, body = FaultEntryView), (status = 404, body = Problem)))]
pub(super) async fn get(
    State(service): State<Service>,
    OfAsset(asset, code): OfAsset,
) -> Result<Json<FaultEntryView>, Problem> {
    Ok(Json(service.fault(&asset, &code).await?))
}

/// Clears a code: everything stored of it is erased.
#[utoipa::path(delete, path = "/assets/{asset}/faults/{code}", tag = "faults",
    operation_id = "clear_fault",
    params(("asset" = String, description = "Name of the asset"), ("code" = String, description = "Fault code"),
        ActorQuery),
    responses((status = 204), (status = 404, body = Problem)))]
pub(super) async fn clear(
    State(service): State<Service>,
    OfAsset(asset, code): OfAsset,
    Query(query): Query<ActorQuery>,
    Extension(caller): Extension<Caller>,
) -> Result<StatusCode, Problem> {
    service.clear(&asset, &code, query.actor(&caller)).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Acknowledges the current occurrence of a code.
#[utoipa::path(post, path = "/assets/{asset}/faults/{code}/acknowledge", tag = "faults",
    operation_id = "acknowledge_fault",
    params(("asset" = String, description = "Name of the asset"), ("code" = String, description = "Fault code"),
        ActorQuery),
    responses((status = 200, body = FaultEntryView), (status = 404, body = Problem),
        (status = 409, body = Problem, description = "There is no occurrence")))]
pub(super) async fn acknowledge(
    State(service): State<Service>,
    OfAsset(asset, code): OfAsset,
    Query(query): Query<ActorQuery>,
    Extension(caller): Extension<Caller>,
) -> Result<Json<FaultEntryView>, Problem> {
    Ok(Json(service.acknowledge(&asset, &code, query.actor(&caller)).await?))
}

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct AroundQuery {
    /// Seconds before the onset, 0 to 60; 10 without it.
    #[param(minimum = 0, maximum = 60)]
    before_s: Option<f64>,
    /// Seconds after the confirmation (or the failure that was none), 0 to 60;
    /// 10 without it.
    #[param(minimum = 0, maximum = 60)]
    after_s: Option<f64>,
}

/// Seconds on either side where none are asked for.
const AROUND_S: f64 = 10.0;

/// The seconds before and after the last occurrence of a fault: what the device
/// sent, and beside it measured and twin acceleration, residual, limit and
/// gate, for which the recording is judged again from the beginning of its
/// session (at most 10 million samples, two recordings at a time). JSON
/// columns, or CSV if `Accept` asks for `text/csv`. It is there for as long as
/// the session is, which nothing but `DELETE` removes.
#[utoipa::path(get, path = "/assets/{asset}/faults/{code}/recording", tag = "faults",
    operation_id = "get_fault_recording",
    params(("asset" = String, description = "Name of the asset"), ("code" = String, description = "Fault code"),
        AroundQuery),
    responses((status = 200, content((RecordingView = "application/json"),
            (String = "text/csv"))),
        (status = 400, body = Problem), (status = 404, body = Problem),
        (status = 406, body = Problem),
        (status = 413, body = Problem, description = "Too far into its session"),
        (status = 429, body = Problem)))]
pub(super) async fn recording(
    State(service): State<Service>,
    OfAsset(asset, code): OfAsset,
    Query(query): Query<AroundQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let form = Form::wanted(&headers, Form::Json)?;
    let around = Around {
        before_s: query.before_s.unwrap_or(AROUND_S),
        after_s: query.after_s.unwrap_or(AROUND_S),
    };
    let (mut view, rows) = service.fault_recording(&asset, &code, around).await?;
    if form == Form::Json {
        view.columns = ColumnsView::of(&rows);
        return Ok(Json(view).into_response());
    }
    let mut text = Vec::new();
    // A vector takes everything that is written to it.
    let _ = write_csv(&mut text, &rows);
    Ok(([(CONTENT_TYPE, form.kind())], text).into_response())
}

/// What happened to a code, newest first: its changes of status, and who
/// acknowledged or cleared it.
#[utoipa::path(get, path = "/assets/{asset}/faults/{code}/history", tag = "faults",
    operation_id = "get_fault_history",
    params(("asset" = String, description = "Name of the asset"), ("code" = String, description = "Fault code"),
        PageQuery),
    responses((status = 200, body = Page<HistoryView>), (status = 400, body = Problem),
        (status = 404, body = Problem)))]
pub(super) async fn history(
    State(service): State<Service>,
    OfAsset(asset, code): OfAsset,
    Query(page): Query<PageQuery>,
) -> Result<Json<Page<HistoryView>>, Problem> {
    let limit = page_limit(page.limit);
    Ok(Json(service.history(&asset, &code, page.cursor.as_deref(), limit).await?))
}

/// Faults across the fleet.
#[utoipa::path(get, path = "/faults", tag = "faults", operation_id = "list_faults",
    params(FleetQuery),
    responses((status = 200, body = Page<FaultEntryView>), (status = 400, body = Problem),
        (status = 404, body = Problem, description = "No such asset or code")))]
pub(super) async fn of_fleet(
    State(service): State<Service>,
    Query(query): Query<FleetQuery>,
) -> Result<Json<Page<FaultEntryView>>, Problem> {
    let FleetQuery { status, asset, code, acknowledged, sort, cursor, limit } = query;
    let query = FaultQuery { status, asset, code, acknowledged, sort, cursor };
    Ok(Json(service.faults(query, page_limit(limit)).await?))
}
