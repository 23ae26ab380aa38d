//! The values of a component: the state and the description of a rig.

use axum::Json;
use axum::extract::State;
use serde_json::Value;

use super::{AssetItemPath, AssetPath, BASE, Problem, Query, SchemaQuery, answer};
use offbd_service::Service;
use offbd_wire::problem::UNKNOWN_DATA;
use offbd_wire::sovd::{SovdDataView, SovdReferenceView, SovdReferencesView, SovdValueView};

/// Id, name and category of each value.
const VALUES: [(&str, &str, &str); 2] = [
    ("state", "State of rig and twin", "currentData"),
    ("description", "Description of the rig, with its calibration", "identData"),
];

/// Lists the values of a rig. There are two: the state of rig and twin, and the description of the
/// rig with its calibration.
#[utoipa::path(get, path = "/v1/components/{asset}/data", tag = "sovd",
    operation_id = "sovd_data_list",
    params(("asset" = String, description = "Name of the asset"), SchemaQuery),
    responses((status = 200, body = SovdReferencesView), (status = 404, body = Problem)))]
pub(super) async fn list(
    State(service): State<Service>,
    AssetPath(asset): AssetPath,
    Query(query): Query<SchemaQuery>,
) -> Result<Json<Value>, Problem> {
    service.check_known(&asset).await?;
    let name = asset;
    let item = |(id, title, category): (&str, &str, &str)| SovdReferenceView {
        id: id.to_owned(),
        name: title.to_owned(),
        category: Some(category.to_owned()),
        href: format!("{BASE}/components/{name}/data/{id}"),
    };
    let items = VALUES.into_iter().map(item).collect();
    Ok(answer(&SovdReferencesView { items }, "SovdReferences", &query))
}

/// Returns a value of a rig. `state` is the response of `/assets/{asset}/state`, and `description`
/// the asset file.
#[utoipa::path(get, path = "/v1/components/{asset}/data/{data}", tag = "sovd",
    operation_id = "sovd_data",
    params(("asset" = String, description = "Name of the asset"),
        ("data" = String, description = "`state` or `description`"), SchemaQuery),
    responses((status = 200, body = SovdDataView), (status = 404, body = Problem)))]
pub(super) async fn get(
    State(service): State<Service>,
    AssetItemPath(asset, id): AssetItemPath,
    Query(query): Query<SchemaQuery>,
) -> Result<Json<Value>, Problem> {
    let data = match id.as_str() {
        "state" => SovdValueView::State(Box::new(service.state(&asset).await?)),
        "description" => SovdValueView::Description(Box::new(service.asset(&asset).await?)),
        _ => {
            service.check_known(&asset).await?;
            let detail = format!("there is no value `{id}`; there are state and description");
            return Err(Problem::new(UNKNOWN_DATA, detail));
        }
    };
    Ok(answer(&SovdDataView { id, data, errors: Vec::new() }, "SovdData", &query))
}
