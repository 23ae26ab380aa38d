//! The bulk data of a component: the recordings of a rig.

use axum::Json;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use serde_json::Value;

use super::{AssetItemPath, AssetPath, BASE, Problem, Query, SchemaQuery, answer};
use crate::session_format::BinaryFile;
use crate::{MAX_PAGE, Path, sessions};
use offbd_service::{Service, ServiceError, SessionListQuery};
use offbd_wire::service::SessionView;
use offbd_wire::sovd::{
    SovdRecordingView, SovdRecordingsView, SovdReferenceView, SovdReferencesView,
};

/// Returns the path of the recordings of an asset.
pub(super) fn path(asset: &str) -> String {
    format!("{BASE}/components/{asset}/bulk-data/recordings")
}

/// Lists the categories of bulk data of a rig: its recordings. There is one category.
#[utoipa::path(get, path = "/v1/components/{asset}/bulk-data", tag = "sovd",
    operation_id = "sovd_bulk_data",
    params(("asset" = String, description = "Name of the asset"), SchemaQuery),
    responses((status = 200, body = SovdReferencesView), (status = 404, body = Problem)))]
pub(super) async fn categories(
    State(service): State<Service>,
    AssetPath(asset): AssetPath,
    Query(query): Query<SchemaQuery>,
) -> Result<Json<Value>, Problem> {
    service.check_known(&asset).await?;
    let name = asset;
    let (id, title) = ("recordings".to_owned(), "Recordings".to_owned());
    let recordings = SovdReferenceView { id, name: title, category: None, href: path(&name) };
    let view = SovdReferencesView { items: vec![recordings] };
    Ok(answer(&view, "SovdReferences", &query))
}

/// Lists the recordings of a rig, the latest 500, newest first. If there are older ones,
/// `x-offbd-next` is the path of the next page of the service's own list.
#[utoipa::path(get, path = "/v1/components/{asset}/bulk-data/recordings", tag = "sovd",
    operation_id = "sovd_recordings",
    params(("asset" = String, description = "Name of the asset"), SchemaQuery),
    responses((status = 200, body = SovdRecordingsView), (status = 404, body = Problem)))]
pub(super) async fn list(
    State(service): State<Service>,
    AssetPath(asset): AssetPath,
    Query(query): Query<SchemaQuery>,
) -> Result<Json<Value>, Problem> {
    let wanted = SessionListQuery { asset: Some(asset.clone()), ..SessionListQuery::default() };
    let page = service.sessions(wanted, MAX_PAGE).await?;
    let item = |session: SessionView| SovdRecordingView {
        id: session.id.clone(),
        name: session.name.clone(),
        mimetype: "text/csv".to_owned(),
        creation_date: session.opened_at.clone(),
        href: format!("{}/{}", path(&asset), session.id),
        session: Box::new(session),
    };
    let items = page.items.into_iter().map(item).collect();
    let next = page.next.map(|cursor| {
        let mut query = form_urlencoded::Serializer::new(String::new());
        query.append_pair("asset", &asset).append_pair("cursor", &cursor);
        query.append_pair("limit", &MAX_PAGE.to_string());
        format!("/api/v1/sessions?{}", query.finish())
    });
    Ok(answer(&SovdRecordingsView { items, next }, "SovdRecordings", &query))
}

/// Returns a recording: as CSV, or as `Accept` prefers as JSON rows, a Parquet file, an Arrow
/// stream or an MCAP file. The last three need a build with these formats.
#[utoipa::path(get, path = "/v1/components/{asset}/bulk-data/recordings/{id}", tag = "sovd",
    operation_id = "sovd_recording",
    params(("asset" = String, description = "Name of the asset"),
        ("id" = String, description = "The service's id of the session")),
    responses((status = 200, content((String = "text/csv"),
            (offbd_wire::telemetry::RowsView = "application/json"),
            (BinaryFile = "application/vnd.apache.parquet"),
            (BinaryFile = "application/vnd.apache.arrow.stream"),
            (BinaryFile = "application/vnd.mcap")), headers(("Content-Disposition"))),
        (status = 404, body = Problem), (status = 406, body = Problem)))]
pub(super) async fn get(
    State(service): State<Service>,
    AssetItemPath(asset, id): AssetItemPath,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    if service.session(&id).await?.asset != asset {
        return Err(ServiceError::UnknownSession { id }.into());
    }
    let whole = Query(sessions::RecordingRangeQuery::default());
    sessions::telemetry(State(service), Path(id), whole, headers).await
}
