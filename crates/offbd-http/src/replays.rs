//! `/sessions/{id}/replays` and `/replays`: evaluating a recorded session again.

use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use axum::http::header::LOCATION;
use axum::response::IntoResponse;

use super::json_body::JsonBody;
use super::{App, Path, Problem};
use offbd_service::Service;
use offbd_wire::service::{ReplaySettingsView, ReplayView};

/// Starts a background job that evaluates a recorded session again, with other settings
/// if the body has any. The session and the fault memory are not changed.
#[utoipa::path(post, path = "/sessions/{id}/replays", tag = "sessions",
    operation_id = "replay_session",
    params(("id" = String, description = "The service's id of the session")),
    request_body = Option<ReplaySettingsView>,
    responses((status = 202, body = ReplayView, headers(("Location"))),
        (status = 400, body = Problem), (status = 404, body = Problem),
        (status = 422, body = Problem), (status = 429, body = Problem)))]
pub(super) async fn create(
    State(app): State<App>,
    Path(id): Path<String>,
    JsonBody(settings): JsonBody<ReplaySettingsView>,
) -> Result<impl IntoResponse, Problem> {
    let replay = app.service.replay(&id, settings).await?;
    let location = format!("/api/v1/replays/{}", replay.id);
    Ok((StatusCode::ACCEPTED, [(LOCATION, location)], Json(replay)))
}

/// Returns the progress of a replay and, once it is done, its verdict, the verdict's hash, and the
/// differences from the recorded verdict. `progress` is the share of the recording that is judged,
/// and `error` tells why a replay failed.
#[utoipa::path(get, path = "/replays/{id}", tag = "sessions", operation_id = "get_replay",
    params(("id" = String, description = "Id of the replay")),
    responses((status = 200, body = ReplayView), (status = 404, body = Problem)))]
pub(super) async fn get(
    State(service): State<Service>,
    Path(id): Path<String>,
) -> Result<Json<ReplayView>, Problem> {
    Ok(Json(service.replay_state(&id).await?))
}

/// Cancels a replay that waits or runs. It fails; one that runs may take a moment to stop.
#[utoipa::path(post, path = "/replays/{id}/cancel", tag = "sessions",
    operation_id = "cancel_replay",
    params(("id" = String, description = "Id of the replay")),
    responses((status = 200, body = ReplayView), (status = 404, body = Problem),
        (status = 409, body = Problem, description = "The replay neither waits nor runs")))]
pub(super) async fn cancel(
    State(service): State<Service>,
    Path(id): Path<String>,
) -> Result<Json<ReplayView>, Problem> {
    Ok(Json(service.cancel_replay(&id).await?))
}
