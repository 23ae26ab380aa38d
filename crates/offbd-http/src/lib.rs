//! The HTTP and WebSocket interface.
//!
//! A handler parses a request, calls [`Service`] and serializes the result. Errors
//! become `application/problem+json` in one place, `problem`. Contains no SQL and no
//! access to the engine.
//!
//! A request passes, from the outside in: `layers` (request id, span, timeout),
//! `guard` (authentication, authorization, rate limits, audit log), and the handler.
//! The routes and the right that each requires are listed in `api`.

mod alarms;
mod api;
mod assets;
mod asyncapi;
mod body;
mod calibrations;
mod cluster;
mod credential;
mod deliver;
mod description;
mod drive_cycles;
mod edition;
mod events;
mod faults;
mod fleet;
mod forward;
mod gather;
mod guard;
mod headers;
mod import_files;
mod jobs;
mod json_body;
mod json_schema;
mod layers;
mod learning;
mod login;
mod metrics;
mod negotiate;
mod notifications;
mod operations;
mod page;
mod parameters;
mod problem;
mod process;
mod rates;
mod remarks;
mod replays;
mod retry;
mod routes;
mod series;
mod session_format;
mod sessions;
mod sovd;
mod stream;
mod tags;
mod telemetry;
mod tokens;
#[cfg(feature = "otel")]
mod trace_parent;
mod traces;
mod trials;
mod web_socket;

use std::str::FromStr;
use std::sync::{Arc, LazyLock};

use axum::extract::{FromRef, FromRequestParts};
use axum::http::request::Parts;
use axum::{Extension, Router};
use serde::Deserialize;
use tokio_util::sync::CancellationToken;
use utoipa::OpenApi;
use utoipa::openapi::OpenApi as Document;
use utoipa_swagger_ui::{Config, SwaggerUi};

pub use asyncapi::asyncapi_yaml;
pub use body::BodyBudget;
pub use guard::AccessPolicy;
pub use json_body::parse_json;
pub use metrics::{MessageOutcome, gather_metrics, keep_metrics};
pub use problem::Problem;
pub use rates::subscriber;
pub use rates::{RateLimit, RateLimits};
pub use routes::ExtraRoutes;

use self::api::api;
pub use self::forward::Forwarder;
use self::guard::Guard;
use self::routes::RouteRules;
use offbd_core::vocabulary::{Invalid, TimeRange, UnknownWord};
use offbd_service::{Service, parse_timestamp};
use offbd_wire::table::{ColumnMapping, MappingError};

/// The state shared by all handlers.
#[derive(Clone)]
pub struct App {
    pub service: Service,
    /// Limits the bytes of request bodies in memory.
    pub budget: BodyBudget,
    /// Authentication, permitted origins and rate limits.
    pub policy: Arc<AccessPolicy>,
    /// Cancelled when the server stops; long-lived responses end then.
    pub closing: CancellationToken,
    /// Whether this is the demo, which adds its own routes.
    pub demo: bool,
    /// The optional parts of this build, by the names of the program's features.
    pub features: &'static [&'static str],
}

impl FromRef<App> for Service {
    fn from_ref(app: &App) -> Self {
        app.service.clone()
    }
}

#[derive(OpenApi)]
#[openapi(
    info(
        title = "offbd",
        description = "Off-board diagnostics with a digital twin for ball-on-plate rigs. \
            A rig streams commands and measured positions; faults come out. \
            Lengths are in metres, angles in radians, sample times in seconds on the device's \
            clock. Timestamps of the service are RFC 3339.",
    ),
    // The service that the description comes from.
    servers((url = "/")),
    components(schemas(
        offbd_wire::service::EventView,
        offbd_wire::words::SessionSort,
        offbd_wire::words::VerdictFilter,
        offbd_wire::words::SeriesAggregate,
        offbd_wire::alarm::CommunicationView,
        offbd_wire::notification::NotificationView
    )),
    tags(
        (name = "assets", description = "The registry of rigs"),
        (name = "telemetry", description = "Ingest of samples"),
        (name = "faults", description = "Fault memory"),
        (name = "alarms", description = "What fails in the fleet, mutes, and what to do"),
        (name = "notifications", description = "Channels, rules and deliveries of messages about faults"),
        (name = "sessions", description = "Recordings"),
        (name = "sovd", description = "The same in the shape of SOVD (ISO 17978-3)"),
        (name = "access", description = "Tokens, logins, the audit log"),
        (name = "operation", description = "Health and metrics"),
    )
)]
struct Api;

/// Most items on a page; a `limit` above it is refused.
const MAX_PAGE: u32 = 500;

/// Items on a page without a `limit`.
const DEFAULT_PAGE: u32 = 50;

fn page_limit(limit: Option<u32>) -> u32 {
    limit.unwrap_or(DEFAULT_PAGE).clamp(1, MAX_PAGE)
}

/// Parses the query parameter `name`, which has a closed set of values.
///
/// # Errors
/// A [`Problem`] with the parameter and its permitted values.
fn query_word<T: FromStr<Err = UnknownWord>>(
    name: &str,
    word: Option<&str>,
) -> Result<Option<T>, Problem> {
    let word = word.map(str::parse).transpose();
    Ok(word.map_err(|error: UnknownWord| Invalid::new(name, error.to_string()))?)
}

/// Parses the query parameter `columns`.
///
/// # Errors
/// A [`Problem`] with the reason.
fn query_columns(mapping: Option<&str>) -> Result<ColumnMapping, Problem> {
    let parsed = mapping.unwrap_or_default().parse();
    Ok(parsed.map_err(|error: MappingError| Invalid::new("?columns", error.to_string()))?)
}

/// Parses the query parameter `name`, a time (RFC 3339), to microseconds since 1970.
///
/// # Errors
/// A [`Problem`] with the parameter.
fn query_time(name: &str, text: Option<&str>) -> Result<Option<i64>, Problem> {
    let time = text.map(parse_timestamp).transpose();
    Ok(time.map_err(|reason| Invalid::new(name, reason))?)
}

/// Returns the range of the query parameters `from_s` and `to_s`, of which one or both may be
/// missing.
///
/// # Errors
/// A [`Problem`] if one is not a finite number, or if they are in the wrong order.
fn time_range(from_s: Option<f64>, to_s: Option<f64>) -> Result<TimeRange, Problem> {
    for (name, t_s) in [("?from_s", from_s), ("?to_s", to_s)] {
        if t_s.is_some_and(|t_s| !t_s.is_finite()) {
            return Err(Invalid::new(name, "must be a finite number of seconds").into());
        }
    }
    if let (Some(from_s), Some(to_s)) = (from_s, to_s)
        && to_s < from_s
    {
        return Err(
            Invalid::new("?to_s", format!("{to_s} s is before `from_s`, {from_s} s")).into()
        );
    }
    let TimeRange { from_s: first, to_s: last } = TimeRange::ALL;
    Ok(TimeRange { from_s: from_s.unwrap_or(first), to_s: to_s.unwrap_or(last) })
}

/// The query parameters; rejected with a [`Problem`] if invalid.
#[derive(FromRequestParts)]
#[from_request(via(axum::extract::Query), rejection(Problem))]
struct Query<T>(T);

/// The path parameters; rejected with a [`Problem`] if invalid.
#[derive(FromRequestParts)]
#[from_request(via(axum::extract::Path), rejection(Problem))]
struct Path<T>(T);

/// The asset name in the path, recorded in the request's span.
struct AssetPath(String);

impl<S: Send + Sync> FromRequestParts<S> for AssetPath {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let Path::<String>(asset) = Path::from_request_parts(parts, state).await?;
        layers::record_asset(&asset);
        Ok(Self(asset))
    }
}

/// The asset name and a second path parameter: a fault code or a calibration id.
struct AssetItemPath(String, String);

impl<S: Send + Sync> FromRequestParts<S> for AssetItemPath {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let Path((asset, item)): Path<(String, String)> =
            Path::from_request_parts(parts, state).await?;
        layers::record_asset(&asset);
        Ok(Self(asset, item))
    }
}

/// The page of a list.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
struct PageQuery {
    /// `next` of the previous page.
    cursor: Option<String>,
    /// Items per page, 1 to 500; 50 by default.
    #[param(format = Int32, minimum = 1, maximum = 500)]
    limit: Option<u32>,
}

/// Public paths that are not operations: the API description and its viewer.
const OPEN_PAGES: [&str; 7] = [
    "/openapi.yaml",
    "/openapi.json",
    "/asyncapi.yaml",
    "/asset.schema.json",
    "/docs",
    "/docs/",
    "/docs/{*rest}",
];

/// Returns the OpenAPI document.
#[must_use]
pub fn openapi() -> Document {
    description::complete(api().split().1)
}

/// Returns the OpenAPI document as YAML, as committed in `openapi.yaml`.
#[must_use]
pub fn openapi_yaml() -> String {
    openapi().to_yaml().unwrap_or_else(|error| format!("# {error}\n"))
}

/// Returns the JSON Schema of an asset file, as committed in `docs/asset.schema.json`.
#[must_use]
pub fn asset_schema() -> String {
    let mut schema = json_schema::of("Asset");
    schema["title"] = "Asset file of offbd".into();
    format!("{schema:#}\n")
}

/// Returns the router of everything that is served: the API, its description, the
/// dashboard, and `extra`.
pub fn router(app: App, extra: ExtraRoutes) -> Router {
    let (router, mut document) = api().split();
    let (extra, described) = extra.split();
    document.merge(described);
    let mut rules = RouteRules::new(&document);
    OPEN_PAGES.iter().for_each(|path| rules.open(path));
    let policy = app.policy.clone();
    let forwarder = Forwarder::default();
    let guard = Arc::new(Guard { app: app.clone(), rules, forwarder: forwarder.clone() });
    let router = with_documents(router, document)
        .merge(
            Router::<App>::from(SwaggerUi::new("/docs").config(Config::from("/openapi.json")))
                .layer(axum::middleware::map_response(page::named_docs)),
        )
        .fallback(page::serve)
        .method_not_allowed_fallback(problem::method_not_allowed)
        .with_state(app)
        .merge(extra)
        .layer(Extension(forwarder))
        .layer(axum::middleware::from_fn_with_state(guard, guard::guard));
    layers::add(router, &policy)
}

/// Adds the documents that describe the interface. Each is built when it is first read.
fn with_documents(router: Router<App>, document: Document) -> Router<App> {
    use operations::document as served;

    let complete = Arc::new(LazyLock::new(move || description::complete(document)));
    let json = Arc::clone(&complete);
    router
        .route(
            "/openapi.yaml",
            served("application/yaml", move || complete.to_yaml().unwrap_or_default()),
        )
        .route(
            "/openapi.json",
            served("application/json", move || json.to_json().unwrap_or_default()),
        )
        .route("/asyncapi.yaml", served("application/yaml", asyncapi_yaml))
        .route("/asset.schema.json", served("application/schema+json", asset_schema))
}
