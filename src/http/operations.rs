//! Health, readiness, metrics and the description of the interface.

use std::sync::{Arc, OnceLock};
use std::time::Duration;

use axum::Json;
use axum::extract::State;
use axum::http::header::CONTENT_TYPE;
use axum::response::IntoResponse;
use metrics_exporter_prometheus::{PrometheusBuilder, PrometheusHandle};
use serde::Serialize;
use tokio_util::sync::CancellationToken;
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

static METRICS: OnceLock<Option<PrometheusHandle>> = OnceLock::new();

/// Begins to gather metrics, once for the process.
pub fn gather_metrics() {
    METRICS.get_or_init(|| match PrometheusBuilder::new().install_recorder() {
        Ok(handle) => Some(handle),
        Err(error) => {
            tracing::error!(%error, "no metrics");
            None
        }
    });
}

/// How often what was measured is folded into the metrics. Between, every single
/// duration is kept: a moment's worth, whether anybody asks for the metrics or not.
const UPKEEP: Duration = Duration::from_secs(5);

/// Folds what was measured into the metrics until the server stops.
pub async fn keep_metrics(closing: CancellationToken) {
    let Some(Some(handle)) = METRICS.get() else { return };
    loop {
        tokio::select! {
            () = closing.cancelled() => return,
            () = tokio::time::sleep(UPKEEP) => handle.run_upkeep(),
        }
    }
}

/// Metrics in the text format of Prometheus.
#[utoipa::path(get, path = "/metrics", tag = "operation",
    responses((status = 200, body = String, content_type = "text/plain")))]
pub(super) async fn metrics() -> impl IntoResponse {
    let handle = METRICS.get().and_then(Option::as_ref);
    let text = handle.map(|handle| {
        handle.run_upkeep();
        handle.render()
    });
    ([(CONTENT_TYPE, "text/plain; version=0.0.4")], text.unwrap_or_default())
}

pub(super) async fn openapi(yaml: Arc<str>) -> impl IntoResponse {
    ([(CONTENT_TYPE, "application/yaml")], yaml.to_string())
}
