//! Response headers for browsers: cross-origin access (CORS) and the content security
//! policy.

use std::time::Duration;

use axum::extract::Request;
use axum::http::Method;
use axum::http::header::{
    ACCEPT, AUTHORIZATION, CACHE_CONTROL, CONTENT_ENCODING, CONTENT_SECURITY_POLICY, CONTENT_TYPE,
    ETAG, HeaderName, HeaderValue, IF_MATCH, IF_NONE_MATCH, LOCATION, REFERRER_POLICY, RETRY_AFTER,
    STRICT_TRANSPORT_SECURITY, WWW_AUTHENTICATE, X_CONTENT_TYPE_OPTIONS,
};
use axum::middleware::Next;
use axum::response::Response;
use tower_http::cors::CorsLayer;

/// How paths of the adapter begin, whose errors have the members of SOVD too.
pub(super) const SOVD_PREFIX: &str = "/sovd/";

/// The content security policy of responses that are not pages.
const DENY_ALL: &str = "default-src 'none'; frame-ancestors 'none'";

/// The content security policy of the API description; its viewer sets inline styles.
const DOCS: &str = "default-src 'self'; style-src 'self' 'unsafe-inline'; \
    img-src 'self' data:; object-src 'none'; base-uri 'none'; frame-ancestors 'none'";

/// How long a browser may cache the result of a preflight request.
const PREFLIGHT_MAX_AGE: Duration = Duration::from_secs(3600);

/// Tells browsers to connect with TLS only, for half a year.
const TLS_ONLY: HeaderValue = HeaderValue::from_static("max-age=15768000");

/// Adds `Strict-Transport-Security` to the response.
pub(super) async fn require_tls(request: Request, next: Next) -> Response {
    let mut response = next.run(request).await;
    response.headers_mut().insert(STRICT_TRANSPORT_SECURITY, TLS_ONLY);
    response
}

/// Sets the security headers that the response does not set itself.
pub(super) async fn secure(request: Request, next: Next) -> Response {
    let path = request.uri().path();
    let policy = if path.starts_with("/docs") { DOCS } else { DENY_ALL };
    let is_api = path.starts_with("/api/") || path.starts_with(SOVD_PREFIX);
    let mut response = next.run(request).await;
    let mut set_default = |name: HeaderName, value: &'static str| {
        response.headers_mut().entry(name).or_insert(HeaderValue::from_static(value));
    };
    set_default(CONTENT_SECURITY_POLICY, policy);
    set_default(X_CONTENT_TYPE_OPTIONS, "nosniff");
    set_default(REFERRER_POLICY, "no-referrer");
    if is_api {
        set_default(CACHE_CONTROL, "no-store");
    }
    response
}

/// Allows cross-origin requests from pages of `origins`, with a bearer token but never
/// with a cookie.
pub(super) fn cors(origins: &[String]) -> CorsLayer {
    if origins.is_empty() {
        return CorsLayer::new();
    }
    let origins = origins.iter().filter_map(|origin| HeaderValue::from_str(origin).ok());
    CorsLayer::new()
        .allow_origin(origins.collect::<Vec<_>>())
        .allow_methods([Method::GET, Method::POST, Method::PUT, Method::DELETE])
        .allow_headers([
            ACCEPT,
            AUTHORIZATION,
            CONTENT_ENCODING,
            CONTENT_TYPE,
            IF_MATCH,
            IF_NONE_MATCH,
            HeaderName::from_static("last-event-id"),
        ])
        .expose_headers([
            ETAG,
            LOCATION,
            RETRY_AFTER,
            WWW_AUTHENTICATE,
            HeaderName::from_static("x-request-id"),
        ])
        .max_age(PREFLIGHT_MAX_AGE)
}
