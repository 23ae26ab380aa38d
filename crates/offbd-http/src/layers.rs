//! Middleware around every handler: request ids, spans, metrics, timeouts, panic
//! handling, security headers, compression.

use std::any::Any;
use std::time::{Duration, Instant};

use axum::Router;
use axum::body::Body;
use axum::extract::{MatchedPath, Request};
use axum::http::header::CONTENT_LENGTH;
use axum::http::{HeaderName, StatusCode};
use axum::middleware::{Next, from_fn};
use axum::response::{IntoResponse, Response};
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::classify::ServerErrorsFailureClass;
use tower_http::compression::CompressionLayer;
use tower_http::request_id::{
    MakeRequestUuid, PropagateRequestIdLayer, RequestId, SetRequestIdLayer,
};
use tower_http::trace::TraceLayer;
use tracing::Span;
use tracing::field::Empty;

use offbd_net::unread_body;
use offbd_wire::problem::{FAILED, SLOW};

use super::{AccessPolicy, Problem, headers};

/// Longest time until a response starts, except for an import.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(60);

/// Longest time until the response to an import, whose samples are evaluated before.
const IMPORT_TIMEOUT: Duration = Duration::from_secs(900);

const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");

/// Adds the middleware to `router`, listed from the outside in. As one layer, because
/// axum boxes each layer separately for every request.
pub(super) fn add(router: Router, policy: &AccessPolicy) -> Router {
    let router = match policy.encrypted {
        true => router.layer(from_fn(headers::require_tls)),
        false => router,
    };
    router.layer((
        SetRequestIdLayer::new(REQUEST_ID, MakeRequestUuid),
        PropagateRequestIdLayer::new(REQUEST_ID),
        TraceLayer::new_for_http().make_span_with(span).on_failure(failed),
        CompressionLayer::new(),
        headers::cors(&policy.origins),
        from_fn(headers::secure),
        from_fn(unread_body::discard),
        from_fn(set_instance),
        CatchPanicLayer::custom(panicked),
        from_fn(count),
        from_fn(limit_time),
    ))
}

/// Creates the request's span, as a child of the caller's trace if there is one.
fn span(request: &Request<Body>) -> Span {
    let id = request_id(request).unwrap_or_default();
    let (method, path) = (request.method(), request.uri().path());
    let span = tracing::info_span!(
        "request", %method, path, request_id = id, asset = Empty, status = Empty
    );
    #[cfg(feature = "otel")]
    super::trace_parent::join(&span, request);
    span
}

/// Records the asset name in the request's span.
pub(super) fn record_asset(asset: &str) {
    Span::current().record("asset", asset);
}

/// Logs a response that tells of an error of the service. One with 503 does not: why the store or
/// an asset is away is logged once, where it is noticed.
fn failed(failure: ServerErrorsFailureClass, latency: Duration, _: &Span) {
    match failure {
        ServerErrorsFailureClass::StatusCode(StatusCode::SERVICE_UNAVAILABLE) => {
            tracing::debug!(?latency, "unavailable at present");
        }
        failure => tracing::error!(classification = %failure, ?latency, "response failed"),
    }
}

fn request_id(request: &Request<Body>) -> Option<String> {
    let id = request.extensions().get::<RequestId>()?;
    id.header_value().to_str().ok().map(str::to_owned)
}

async fn limit_time(request: Request, next: Next) -> Response {
    let import = request.uri().path().ends_with("/sessions/import");
    let limit = if import { IMPORT_TIMEOUT } else { ANSWER_TIMEOUT };
    tokio::time::timeout(limit, next.run(request)).await.unwrap_or_else(|_| {
        let detail = format!("no response within {} s; retry the request", limit.as_secs());
        Problem::new(SLOW, detail).into_response()
    })
}

#[expect(clippy::disallowed_methods, reason = "the response time is a metric")]
async fn count(request: Request, next: Next) -> Response {
    let path = request.extensions().get::<MatchedPath>().map(|path| path.as_str().to_owned());
    let path = path.unwrap_or_else(|| "unmatched".to_owned());
    let started = Instant::now();
    let response = next.run(request).await;
    let status = response.status().as_str().to_owned();
    Span::current().record("status", &status);
    metrics::counter!("offbd_http_requests_total", "path" => path.clone(), "status" => status)
        .increment(1);
    metrics::histogram!("offbd_http_request_seconds", "path" => path)
        .record(started.elapsed().as_secs_f64());
    response
}

/// Sets `instance` of a problem to the id of its request, and the members that clients of SOVD
/// read if the request is one of its adapter.
async fn set_instance(request: Request, next: Next) -> Response {
    let id = request_id(&request);
    let is_sovd = request.uri().path().starts_with(headers::SOVD_PREFIX);
    let mut response = next.run(request).await;
    match response.extensions_mut().remove::<Problem>() {
        Some(problem) => {
            let instance = id.map(|id| format!("urn:uuid:{id}").into());
            let mut headers = std::mem::take(response.headers_mut());
            let named = Problem { instance, ..problem };
            let mut named = if is_sovd { named.with_sovd() } else { named }.into_response();
            headers.remove(CONTENT_LENGTH);
            named.headers_mut().extend(headers);
            named
        }
        None => response,
    }
}

fn panicked(panic: Box<dyn Any + Send>) -> Response {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
    tracing::error!(panic = text.unwrap_or_default(), "a request handler panicked");
    let detail = "the request failed with an internal error; see the log for the request id";
    Problem::new(FAILED, detail).into_response()
}
