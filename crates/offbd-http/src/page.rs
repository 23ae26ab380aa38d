//! The dashboard: a single-page application, built from `web/` and embedded in the
//! binary.
//!
//! Files with a content hash in their name are cached without expiry; `index.html` is
//! revalidated by its `ETag`. Client-side routes return `index.html`.

use data_encoding::HEXLOWER;

use axum::body::Body;
use axum::http::header::{
    ACCEPT, ACCEPT_ENCODING, CACHE_CONTROL, CONTENT_ENCODING, CONTENT_LENGTH,
    CONTENT_SECURITY_POLICY, CONTENT_TYPE, ETAG, HeaderValue, IF_NONE_MATCH, REFERRER_POLICY, VARY,
    X_CONTENT_TYPE_OPTIONS,
};
use axum::http::{HeaderMap, Method, StatusCode, Uri};
use axum::response::{Html, IntoResponse, Response};
use rust_embed::{EmbeddedFile, RustEmbed};

use super::negotiate::weight_of_first;
use super::problem;

/// The built files; none if the binary was built without Node.
#[derive(RustEmbed)]
#[folder = "$OUT_DIR/page"]
struct PageFiles;

const INDEX: &str = "index.html";

/// Folder of files with a content hash in their name.
const HASHED: &str = "static/";

/// The content security policy of the page: same origin only, no inline scripts.
const POLICY: &str = "default-src 'self'; img-src 'self' data: blob:; media-src 'self' blob:; \
    object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// The page at `/` if the binary was built without the dashboard.
const NO_PAGE: &str = "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\">\
    <title>offbd</title><h1>offbd is running without its dashboard</h1>\
    <p>Node 18.19 or later was not found during the build. Install Node and npm, then build \
    again: <code>cargo build --release</code>. Nothing else is missing: the API is described \
    at <a href=\"/docs/\">/docs</a>.</p></html>";

/// Serves every path without a route: a file of the page, the page, or 404.
pub(super) async fn serve(method: Method, uri: Uri, headers: HeaderMap) -> Response {
    if method != Method::GET && method != Method::HEAD {
        return problem::not_found(uri).await.into_response();
    }
    let path = uri.path().trim_start_matches('/');
    match PageFiles::get(path) {
        Some(found) if path != INDEX => file(path, found, &headers),
        _ if path.is_empty() || is_client_route(path, &headers) => index(&headers),
        _ => problem::not_found(uri).await.into_response(),
    }
}

/// First segments of the routes of the page, which link previews and curl fetch without asking for HTML.
const CLIENT_ROUTES: [&str; 9] = [
    "jobs",
    "rigs",
    "sessions",
    "alarms",
    "notifications",
    "compare",
    "set-up",
    "learn",
    "administration",
];

/// Whether `path` is a route of the page, or a browser navigates to it.
fn is_client_route(path: &str, headers: &HeaderMap) -> bool {
    if path.split('/').next().is_some_and(|first| CLIENT_ROUTES.contains(&first)) {
        return true;
    }
    let accept = headers.get(ACCEPT).and_then(|a| a.to_str().ok()).unwrap_or_default();
    accept.contains("text/html")
        && !path.starts_with("api/")
        && !path.starts_with("sovd/")
        && !path.starts_with(HASHED)
}

/// Largest page of the API's description that is changed, bytes. Its own are below 2 kB.
const MAX_DOCS: usize = 100_000;

/// Gives the page of the API's description its own title and a link to the dashboard.
pub(super) async fn named_docs(response: Response) -> Response {
    let is_html = |value: &HeaderValue| value.as_bytes().starts_with(b"text/html");
    if !response.headers().get(CONTENT_TYPE).is_some_and(is_html) {
        return response;
    }
    let (mut head, body) = response.into_parts();
    let Ok(bytes) = axum::body::to_bytes(body, MAX_DOCS).await else {
        return StatusCode::INTERNAL_SERVER_ERROR.into_response();
    };
    let page = String::from_utf8_lossy(&bytes)
        .replace("<title>Swagger UI</title>", "<title>API · offbd</title>")
        .replace(
            "<div id=\"swagger-ui\">",
            "<p><a href=\"/\">Dashboard</a></p><div id=\"swagger-ui\">",
        );
    head.headers.remove(CONTENT_LENGTH);
    Response::from_parts(head, Body::from(page))
}

fn index(headers: &HeaderMap) -> Response {
    let Some(found) = PageFiles::get(INDEX) else { return Html(NO_PAGE).into_response() };
    let mut response = file(INDEX, found, headers);
    let head = response.headers_mut();
    head.insert(CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY));
    head.insert(REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
    response
}

/// Serves the file `path`, brotli-compressed if the build made such a file and the
/// client accepts it.
fn file(path: &str, found: EmbeddedFile, headers: &HeaderMap) -> Response {
    let accepted = headers.get(ACCEPT_ENCODING).and_then(|a| a.to_str().ok()).unwrap_or_default();
    let brotli = weight_of_first(accepted, &["br", "*"]) > 0.0;
    let compressed = PageFiles::get(&format!("{path}.br")).filter(|_| brotli);
    let is_compressed = compressed.is_some();
    let found = compressed.unwrap_or(found);
    let etag = etag(&found);
    let cache_control =
        if path.starts_with(HASHED) { "max-age=31536000, immutable" } else { "no-cache" };
    let mut head = HeaderMap::new();
    head.insert(CACHE_CONTROL, HeaderValue::from_static(cache_control));
    head.insert(VARY, HeaderValue::from_static("accept-encoding"));
    head.insert(X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    let cached = headers.get(IF_NONE_MATCH).and_then(|t| t.to_str().ok());
    let unchanged = cached.is_some_and(|cached| cached.contains(etag.as_str()));
    if let Ok(etag) = HeaderValue::from_str(&etag) {
        head.insert(ETAG, etag);
    }
    if unchanged {
        return (StatusCode::NOT_MODIFIED, head).into_response();
    }
    let media_type = mime_guess::from_path(path).first_or_octet_stream();
    if let Ok(media_type) = HeaderValue::from_str(media_type.as_ref()) {
        head.insert(CONTENT_TYPE, media_type);
    }
    if is_compressed {
        head.insert(CONTENT_ENCODING, HeaderValue::from_static("br"));
    }
    (head, Body::from(found.data)).into_response()
}

/// Returns the entity tag: the first half of the content's SHA-256, in quotes.
fn etag(file: &EmbeddedFile) -> String {
    format!("\"{}\"", HEXLOWER.encode(&file.metadata.sha256_hash()[..16]))
}
