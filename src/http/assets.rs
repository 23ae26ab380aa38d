//! `/assets`: the registry, and the state of a twin.

use axum::Json;
use axum::body::Body;
use axum::extract::State;
use axum::http::StatusCode;
use axum::http::header::LOCATION;
use axum::response::IntoResponse;

use super::layers::about;
use super::{App, Asset, PageQuery, Problem, Query, body, page_limit};
use crate::service::Service;
use crate::wire::asset::AssetView;
use crate::wire::service::{FleetEntryView, Page, StateView};
use crate::wire::trend::TrendsView;

/// Longest asset file, bytes; a longer one is refused.
const MAX_ASSET_BYTES: usize = 64 << 10;

async fn document(app: &App, body: Body) -> Result<Vec<u8>, Problem> {
    let time = app.service.limits().body_timeout;
    Ok(body::read(body, MAX_ASSET_BYTES, time, &app.budget).await?.bytes)
}

/// Lists the assets by name.
#[utoipa::path(get, path = "/assets", tag = "assets", operation_id = "list_assets",
    params(PageQuery), responses((status = 200, body = Page<AssetView>), (status = 400, body = Problem)))]
pub(super) async fn list(
    State(service): State<Service>,
    Query(page): Query<PageQuery>,
) -> Result<Json<Page<AssetView>>, Problem> {
    Ok(Json(service.assets(page.cursor.as_deref(), page_limit(page.limit)).await?))
}

/// Registers an asset; the body is its asset file.
#[utoipa::path(post, path = "/assets", tag = "assets", operation_id = "create_asset",
    request_body = AssetView, responses(
        (status = 201, body = AssetView, description = "Registered; `Location` has its address"),
        (status = 400, body = Problem, description = "Not an asset file; `pointer` names the place"),
        (status = 409, body = Problem, description = "The name is taken"),
        (status = 422, body = Problem, description = "An element cannot be; `pointer` names it"),
        (status = 507, body = Problem, description = "The registry is full")))]
pub(super) async fn create(
    State(app): State<App>,
    body: Body,
) -> Result<impl IntoResponse, Problem> {
    let view = app.service.create_asset(&document(&app, body).await?).await?;
    about(&view.name);
    let location = format!("/api/v1/assets/{}", view.name);
    Ok((StatusCode::CREATED, [(LOCATION, location)], Json(view)))
}

/// The asset file, with every default filled in.
#[utoipa::path(get, path = "/assets/{asset}", tag = "assets", operation_id = "get_asset",
    params(("asset" = String, description = "Name of the asset")),
    responses((status = 200, body = AssetView), (status = 404, body = Problem)))]
pub(super) async fn get(
    State(service): State<Service>,
    Asset(asset): Asset,
) -> Result<Json<AssetView>, Problem> {
    Ok(Json(service.asset(&asset).await?))
}

/// Replaces the asset file, or registers the asset. An open session goes on
/// with what it began with; the next session uses the new file.
#[utoipa::path(put, path = "/assets/{asset}", tag = "assets", operation_id = "put_asset",
    params(("asset" = String, description = "Name of the asset")), request_body = AssetView,
    responses((status = 200, body = AssetView), (status = 201, body = AssetView),
        (status = 400, body = Problem), (status = 422, body = Problem)))]
pub(super) async fn put(
    State(app): State<App>,
    Asset(asset): Asset,
    body: Body,
) -> Result<impl IntoResponse, Problem> {
    let (view, new) = app.service.put_asset(&asset, &document(&app, body).await?).await?;
    Ok((if new { StatusCode::CREATED } else { StatusCode::OK }, Json(view)))
}

/// Deletes an asset with its sessions, recordings and faults. It is hidden at once; the
/// answer comes when all of it is gone. A deletion that takes longer than an answer may
/// is answered with 503 and goes on; until its end a new asset of the name gets 429.
#[utoipa::path(delete, path = "/assets/{asset}", tag = "assets", operation_id = "delete_asset",
    params(("asset" = String, description = "Name of the asset")),
    responses((status = 204), (status = 404, body = Problem)))]
pub(super) async fn delete(
    State(service): State<Service>,
    Asset(asset): Asset,
) -> Result<StatusCode, Problem> {
    service.delete_asset(&asset).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// The twin beside the rig after the last judged sample: accelerations,
/// residual, limit, gate, fidelity, and each monitor's readiness.
#[utoipa::path(get, path = "/assets/{asset}/state", tag = "assets", operation_id = "get_state",
    params(("asset" = String, description = "Name of the asset")),
    responses((status = 200, body = StateView), (status = 404, body = Problem)))]
pub(super) async fn state(
    State(service): State<Service>,
    Asset(asset): Asset,
) -> Result<Json<StateView>, Problem> {
    Ok(Json(service.state(&asset).await?))
}

/// Drift before fault: what the sessions estimated of both servos, the line
/// through it with its confidence, its limits, and a warning where it leads to
/// one. A session counts once it has ended.
#[utoipa::path(get, path = "/assets/{asset}/trends", tag = "assets", operation_id = "get_trends",
    params(("asset" = String, description = "Name of the asset")),
    responses((status = 200, body = TrendsView), (status = 404, body = Problem)))]
pub(super) async fn trends(
    State(service): State<Service>,
    Asset(asset): Asset,
) -> Result<Json<TrendsView>, Problem> {
    Ok(Json(service.trends(&asset).await?))
}

/// The fleet at a glance: for each asset, in the order of their names, its open
/// session, when it was last heard of, and its active faults.
#[utoipa::path(get, path = "/fleet", tag = "assets", operation_id = "get_fleet",
    params(PageQuery),
    responses((status = 200, body = Page<FleetEntryView>), (status = 400, body = Problem)))]
pub(super) async fn fleet(
    State(service): State<Service>,
    Query(page): Query<PageQuery>,
) -> Result<Json<Page<FleetEntryView>>, Problem> {
    Ok(Json(service.fleet(page.cursor.as_deref(), page_limit(page.limit)).await?))
}
