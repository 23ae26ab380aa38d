//! The HTTP and WebSocket interface.
//!
//! Handlers read a request, ask the service, and show the answer; what goes
//! wrong becomes a `problem+json` in one place. Knows no SQL and no engine.

mod assets;
mod body;
mod calibrations;
mod events;
mod faults;
mod layers;
mod operations;
mod page;
mod problem;
mod replays;
mod sessions;
mod stream;
mod telemetry;
mod traces;

use std::sync::Arc;

use axum::Router;
use axum::extract::{FromRef, FromRequestParts};
use serde::Deserialize;
use tokio_util::sync::CancellationToken;
use utoipa::OpenApi;
use utoipa::openapi::{Content, OpenApi as Document, RefOr};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;
use utoipa_swagger_ui::SwaggerUi;

pub use body::Budget;
pub use operations::gather_metrics;
pub use problem::Problem;

use crate::service::Service;

/// What the handlers share.
#[derive(Clone)]
pub struct App {
    pub service: Service,
    /// Bytes of request bodies in memory.
    pub budget: Budget,
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
    tags(
        (name = "assets", description = "The registry of rigs"),
        (name = "telemetry", description = "Samples in"),
        (name = "faults", description = "Fault memory"),
        (name = "sessions", description = "Recordings"),
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

/// Which page of a list.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
struct PageQuery {
    /// `next` of the page before.
    cursor: Option<String>,
    /// Items on the page, 1 to 500; 50 without it.
    limit: Option<u32>,
}

fn api() -> OpenApiRouter<App> {
    let v1 = OpenApiRouter::new()
        .routes(routes!(assets::list, assets::create))
        .routes(routes!(assets::get, assets::put, assets::delete))
        .routes(routes!(assets::state))
        .routes(routes!(assets::trends))
        .routes(routes!(assets::fleet))
        .routes(routes!(telemetry::post))
        .routes(routes!(stream::stream))
        .routes(routes!(faults::of_asset))
        .routes(routes!(faults::get, faults::clear))
        .routes(routes!(faults::acknowledge))
        .routes(routes!(faults::recording))
        .routes(routes!(faults::history))
        .routes(routes!(faults::of_fleet))
        .routes(routes!(events::events))
        .routes(routes!(sessions::open))
        .routes(routes!(sessions::import))
        .routes(routes!(sessions::list))
        .routes(routes!(sessions::get, sessions::delete))
        .routes(routes!(sessions::end))
        .routes(routes!(sessions::telemetry))
        .routes(routes!(sessions::faults))
        .routes(routes!(traces::trace))
        .routes(routes!(replays::create))
        .routes(routes!(replays::get))
        .routes(routes!(calibrations::list, calibrations::create))
        .routes(routes!(calibrations::get))
        .routes(routes!(calibrations::activate));
    OpenApiRouter::with_openapi(Api::openapi())
        .routes(routes!(operations::healthz))
        .routes(routes!(operations::readyz))
        .routes(routes!(operations::metrics))
        .nest("/api/v1", v1)
}

/// The description of the interface.
#[must_use]
pub fn openapi() -> Document {
    described(api().into_openapi())
}

/// The document with the media type of problems put right.
fn described(mut document: Document) -> Document {
    let items = document.paths.paths.values_mut();
    let operations = items.flat_map(|item| {
        [&mut item.get, &mut item.put, &mut item.post, &mut item.delete].into_iter().flatten()
    });
    for response in operations.flat_map(|operation| operation.responses.responses.values_mut()) {
        let RefOr::T(response) = response else { continue };
        let of_problem = |content: &RefOr<Content>| {
            let RefOr::T(Content { schema: Some(RefOr::Ref(schema)), .. }) = content else {
                return false;
            };
            schema.ref_location.ends_with("/Problem")
        };
        if response.content.get("application/json").is_some_and(of_problem)
            && let Some(content) = response.content.swap_remove("application/json")
        {
            response.content.insert("application/problem+json".to_owned(), content);
        }
    }
    document
}

/// The description of the interface as YAML, as committed in `openapi.yaml`.
#[must_use]
pub fn openapi_yaml() -> String {
    openapi().to_yaml().unwrap_or_else(|error| format!("# {error}\n"))
}

/// The whole of what is served, with `more` beside the interface.
pub fn router(app: App, more: Router) -> Router {
    let (router, document) = api().split_for_parts();
    let document = described(document);
    let yaml: Arc<str> = document.to_yaml().unwrap_or_default().into();
    let router = router
        .route("/openapi.yaml", axum::routing::get(move || operations::openapi(yaml)))
        .merge(SwaggerUi::new("/docs").url("/openapi.json", document))
        .fallback(page::serve)
        .method_not_allowed_fallback(problem::method_not_allowed)
        .with_state(app)
        .merge(more);
    layers::around(router)
}
