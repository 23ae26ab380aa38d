//! `/sessions/{id}/remarks`: what people note on a moment or a stretch of a session.

use axum::extract::State;
use axum::http::StatusCode;
use axum::{Extension, Json};

use super::faults::ActorQuery;
use super::json_body::JsonBody;
use super::{App, Path, Problem, Query};
use offbd_service::Service;
use offbd_service::access::Caller;
use offbd_wire::remark::{NewRemarkView, RemarkView};
use offbd_wire::service::Page;

/// Lists the remarks on a session, in order of time; all of them. A session has at most 500.
#[utoipa::path(get, path = "/sessions/{id}/remarks", tag = "sessions",
    operation_id = "list_remarks",
    params(("id" = String, description = "The service's id of the session")),
    responses((status = 200, body = Page<RemarkView>), (status = 404, body = Problem)))]
pub(super) async fn list(
    State(service): State<Service>,
    Path(id): Path<String>,
) -> Result<Json<Page<RemarkView>>, Problem> {
    Ok(Json(Page { items: service.remarks(&id).await?, next: None }))
}

/// Adds a remark to a session. It is deleted with the session.
#[utoipa::path(post, path = "/sessions/{id}/remarks", tag = "sessions",
    operation_id = "add_remark",
    params(("id" = String, description = "The service's id of the session"), ActorQuery),
    request_body = NewRemarkView,
    responses((status = 201, body = RemarkView), (status = 400, body = Problem),
        (status = 404, body = Problem),
        (status = 409, body = Problem, description = "The session has 500 remarks"),
        (status = 422, body = Problem)))]
pub(super) async fn add(
    State(app): State<App>,
    Path(id): Path<String>,
    Query(query): Query<ActorQuery>,
    Extension(caller): Extension<Caller>,
    JsonBody(new): JsonBody<NewRemarkView>,
) -> Result<(StatusCode, Json<RemarkView>), Problem> {
    let remark = app.service.add_remark(&id, new, query.actor(&caller)).await?;
    Ok((StatusCode::CREATED, Json(remark)))
}

/// Removes a remark. The session and its recording are not changed.
#[utoipa::path(delete, path = "/sessions/{id}/remarks/{remark}", tag = "sessions",
    operation_id = "remove_remark",
    params(("id" = String, description = "The service's id of the session"),
        ("remark" = String, description = "Id of the remark")),
    responses((status = 204), (status = 404, body = Problem)))]
pub(super) async fn remove(
    State(service): State<Service>,
    Path((id, remark)): Path<(String, String)>,
) -> Result<StatusCode, Problem> {
    service.remove_remark(&id, &remark).await?;
    Ok(StatusCode::NO_CONTENT)
}
