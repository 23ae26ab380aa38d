//! `/assets/{asset}/learning`: a rig that learns by itself.

use axum::Json;
use axum::extract::State;

use super::{Asset, Problem};
use crate::service::Service;
use crate::wire::learning::LearningView;

/// How far the rig is on its way to being learnt: the motion gathered so far, what is
/// missing, what is offered, or what it was learnt from.
#[utoipa::path(get, path = "/assets/{asset}/learning", tag = "assets",
    operation_id = "get_learning",
    params(("asset" = String, description = "Name of the asset")),
    responses((status = 200, body = LearningView), (status = 404, body = Problem)))]
pub(super) async fn get(
    State(service): State<Service>,
    Asset(asset): Asset,
) -> Result<Json<LearningView>, Problem> {
    Ok(Json(service.learning(&asset).await?))
}

/// "It was healthy": puts the calibration that the rig offers into the asset file. An
/// open session goes on with what it began with; the next session uses it. Later
/// sessions in which every monitor finds nothing refine it, until five have taught.
#[utoipa::path(post, path = "/assets/{asset}/learning/accept", tag = "assets",
    operation_id = "accept_learning",
    params(("asset" = String, description = "Name of the asset")),
    responses((status = 200, body = LearningView), (status = 404, body = Problem),
        (status = 409, body = Problem, description = "Nothing is offered")))]
pub(super) async fn accept(
    State(service): State<Service>,
    Asset(asset): Asset,
) -> Result<Json<LearningView>, Problem> {
    Ok(Json(service.accept_learning(&asset).await?))
}

/// "It was not healthy": forgets what was gathered, the open session so far included,
/// and gathers anew. The recordings stay.
#[utoipa::path(post, path = "/assets/{asset}/learning/discard", tag = "assets",
    operation_id = "discard_learning",
    params(("asset" = String, description = "Name of the asset")),
    responses((status = 200, body = LearningView), (status = 404, body = Problem),
        (status = 409, body = Problem, description = "The rig is learnt already")))]
pub(super) async fn discard(
    State(service): State<Service>,
    Asset(asset): Asset,
) -> Result<Json<LearningView>, Problem> {
    Ok(Json(service.discard_learning(&asset).await?))
}
