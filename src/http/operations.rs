//! Health, readiness and the description of the interface.

use std::sync::Arc;

use axum::Json;
use axum::extract::State;
use axum::http::header::CONTENT_TYPE;
use axum::response::IntoResponse;
use serde::Serialize;
use utoipa::ToSchema;

use super::{App, Problem};

/// That the process lives.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct HealthView {
    /// Always `ok`.
    status: &'static str,
    version: &'static str,
    /// Whether this is the demo, with a simulated rig.
    demo: bool,
}

const fn healthy(demo: bool) -> Json<HealthView> {
    Json(HealthView { status: "ok", version: env!("CARGO_PKG_VERSION"), demo })
}

/// Whether the process lives.
#[utoipa::path(get, path = "/healthz", tag = "operation",
    responses((status = 200, body = HealthView)))]
pub(super) async fn healthz(State(app): State<App>) -> Json<HealthView> {
    healthy(app.demo)
}

/// Whether it can take telemetry now; if not, why.
#[utoipa::path(get, path = "/readyz", tag = "operation",
    responses((status = 200, body = HealthView),
        (status = 503, body = Problem, description = "`detail` says why")))]
pub(super) async fn readyz(State(app): State<App>) -> Result<Json<HealthView>, Problem> {
    if app.closing.is_cancelled() {
        let what = "the service is closing";
        return Err(crate::service::ServiceError::Unavailable { what }.into());
    }
    app.service.ready().await?;
    Ok(healthy(app.demo))
}

pub(super) async fn openapi(yaml: Arc<str>) -> impl IntoResponse {
    ([(CONTENT_TYPE, "application/yaml")], yaml.to_string())
}
