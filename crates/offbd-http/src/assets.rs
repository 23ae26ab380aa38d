//! `/assets`: the asset registry, twin states, trends.

use axum::Json;
use axum::body::Body;
use axum::extract::State;
use axum::http::header::LOCATION;
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;

use super::edition::{IfMatch, IfNoneMatch, tagged};
use super::layers::record_asset;
use super::{App, AssetPath, Problem, Query, json_body, page_limit};
use offbd_service::Service;
use offbd_wire::asset::AssetView;
use offbd_wire::link::LinkView;
use offbd_wire::service::{Page, StateView};
use offbd_wire::trend::TrendsView;

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct AssetsQuery {
    /// Only assets whose name begins with this.
    name: Option<String>,
    /// `next` of the previous page.
    cursor: Option<String>,
    /// Items per page, 1 to 500; 50 by default.
    #[param(format = Int32, minimum = 1, maximum = 500)]
    limit: Option<u32>,
}

/// Size limit of an asset file, bytes.
pub(super) const MAX_ASSET_BYTES: usize = 64 << 10;

/// Lists the assets by name. Each item is an asset file with all defaults.
#[utoipa::path(get, path = "/assets", tag = "assets", operation_id = "list_assets",
    params(AssetsQuery),
    responses((status = 200, body = Page<AssetView>), (status = 400, body = Problem)))]
pub(super) async fn list(
    State(service): State<Service>,
    Query(AssetsQuery { name, cursor, limit }): Query<AssetsQuery>,
) -> Result<Json<Page<AssetView>>, Problem> {
    Ok(Json(service.assets(name, cursor.as_deref(), page_limit(limit)).await?))
}

/// Registers an asset; the body is its asset file. If the name is taken, nothing is changed and
/// the response is 409; use PUT to replace an asset file.
#[utoipa::path(post, path = "/assets", tag = "assets", operation_id = "create_asset",
    request_body = AssetView, responses(
        (status = 201, body = AssetView, headers(("ETag"), ("Location"))),
        (status = 400, body = Problem,
            description = "Malformed asset file; `pointer` names the element"),
        (status = 409, body = Problem, description = "An asset of this name exists"),
        (status = 422, body = Problem, description = "Invalid value; `pointer` names the element"),
        (status = 507, body = Problem, description = "The limit of assets is reached")))]
pub(super) async fn create(
    State(app): State<App>,
    headers: HeaderMap,
    body: Body,
) -> Result<impl IntoResponse, Problem> {
    let document = json_body::read(&app, &headers, body, MAX_ASSET_BYTES).await?;
    let made = app.service.create_asset(&document).await?;
    record_asset(&made.value.name);
    let location = format!("/api/v1/assets/{}", made.value.name);
    Ok((StatusCode::CREATED, [(LOCATION, location)], tagged(made)))
}

/// Returns the asset file with all defaults filled in. It includes the active calibration.
/// `If-None-Match` with its `ETag` saves sending it again.
#[utoipa::path(get, path = "/assets/{asset}", tag = "assets", operation_id = "get_asset",
    params(("asset" = String, description = "Name of the asset")),
    responses((status = 200, body = AssetView, headers(("ETag"))),
        (status = 404, body = Problem)))]
pub(super) async fn get(
    State(service): State<Service>,
    AssetPath(asset): AssetPath,
    known: IfNoneMatch,
) -> Result<Response, Problem> {
    Ok(known.answer(tagged(service.asset_edition(&asset).await?)))
}

/// Replaces the asset file, or registers the asset. An open session keeps the asset file
/// that it started with; the next session uses the new one.
#[utoipa::path(put, path = "/assets/{asset}", tag = "assets", operation_id = "put_asset",
    params(("asset" = String, description = "Name of the asset"),
        ("If-Match" = Option<String>, Header), ("If-None-Match" = Option<String>, Header)),
    request_body = AssetView,
    responses((status = 200, body = AssetView, headers(("ETag"))),
        (status = 201, body = AssetView, headers(("ETag"))),
        (status = 400, body = Problem),
        (status = 422, body = Problem)))]
pub(super) async fn put(
    State(app): State<App>,
    AssetPath(asset): AssetPath,
    IfMatch(expected): IfMatch,
    headers: HeaderMap,
    body: Body,
) -> Result<impl IntoResponse, Problem> {
    let document = json_body::read(&app, &headers, body, MAX_ASSET_BYTES).await?;
    let (edition, created) = app.service.put_asset(&asset, &document, &expected).await?;
    Ok((if created { StatusCode::CREATED } else { StatusCode::OK }, tagged(edition)))
}

/// Deletes an asset with its sessions, recordings and faults. The asset is hidden
/// immediately; the response is sent when all its data are deleted. A deletion that takes
/// longer than 60 s is answered with 503 and continues. Creating an asset of the same name
/// before it has finished gets 429.
#[utoipa::path(delete, path = "/assets/{asset}", tag = "assets", operation_id = "delete_asset",
    params(("asset" = String, description = "Name of the asset"),
        ("If-Match" = Option<String>, Header)),
    responses((status = 204), (status = 404, body = Problem)))]
pub(super) async fn delete(
    State(service): State<Service>,
    AssetPath(asset): AssetPath,
    IfMatch(expected): IfMatch,
) -> Result<StatusCode, Problem> {
    service.delete_asset(&asset, expected).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Returns the state of rig and twin after the last evaluated sample: accelerations, residual,
/// limit, gate, fidelity, and the readiness of each monitor. Without an open session `session` is
/// null, and the twin is at rest.
#[utoipa::path(get, path = "/assets/{asset}/state", tag = "assets", operation_id = "get_state",
    params(("asset" = String, description = "Name of the asset")),
    responses((status = 200, body = StateView), (status = 404, body = Problem)))]
pub(super) async fn state(
    State(service): State<Service>,
    AssetPath(asset): AssetPath,
) -> Result<Json<StateView>, Problem> {
    Ok(Json(service.state(&asset).await?))
}

/// Returns how the samples of a rig arrive, in its session and in the last minutes: rate and
/// spacing on the device's clock, gaps, the delay of batches, rows sent twice, rows that are not
/// judged and why, and how far the device's clock is from that of the service. The numbers are
/// kept in memory: they begin at zero when the asset is loaded, and no verdict depends on them.
#[utoipa::path(get, path = "/assets/{asset}/link", tag = "assets", operation_id = "get_link",
    params(("asset" = String, description = "Name of the asset")),
    responses((status = 200, body = LinkView), (status = 404, body = Problem)))]
pub(super) async fn link(
    State(service): State<Service>,
    AssetPath(asset): AssetPath,
) -> Result<Json<LinkView>, Problem> {
    Ok(Json(service.link(&asset).await?))
}

/// Returns the drift of both servos over the sessions: the estimates of each session,
/// the fitted line with its confidence, the limits, and a warning if the line is going
/// to exceed one. A session is included once it has ended.
#[utoipa::path(get, path = "/assets/{asset}/trends", tag = "assets", operation_id = "get_trends",
    params(("asset" = String, description = "Name of the asset")),
    responses((status = 200, body = TrendsView), (status = 404, body = Problem)))]
pub(super) async fn trends(
    State(service): State<Service>,
    AssetPath(asset): AssetPath,
) -> Result<Json<TrendsView>, Problem> {
    Ok(Json(service.trends(&asset).await?))
}
