//! `/assets/{asset}/learning`: automatic calibration from the telemetry of a rig.

use axum::extract::State;
use axum::{Extension, Json};

use super::faults::ActorQuery;
use super::{AssetPath, Problem, Query};
use offbd_service::Service;
use offbd_service::access::Caller;
use offbd_wire::learning::LearningView;

/// Returns the progress of the automatic calibration: the motion gathered so far, what is missing,
/// the calibration that waits to be accepted, or the sessions it was learnt from. Samples that are
/// not stored yet are included if the asset is loaded.
#[utoipa::path(get, path = "/assets/{asset}/learning", tag = "assets",
    operation_id = "get_learning",
    params(("asset" = String, description = "Name of the asset")),
    responses((status = 200, body = LearningView), (status = 404, body = Problem)))]
pub(super) async fn get(
    State(service): State<Service>,
    AssetPath(asset): AssetPath,
) -> Result<Json<LearningView>, Problem> {
    Ok(Json(service.learning(&asset).await?))
}

/// Confirms that the rig was healthy and writes the offered calibration to the asset file.
/// An open session keeps the calibration that it started with; the next session uses the
/// new one. Later sessions without any finding refine it until it is based on five.
#[utoipa::path(post, path = "/assets/{asset}/learning/accept", tag = "assets",
    operation_id = "accept_learning",
    params(("asset" = String, description = "Name of the asset"), ActorQuery),
    responses((status = 200, body = LearningView), (status = 404, body = Problem),
        (status = 409, body = Problem, description = "No calibration is offered")))]
pub(super) async fn accept(
    State(service): State<Service>,
    AssetPath(asset): AssetPath,
    Query(query): Query<ActorQuery>,
    Extension(caller): Extension<Caller>,
) -> Result<Json<LearningView>, Problem> {
    Ok(Json(service.accept_learning(&asset, query.known_actor(&caller)).await?))
}

/// States that the rig was not healthy: discards the gathered motion, including that of
/// the open session, and starts again. The recordings are kept.
#[utoipa::path(post, path = "/assets/{asset}/learning/discard", tag = "assets",
    operation_id = "discard_learning",
    params(("asset" = String, description = "Name of the asset")),
    responses((status = 200, body = LearningView), (status = 404, body = Problem),
        (status = 409, body = Problem, description = "The rig is already calibrated")))]
pub(super) async fn discard(
    State(service): State<Service>,
    AssetPath(asset): AssetPath,
) -> Result<Json<LearningView>, Problem> {
    Ok(Json(service.discard_learning(&asset).await?))
}
