//! Health, readiness and the descriptions of the interface.

use std::sync::{Arc, LazyLock};

use axum::Json;
use axum::extract::State;
use axum::http::header::CONTENT_TYPE;
use axum::routing::MethodRouter;
use bytes::Bytes;
use serde::Serialize;
use utoipa::ToSchema;

use super::{App, Problem};
use offbd_service::ServiceError;

/// The health of the process.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct HealthView {
    /// Always `ok`.
    status: &'static str,
    version: &'static str,
    /// Whether this is the demo, with a simulated rig.
    demo: bool,
    /// Assets whose engine is still to be rebuilt after the start. Until then, requests that
    /// need it are answered with 503 and `Retry-After`.
    rebuilding: usize,
    /// The optional parts of this build: `email`, `mcap`, `mqtt`, `nats`, `otel`, `parquet`,
    /// `xlsx`. Without one, its formats are refused with 406 or 415, and its settings with 422.
    features: &'static [&'static str],
    /// Whether messages have links to the dashboard: `notifications.public_url` is set.
    message_links: bool,
}

fn healthy(app: &App) -> Json<HealthView> {
    let (demo, rebuilding) = (app.demo, app.service.n_rebuilding());
    let (version, features) = (env!("CARGO_PKG_VERSION"), app.features);
    let message_links = app.service.has_public_url();
    Json(HealthView { status: "ok", version, demo, rebuilding, features, message_links })
}

/// Liveness: succeeds while the process runs. It does not ask the database, so that an outage does
/// not restart the process.
#[utoipa::path(get, path = "/healthz", tag = "operation",
    responses((status = 200, body = HealthView)))]
pub(super) async fn healthz(State(app): State<App>) -> Json<HealthView> {
    healthy(&app)
}

/// Readiness: succeeds if the service can accept telemetry now. It fails while the database is
/// unavailable, while ingest is stalled, and during shutdown.
#[utoipa::path(get, path = "/readyz", tag = "operation",
    responses((status = 200, body = HealthView),
        (status = 503, body = Problem, description = "Not ready; `detail` has the reason")))]
pub(super) async fn readyz(State(app): State<App>) -> Result<Json<HealthView>, Problem> {
    if app.closing.is_cancelled() {
        let what = "the service is shutting down";
        return Err(ServiceError::Unavailable { what }.into());
    }
    app.service.ready().await.map_err(|error| match error {
        // The database's own words are not for everybody.
        ServiceError::Outage { .. } if app.policy.required => {
            Problem::from(ServiceError::Outage { reason: "see the log".to_owned() })
        }
        error => error.into(),
    })?;
    Ok(healthy(&app))
}

/// Returns the route of a document that does not change. It is built when it is first read.
pub(super) fn document(
    media_type: &'static str,
    text: impl FnOnce() -> String + Send + 'static,
) -> MethodRouter<App> {
    let text = Arc::new(LazyLock::new(|| Bytes::from(text())));
    axum::routing::get(async move || ([(CONTENT_TYPE, media_type)], Bytes::clone(&text)))
}
