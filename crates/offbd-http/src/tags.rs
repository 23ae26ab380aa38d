//! `/tags` and the tags of an asset.

use axum::Json;
use axum::extract::State;
use axum::response::Response;

use super::edition::{IfMatch, IfNoneMatch, Tagged, tagged};
use super::json_body::JsonBody;
use super::{AssetPath, PageQuery, Problem, Query, page_limit};
use offbd_service::Service;
use offbd_wire::service::Page;
use offbd_wire::tag::{TagUseView, TagsView};

/// Lists the tags in use, in alphabetical order, each with the number of its assets. A tag that no
/// asset has any more is not listed.
#[utoipa::path(get, path = "/tags", tag = "assets", operation_id = "list_tags",
    params(PageQuery),
    responses((status = 200, body = Page<TagUseView>), (status = 400, body = Problem)))]
pub(super) async fn list(
    State(service): State<Service>,
    Query(PageQuery { cursor, limit }): Query<PageQuery>,
) -> Result<Json<Page<TagUseView>>, Problem> {
    Ok(Json(service.tags_in_use(cursor.as_deref(), page_limit(limit)).await?))
}

/// Returns the tags of an asset, in alphabetical order. Their `ETag` is for `If-Match` when they
/// are replaced.
#[utoipa::path(get, path = "/assets/{asset}/tags", tag = "assets", operation_id = "get_tags",
    params(("asset" = String, description = "Name of the asset")),
    responses((status = 200, body = TagsView, headers(("ETag"))),
        (status = 404, body = Problem)))]
pub(super) async fn get(
    State(service): State<Service>,
    AssetPath(asset): AssetPath,
    known: IfNoneMatch,
) -> Result<Response, Problem> {
    Ok(known.answer(tagged(service.tags(&asset).await?)))
}

/// Replaces the tags of an asset. They group assets in lists and in rules of notifications, and
/// change no verdict.
#[utoipa::path(put, path = "/assets/{asset}/tags", tag = "assets", operation_id = "put_tags",
    params(("asset" = String, description = "Name of the asset"),
        ("If-Match" = Option<String>, Header)),
    request_body = TagsView,
    responses((status = 200, body = TagsView, headers(("ETag"))),
        (status = 400, body = Problem), (status = 404, body = Problem),
        (status = 422, body = Problem, description = "Invalid tag; `pointer` names it")))]
pub(super) async fn put(
    State(service): State<Service>,
    AssetPath(asset): AssetPath,
    IfMatch(expected): IfMatch,
    JsonBody(tags): JsonBody<TagsView>,
) -> Result<Tagged<TagsView>, Problem> {
    Ok(tagged(service.put_tags(&asset, tags, &expected).await?))
}
