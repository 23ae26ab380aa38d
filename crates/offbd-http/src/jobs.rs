//! `/jobs`: the background jobs that run or wait.

use axum::Json;
use axum::extract::State;

use super::Problem;
use offbd_service::Service;
use offbd_wire::service::{JobView, Page};

/// Lists the background jobs of the node that answers which run or wait: replays and calibrations,
/// at most 100 that persons asked for and 100 that rigs started by themselves. Jobs that have
/// ended are not listed; their results are at their own paths.
#[utoipa::path(get, path = "/jobs", tag = "operation", operation_id = "list_jobs",
    responses((status = 200, body = Page<JobView>)))]
pub(super) async fn list(State(service): State<Service>) -> Result<Json<Page<JobView>>, Problem> {
    Ok(Json(service.list_jobs().await?))
}
