//! `/sovd`: the fleet in the shape of SOVD (ISO 17978-3), for clients that speak it.
//!
//! An adapter: it makes the same requests to the service, under the same rights, as the
//! interface below `/api/v1`, and names the results differently. A component is a rig. Locks
//! are not offered, because they would not exclude: see `docs/operations/sovd.md`. Nor are areas,
//! apps, functions, operations, modes and updates.

mod data;
mod entities;
mod faults;
mod recordings;

use axum::Json;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::openapi::OpenApi as Document;
use utoipa_axum::routes;

use super::routes::GuardedRouter;
use super::{AssetItemPath, AssetPath, Problem, Query, json_schema};
use offbd_service::access::Right;

/// Path below which the entities are.
const BASE: &str = "/sovd/v1";

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
struct SchemaQuery {
    /// Whether the answer has its JSON schema, as `schema`; `false` by default.
    #[serde(rename = "include-schema", default)]
    #[param(rename = "include-schema", required = false)]
    include_schema: bool,
}

/// Returns the routes, each with the right that it requires.
pub(super) fn routes() -> GuardedRouter {
    use Right::{Operate, Public, Read, ReadAsset};
    GuardedRouter::new(Document::default())
        .routes(Public, routes!(entities::version_info))
        .routes(Read, routes!(entities::root))
        .routes(Read, routes!(entities::components))
        .routes(ReadAsset, routes!(entities::component))
        .routes(ReadAsset, routes!(faults::list))
        .routes(Operate, routes!(faults::clear_all))
        .routes(ReadAsset, routes!(faults::get))
        .routes(Operate, routes!(faults::clear))
        .routes(ReadAsset, routes!(data::list))
        .routes(ReadAsset, routes!(data::get))
        .routes(ReadAsset, routes!(recordings::categories))
        .routes(ReadAsset, routes!(recordings::list))
        .routes(Read, routes!(recordings::get))
}

/// Returns `view` as JSON, with the schema of its type `name` if asked for.
fn answer(view: &impl Serialize, name: &str, query: &SchemaQuery) -> Json<Value> {
    let mut json = serde_json::to_value(view).unwrap_or_default();
    if query.include_schema {
        json["schema"] = json_schema::of(name);
    }
    Json(json)
}
