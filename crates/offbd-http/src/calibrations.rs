//! `/assets/{asset}/calibrations`: calibrating a rig from chosen sessions.

use axum::extract::State;
use axum::http::StatusCode;
use axum::http::header::LOCATION;
use axum::response::IntoResponse;
use axum::{Extension, Json};
use serde::Deserialize;
use utoipa::ToSchema;

use super::faults::ActorQuery;
use super::json_body::JsonBody;
use super::{App, AssetItemPath, AssetPath, PageQuery, Problem, Query, page_limit};
use offbd_service::Service;
use offbd_service::access::Caller;
use offbd_wire::service::{CalibrationJobView, Page, TrainingDataView};

/// The sessions to calibrate from.
#[derive(Debug, Default, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct NewCalibration {
    /// 1 to 32 healthy sessions of the asset, or stretches of them.
    sessions: Vec<TrainingDataView>,
}

/// Starts a background job that calibrates the rig from healthy sessions. Its state and result are
/// at `Location`. The result is used once it is activated.
#[utoipa::path(post, path = "/assets/{asset}/calibrations", tag = "assets",
    operation_id = "calibrate",
    params(("asset" = String, description = "Name of the asset"), ActorQuery),
    request_body = NewCalibration,
    responses(
        (status = 202, body = CalibrationJobView, headers(("Location"))),
        (status = 400, body = Problem), (status = 404, body = Problem),
        (status = 422, body = Problem), (status = 429, body = Problem)))]
pub(super) async fn create(
    State(app): State<App>,
    AssetPath(asset): AssetPath,
    Query(query): Query<ActorQuery>,
    Extension(caller): Extension<Caller>,
    JsonBody(request): JsonBody<NewCalibration>,
) -> Result<impl IntoResponse, Problem> {
    let by = query.known_actor(&caller);
    let job = app.service.calibrate(&asset, request.sessions, by).await?;
    let location = format!("/api/v1/assets/{asset}/calibrations/{}", job.id);
    Ok((StatusCode::ACCEPTED, [(LOCATION, location)], Json(job)))
}

/// Lists the calibrations, newest first. Those that wait, run or have failed are listed too.
#[utoipa::path(get, path = "/assets/{asset}/calibrations", tag = "assets",
    operation_id = "list_calibrations",
    params(("asset" = String, description = "Name of the asset"), PageQuery),
    responses((status = 200, body = Page<CalibrationJobView>), (status = 404, body = Problem)))]
pub(super) async fn list(
    State(service): State<Service>,
    AssetPath(asset): AssetPath,
    Query(page): Query<PageQuery>,
) -> Result<Json<Page<CalibrationJobView>>, Problem> {
    let limit = page_limit(page.limit);
    Ok(Json(service.calibrations(&asset, page.cursor.as_deref(), limit).await?))
}

/// Returns a calibration: its state, and its result or the reason why it failed. A result holds
/// the parameters, how far they can be trusted, and which faults it can detect after what time.
#[utoipa::path(get, path = "/assets/{asset}/calibrations/{id}", tag = "assets",
    operation_id = "get_calibration",
    params(("asset" = String, description = "Name of the asset"),
        ("id" = String, description = "Id of the calibration")),
    responses((status = 200, body = CalibrationJobView), (status = 404, body = Problem)))]
pub(super) async fn get(
    State(service): State<Service>,
    AssetItemPath(asset, id): AssetItemPath,
) -> Result<Json<CalibrationJobView>, Problem> {
    Ok(Json(service.calibration(&asset, &id).await?))
}

/// Writes a calibration to the asset file. An open session keeps the calibration that it
/// started with; the next session uses the new one.
#[utoipa::path(post, path = "/assets/{asset}/calibrations/{id}/activate", tag = "assets",
    operation_id = "activate_calibration",
    params(("asset" = String, description = "Name of the asset"),
        ("id" = String, description = "Id of the calibration"), ActorQuery),
    responses((status = 200, body = CalibrationJobView), (status = 404, body = Problem),
        (status = 409, body = Problem, description = "The calibration is not done")))]
pub(super) async fn activate(
    State(service): State<Service>,
    AssetItemPath(asset, id): AssetItemPath,
    Query(query): Query<ActorQuery>,
    Extension(caller): Extension<Caller>,
) -> Result<Json<CalibrationJobView>, Problem> {
    let by = query.known_actor(&caller);
    Ok(Json(service.activate_calibration(&asset, &id, by).await?))
}

/// Cancels a calibration that waits or runs. It fails; one that runs may take a moment to stop.
/// A rig that learns by itself tries again once it has shown half as much motion again.
#[utoipa::path(post, path = "/assets/{asset}/calibrations/{id}/cancel", tag = "assets",
    operation_id = "cancel_calibration",
    params(("asset" = String, description = "Name of the asset"),
        ("id" = String, description = "Id of the calibration")),
    responses((status = 200, body = CalibrationJobView), (status = 404, body = Problem),
        (status = 409, body = Problem, description = "The calibration neither waits nor runs")))]
pub(super) async fn cancel(
    State(service): State<Service>,
    AssetItemPath(asset, id): AssetItemPath,
) -> Result<Json<CalibrationJobView>, Problem> {
    Ok(Json(service.cancel_calibration(&asset, &id).await?))
}
