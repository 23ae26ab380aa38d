//! `/sovd/version-info` and the components.

use axum::Json;
use axum::extract::State;
use serde_json::Value;

use super::{AssetPath, BASE, Problem, Query, SchemaQuery, answer};
use crate::MAX_PAGE;
use offbd_service::Service;
use offbd_wire::sovd::{
    SovdComponentView, SovdInfoView, SovdReferenceView, SovdReferencesView, SovdRootView,
    SovdVendorView, SovdVersionView,
};

/// Version of the standard whose shapes the adapter has.
const VERSION: &str = "1.1.0";

/// Returns the versions of SOVD that the service speaks, and the path of the entities. Every
/// client of SOVD begins here.
#[utoipa::path(get, path = "/version-info", tag = "sovd", operation_id = "sovd_version_info",
    params(SchemaQuery), responses((status = 200, body = SovdInfoView)))]
pub(super) async fn version_info(Query(query): Query<SchemaQuery>) -> Json<Value> {
    let vendor_info =
        SovdVendorView { name: "offbd".to_owned(), version: env!("CARGO_PKG_VERSION").to_owned() };
    let version =
        SovdVersionView { version: VERSION.to_owned(), base_uri: BASE.to_owned(), vendor_info };
    answer(&SovdInfoView { sovd_info: vec![version] }, "SovdInfo", &query)
}

/// Returns the path of the components, the only collection of entities. Every rig is a component;
/// there are no areas, apps or functions.
#[utoipa::path(get, path = "/v1", tag = "sovd", operation_id = "sovd_root",
    params(SchemaQuery), responses((status = 200, body = SovdRootView)))]
pub(super) async fn root(Query(query): Query<SchemaQuery>) -> Json<Value> {
    let components = format!("{BASE}/components");
    let view = SovdRootView { id: "offbd".to_owned(), name: "offbd".to_owned(), components };
    answer(&view, "SovdRoot", &query)
}

/// Lists the rigs, by name. All are in one response, because the standard has no pages.
#[utoipa::path(get, path = "/v1/components", tag = "sovd", operation_id = "sovd_components",
    params(SchemaQuery), responses((status = 200, body = SovdReferencesView)))]
pub(super) async fn components(
    State(service): State<Service>,
    Query(query): Query<SchemaQuery>,
) -> Result<Json<Value>, Problem> {
    let mut items = Vec::new();
    let mut cursor: Option<String> = None;
    // The standard has no pages; the number of assets is limited by the configuration.
    loop {
        let page = service.assets(None, cursor.as_deref(), MAX_PAGE).await?;
        items.extend(page.items.into_iter().map(|asset| SovdReferenceView {
            href: format!("{BASE}/components/{}", asset.name),
            id: asset.name.clone(),
            name: asset.name,
            category: None,
        }));
        cursor = page.next;
        if cursor.is_none() {
            return Ok(answer(&SovdReferencesView { items }, "SovdReferences", &query));
        }
    }
}

/// Returns a rig: the paths of what there is of it. They lead to its faults, data and bulk data.
#[utoipa::path(get, path = "/v1/components/{asset}", tag = "sovd",
    operation_id = "sovd_component",
    params(("asset" = String, description = "Name of the asset"), SchemaQuery),
    responses((status = 200, body = SovdComponentView), (status = 404, body = Problem)))]
pub(super) async fn component(
    State(service): State<Service>,
    AssetPath(asset): AssetPath,
    Query(query): Query<SchemaQuery>,
) -> Result<Json<Value>, Problem> {
    service.check_known(&asset).await?;
    let name = asset;
    let path = format!("{BASE}/components/{name}");
    let view = SovdComponentView {
        id: name.clone(),
        name,
        faults: format!("{path}/faults"),
        data: format!("{path}/data"),
        bulk_data: format!("{path}/bulk-data"),
    };
    Ok(answer(&view, "SovdComponent", &query))
}
