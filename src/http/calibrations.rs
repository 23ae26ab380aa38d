//! `/assets/{asset}/calibrations`: learning a rig from its sessions.

use axum::Json;
use axum::body::Body;
use axum::extract::State;
use axum::http::StatusCode;
use axum::http::header::LOCATION;
use axum::response::IntoResponse;
use serde::Deserialize;
use utoipa::ToSchema;

use super::sessions::small;
use super::{App, Asset, OfAsset, PageQuery, Problem, Query, page_limit};
use crate::service::Service;
use crate::wire::service::{CalibrationJobView, Page};

/// From what to learn.
#[derive(Debug, Default, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct NewCalibration {
    /// The service's ids of healthy sessions of the asset, 1 to 32.
    sessions: Vec<String>,
}

/// Learns the rig from healthy sessions of it, in the background.
#[utoipa::path(post, path = "/assets/{asset}/calibrations", tag = "assets",
    operation_id = "calibrate", params(("asset" = String, description = "Name of the asset")),
    request_body = NewCalibration,
    responses((status = 202, body = CalibrationJobView, description = "`Location` says where to look"),
        (status = 400, body = Problem), (status = 404, body = Problem),
        (status = 422, body = Problem), (status = 429, body = Problem)))]
pub(super) async fn create(
    State(app): State<App>,
    Asset(asset): Asset,
    body: Body,
) -> Result<impl IntoResponse, Problem> {
    let wanted: NewCalibration = small(&app, body).await?;
    let job = app.service.calibrate(&asset, wanted.sessions).await?;
    let location = format!("/api/v1/assets/{asset}/calibrations/{}", job.id);
    Ok((StatusCode::ACCEPTED, [(LOCATION, location)], Json(job)))
}

/// Lists the calibrations, newest first.
#[utoipa::path(get, path = "/assets/{asset}/calibrations", tag = "assets",
    operation_id = "list_calibrations",
    params(("asset" = String, description = "Name of the asset"), PageQuery),
    responses((status = 200, body = Page<CalibrationJobView>), (status = 404, body = Problem)))]
pub(super) async fn list(
    State(service): State<Service>,
    Asset(asset): Asset,
    Query(page): Query<PageQuery>,
) -> Result<Json<Page<CalibrationJobView>>, Problem> {
    let limit = page_limit(page.limit);
    Ok(Json(service.calibrations(&asset, page.cursor.as_deref(), limit).await?))
}

/// A calibration: where it stands, what was learnt, or what the data lack.
#[utoipa::path(get, path = "/assets/{asset}/calibrations/{id}", tag = "assets",
    operation_id = "get_calibration",
    params(("asset" = String, description = "Name of the asset"), ("id" = String, description = "Its id")),
    responses((status = 200, body = CalibrationJobView), (status = 404, body = Problem)))]
pub(super) async fn get(
    State(service): State<Service>,
    OfAsset(asset, id): OfAsset,
) -> Result<Json<CalibrationJobView>, Problem> {
    Ok(Json(service.calibration(&asset, &id).await?))
}

/// Puts a calibration into the asset file. An open session goes on with what
/// it began with; the next session uses it.
#[utoipa::path(post, path = "/assets/{asset}/calibrations/{id}/activate", tag = "assets",
    operation_id = "activate_calibration",
    params(("asset" = String, description = "Name of the asset"), ("id" = String, description = "Its id")),
    responses((status = 200, body = CalibrationJobView), (status = 404, body = Problem),
        (status = 409, body = Problem, description = "It is not done")))]
pub(super) async fn activate(
    State(service): State<Service>,
    OfAsset(asset, id): OfAsset,
) -> Result<Json<CalibrationJobView>, Problem> {
    Ok(Json(service.activate_calibration(&asset, &id).await?))
}
