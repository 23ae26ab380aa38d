//! The dashboard: one page application, built from `web/` into the program.
//!
//! Files whose name carries a hash of their content may be kept for ever; the
//! page itself is asked for each time, by its hash. A browser that asks for an
//! address of the page's own gets the page, which knows what to show there.

use data_encoding::HEXLOWER;

use axum::body::Body;
use axum::http::header::{
    ACCEPT, ACCEPT_ENCODING, CACHE_CONTROL, CONTENT_ENCODING, CONTENT_SECURITY_POLICY,
    CONTENT_TYPE, ETAG, HeaderValue, IF_NONE_MATCH, REFERRER_POLICY, VARY, X_CONTENT_TYPE_OPTIONS,
};
use axum::http::{HeaderMap, Method, StatusCode, Uri};
use axum::response::{Html, IntoResponse, Response};
use rust_embed::{EmbeddedFile, RustEmbed};

use super::negotiate::weight_of_first;
use super::problem;

/// What the build left; nothing where it had no Node.
#[derive(RustEmbed)]
#[folder = "$OUT_DIR/page"]
struct Files;

const INDEX: &str = "index.html";

/// Where the build puts files whose names carry their hash.
const HASHED: &str = "static/";

/// Everything comes from here, and nothing is run that is not a file.
const POLICY: &str = "default-src 'self'; img-src 'self' data: blob:; media-src 'self' blob:; \
    object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// What is said at `/` by a program that was built without the page.
const NO_PAGE: &str = "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\">\
    <title>offbd</title><h1>offbd runs, without its dashboard</h1>\
    <p>It was built where there was no Node 18.19 or later. Install Node and npm, then build \
    again: <code>cargo build --release</code>. Nothing else is missing: the interface is at \
    <a href=\"/docs/\">/docs</a>.</p></html>";

/// Answers what no route has: a file of the page, the page, or a problem.
pub(super) async fn serve(method: Method, uri: Uri, headers: HeaderMap) -> Response {
    if method != Method::GET && method != Method::HEAD {
        return problem::not_found(uri).await.into_response();
    }
    let path = uri.path().trim_start_matches('/');
    match Files::get(path) {
        Some(found) if path != INDEX => file(path, found, &headers),
        _ if path.is_empty() || is_view(path, &headers) => index(&headers),
        _ => problem::not_found(uri).await.into_response(),
    }
}

/// Whether a person's browser asks for one of the page's own addresses.
fn is_view(path: &str, headers: &HeaderMap) -> bool {
    let accept = headers.get(ACCEPT).and_then(|a| a.to_str().ok()).unwrap_or_default();
    accept.contains("text/html") && !path.starts_with("api/") && !path.starts_with(HASHED)
}

fn index(headers: &HeaderMap) -> Response {
    let Some(found) = Files::get(INDEX) else { return Html(NO_PAGE).into_response() };
    let mut response = file(INDEX, found, headers);
    let head = response.headers_mut();
    head.insert(CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY));
    head.insert(REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
    response
}

/// The file `path`, as brotli where the build made it and the browser takes it.
fn file(path: &str, found: EmbeddedFile, headers: &HeaderMap) -> Response {
    let taken = headers.get(ACCEPT_ENCODING).and_then(|a| a.to_str().ok()).unwrap_or_default();
    let brotli = weight_of_first(taken, &["br", "*"]) > 0.0;
    let packed = Files::get(&format!("{path}.br")).filter(|_| brotli);
    let is_packed = packed.is_some();
    let found = packed.unwrap_or(found);
    let tag = tag(&found);
    let kept = if path.starts_with(HASHED) { "max-age=31536000, immutable" } else { "no-cache" };
    let mut head = HeaderMap::new();
    head.insert(CACHE_CONTROL, HeaderValue::from_static(kept));
    head.insert(VARY, HeaderValue::from_static("accept-encoding"));
    head.insert(X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    let known = headers.get(IF_NONE_MATCH).and_then(|t| t.to_str().ok());
    let known = known.is_some_and(|known| known.contains(tag.as_str()));
    if let Ok(tag) = HeaderValue::from_str(&tag) {
        head.insert(ETAG, tag);
    }
    if known {
        return (StatusCode::NOT_MODIFIED, head).into_response();
    }
    let kind = mime_guess::from_path(path).first_or_octet_stream();
    if let Ok(kind) = HeaderValue::from_str(kind.as_ref()) {
        head.insert(CONTENT_TYPE, kind);
    }
    if is_packed {
        head.insert(CONTENT_ENCODING, HeaderValue::from_static("br"));
    }
    (head, Body::from(found.data)).into_response()
}

/// The first half of the content's SHA-256, in quotes.
fn tag(file: &EmbeddedFile) -> String {
    format!("\"{}\"", HEXLOWER.encode(&file.metadata.sha256_hash()[..16]))
}
