//! Joins the caller's distributed trace: <https://www.w3.org/TR/trace-context/>.

use axum::body::Body;
use axum::extract::MatchedPath;
use axum::http::Request;
use opentelemetry::propagation::TextMapPropagator;
use opentelemetry_http::HeaderExtractor;
use opentelemetry_sdk::propagation::TraceContextPropagator;
use tracing::Span;
use tracing_opentelemetry::OpenTelemetrySpanExt;

/// Makes `span` a child of the caller's trace, if the request has one, and gives it the route.
pub(super) fn join(span: &Span, request: &Request<Body>) {
    let headers = request.headers();
    if headers.contains_key("traceparent") {
        let caller = TraceContextPropagator::new().extract(&HeaderExtractor(headers));
        // Fails if tracing is off, which is fine.
        let _ = span.set_parent(caller);
    }
    if let Some(route) = request.extensions().get::<MatchedPath>() {
        span.set_attribute("http.route", route.as_str().to_owned());
    }
}
