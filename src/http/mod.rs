//! The HTTP and WebSocket interface.
//!
//! Handlers read a request, ask the service, and show the answer; what goes
//! wrong becomes a `problem+json` in one place. Knows no SQL and no engine.

mod assets;
mod body;
mod calibrations;
mod description;
mod drive_cycles;
mod events;
mod faults;
mod guard;
mod headers;
mod layers;
mod learning;
mod login;
mod metrics;
mod negotiate;
mod operations;
mod page;
mod problem;
mod rates;
mod replays;
mod routes;
mod sessions;
mod stream;
mod telemetry;
mod tokens;
#[cfg(feature = "otel")]
mod trace_parent;
mod traces;

use std::sync::Arc;

use axum::Router;
use axum::extract::{FromRef, FromRequestParts};
use axum::http::request::Parts;
use serde::Deserialize;
use tokio_util::sync::CancellationToken;
use utoipa::OpenApi;
use utoipa::openapi::OpenApi as Document;
use utoipa_axum::routes;
use utoipa_swagger_ui::SwaggerUi;

pub use body::Budget;
pub use guard::Policy;
pub use metrics::{gather_metrics, keep_metrics};
pub use problem::Problem;
pub(crate) use rates::subscriber;
pub use rates::{Rate, Rates};
pub use routes::More;

use self::guard::Guard;
use self::routes::{Guarded, Rules};
use crate::service::Service;
use crate::service::access::Right;

/// What the handlers share.
#[derive(Clone)]
pub struct App {
    pub service: Service,
    /// Bytes of request bodies in memory.
    pub budget: Budget,
    /// Who is let in.
    pub policy: Arc<Policy>,
    /// Cancelled when the server stops: long answers end then.
    pub closing: CancellationToken,
    /// Whether this is the demo, which mounts more than the interface.
    pub demo: bool,
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
            Lengths in metres, angles in radians, times in seconds on the device's clock; \
            moments of the service in RFC 3339.",
    ),
    components(schemas(crate::wire::service::EventView)),
    tags(
        (name = "assets", description = "The registry of rigs"),
        (name = "telemetry", description = "Samples in"),
        (name = "faults", description = "Fault memory"),
        (name = "sessions", description = "Recordings"),
        (name = "access", description = "Tokens, logins, the audit log"),
        (name = "operation", description = "Health and metrics"),
    )
)]
struct Api;

/// Items on a page: `limit` is brought into 1 to `MAX`.
const MAX_PAGE: u32 = 500;
const DEFAULT_PAGE: u32 = 50;

fn page_limit(limit: Option<u32>) -> u32 {
    limit.unwrap_or(DEFAULT_PAGE).clamp(1, MAX_PAGE)
}

/// A query string; what is wrong with it becomes a problem.
#[derive(FromRequestParts)]
#[from_request(via(axum::extract::Query), rejection(Problem))]
struct Query<T>(T);

/// What is named in the path; what is wrong with it becomes a problem.
#[derive(FromRequestParts)]
#[from_request(via(axum::extract::Path), rejection(Problem))]
struct Path<T>(T);

/// The asset in the path, noted in the request's span.
struct Asset(String);

impl<S: Send + Sync> FromRequestParts<S> for Asset {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let Path::<String>(asset) = Path::from_request_parts(parts, state).await?;
        layers::about(&asset);
        Ok(Self(asset))
    }
}

/// The same with what of it is meant: a fault code, the id of a calibration.
struct OfAsset(String, String);

impl<S: Send + Sync> FromRequestParts<S> for OfAsset {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let Path((asset, of)): Path<(String, String)> =
            Path::from_request_parts(parts, state).await?;
        layers::about(&asset);
        Ok(Self(asset, of))
    }
}

/// Which page of a list.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
struct PageQuery {
    /// `next` of the page before.
    cursor: Option<String>,
    /// Items on the page, brought into 1 to 500; 50 without it.
    #[param(format = Int64, maximum = 4_294_967_295_u32)]
    limit: Option<u32>,
}

/// Every operation, with the right that it takes.
fn api() -> Guarded {
    use Right::{Administer, Conduct, Feed, Known, Open, Operate, Read, ReadAsset};
    let v1 = Guarded::new(Document::default())
        .routes(Read, routes!(assets::list))
        .routes(Operate, routes!(assets::create))
        .routes(ReadAsset, routes!(assets::get))
        .routes(Operate, routes!(assets::put))
        .routes(Administer, routes!(assets::delete))
        .routes(ReadAsset, routes!(assets::state))
        .routes(Read, routes!(assets::trends))
        .routes(ReadAsset, routes!(drive_cycles::get))
        .routes(Read, routes!(assets::fleet))
        .routes(Feed, routes!(telemetry::post))
        .routes(ReadAsset, routes!(stream::stream))
        .routes(ReadAsset, routes!(faults::of_asset))
        .routes(ReadAsset, routes!(faults::get))
        .routes(Operate, routes!(faults::clear))
        .routes(Operate, routes!(faults::acknowledge))
        .routes(Read, routes!(faults::recording))
        .routes(Read, routes!(faults::history))
        .routes(Read, routes!(faults::of_fleet))
        .routes(ReadAsset, routes!(events::events))
        .routes(Conduct, routes!(sessions::open))
        .routes(Operate, routes!(sessions::import))
        .routes(ReadAsset, routes!(sessions::list))
        .routes(ReadAsset, routes!(sessions::get))
        .routes(Administer, routes!(sessions::delete))
        .routes(Conduct, routes!(sessions::end))
        .routes(Read, routes!(sessions::telemetry))
        .routes(ReadAsset, routes!(sessions::faults))
        .routes(Read, routes!(traces::trace))
        .routes(Operate, routes!(replays::create))
        .routes(Read, routes!(replays::get))
        .routes(Read, routes!(calibrations::list))
        .routes(Operate, routes!(calibrations::create))
        .routes(Read, routes!(calibrations::get))
        .routes(Operate, routes!(calibrations::activate))
        .routes(ReadAsset, routes!(learning::get))
        .routes(Operate, routes!(learning::accept))
        .routes(Operate, routes!(learning::discard))
        .routes(Administer, routes!(tokens::list, tokens::create))
        .routes(Administer, routes!(tokens::get, tokens::revoke))
        .routes(Administer, routes!(tokens::audit))
        .routes(Open, routes!(login::log_in))
        .routes(Known, routes!(login::get, login::log_out));
    Guarded::new(Api::openapi())
        .routes(Open, routes!(operations::healthz))
        .routes(Open, routes!(operations::readyz))
        .routes(Read, routes!(metrics::metrics))
        .nest("/api/v1", v1)
}

/// What else the router has; it is the same for everyone, everywhere.
const OPEN_PAGES: [&str; 5] =
    ["/openapi.yaml", "/openapi.json", "/docs", "/docs/", "/docs/{*rest}"];

/// The description of the interface.
#[must_use]
pub fn openapi() -> Document {
    description::complete(api().split().1)
}

/// The description of the interface as YAML, as committed in `openapi.yaml`.
#[must_use]
pub fn openapi_yaml() -> String {
    openapi().to_yaml().unwrap_or_else(|error| format!("# {error}\n"))
}

/// The whole of what is served, with `more` beside the interface.
pub fn router(app: App, more: More) -> Router {
    let (router, document) = api().split();
    let document = description::complete(document);
    let mut rules = Rules::new(&document, &more);
    OPEN_PAGES.iter().for_each(|path| rules.open(path));
    let yaml: Arc<str> = document.to_yaml().unwrap_or_default().into();
    let policy = app.policy.clone();
    let guard = Arc::new(Guard { app: app.clone(), rules });
    let router = router
        .route("/openapi.yaml", axum::routing::get(move || operations::openapi(yaml)))
        .merge(SwaggerUi::new("/docs").url("/openapi.json", document))
        .fallback(page::serve)
        .method_not_allowed_fallback(problem::method_not_allowed)
        .with_state(app)
        .merge(more.router)
        .layer(axum::middleware::from_fn_with_state(guard, guard::guard));
    layers::around(router, &policy)
}
