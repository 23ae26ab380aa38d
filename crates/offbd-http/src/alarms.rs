//! `/alarms`, `/advice` and the mutes of monitors.

use axum::extract::State;
use axum::http::StatusCode;
use axum::{Extension, Json};
use serde::Deserialize;

use super::edition::{IfMatch, Tagged, with_tag};
use super::faults::ActorQuery;
use super::json_body::JsonBody;
use super::{App, AssetItemPath, AssetPath, Path, Problem, Query, page_limit, query_word};
use offbd_core::vocabulary::Invalid;
use offbd_service::access::Caller;
use offbd_service::{AlarmQuery, Service, parse_timestamp};
use offbd_wire::alarm::{
    AcknowledgeView, AcknowledgedView, AdviceListView, AlarmView, MuteView, NewMuteView,
    NewNoteView, NoteView,
};
use offbd_wire::service::Page;
use offbd_wire::words::{AlarmCodeWord, AlarmStateFilter};

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct AlarmsQuery {
    /// `active` (failing, suspected or on record) by default.
    #[param(inline, value_type = Option<AlarmStateFilter>)]
    state: Option<String>,
    asset: Option<String>,
    #[param(value_type = Option<AlarmCodeWord>)]
    code: Option<String>,
    acknowledged: Option<bool>,
    /// Only alarms of assets with this tag.
    tag: Option<String>,
    /// Only alarms whose last change was at this time or later, RFC 3339.
    #[param(format = DateTime)]
    from: Option<String>,
    /// Only alarms whose last change was at this time or earlier, RFC 3339.
    #[param(format = DateTime)]
    to: Option<String>,
    /// `next` of the previous page.
    cursor: Option<String>,
    /// Items per page, clamped to 1 to 500; 50 by default.
    #[param(format = Int64, maximum = 4_294_967_295_u32)]
    limit: Option<u32>,
}

fn moment(name: &str, text: Option<&str>) -> Result<Option<i64>, Problem> {
    let parsed = text.map(parse_timestamp).transpose();
    Ok(parsed.map_err(|reason| Invalid::new(name, reason))?)
}

/// Lists the alarms of the fleet, the latest change first: faults that fail now, faults on
/// record, and rigs whose data stay away. A page may have fewer items than `limit` although
/// others follow; see `next`.
#[utoipa::path(get, path = "/alarms", tag = "alarms", operation_id = "list_alarms",
    params(AlarmsQuery),
    responses((status = 200, body = Page<AlarmView>), (status = 400, body = Problem),
        (status = 404, body = Problem, description = "No such code")))]
pub(super) async fn list(
    State(service): State<Service>,
    Query(query): Query<AlarmsQuery>,
) -> Result<Json<Page<AlarmView>>, Problem> {
    let AlarmsQuery { state, asset, code, acknowledged, tag, from, to, cursor, limit } = query;
    let query = AlarmQuery {
        state: query_word("?state", state.as_deref())?,
        asset,
        code: query_word("?code", code.as_deref())?,
        acknowledged,
        tag,
        from: moment("?from", from.as_deref())?,
        to: moment("?to", to.as_deref())?,
        cursor,
    };
    Ok(Json(service.alarms(query, page_limit(limit)).await?))
}

/// Size limit of a request to acknowledge alarms, bytes: 500 names of the greatest length in
/// escapes need half of it.
const MAX_ACKNOWLEDGE_BYTES: usize = 512 << 10;

/// Acknowledges the current occurrences of several alarms. Each succeeds or fails by itself.
#[utoipa::path(post, path = "/alarms/acknowledge", tag = "alarms",
    operation_id = "acknowledge_alarms", params(ActorQuery), request_body = AcknowledgeView,
    responses((status = 200, body = AcknowledgedView), (status = 400, body = Problem),
        (status = 422, body = Problem)))]
pub(super) async fn acknowledge(
    State(app): State<App>,
    Query(query): Query<ActorQuery>,
    Extension(caller): Extension<Caller>,
    JsonBody(request): JsonBody<AcknowledgeView, MAX_ACKNOWLEDGE_BYTES>,
) -> Result<Json<AcknowledgedView>, Problem> {
    Ok(Json(app.service.acknowledge_all(request, query.actor(&caller)).await?))
}

/// Returns what to do about each kind of alarm: checks in plain words, and the owner's notes. A
/// code has advice for each kind of fault, and for a fault whose kind is unknown (`kind` is null).
#[utoipa::path(get, path = "/advice", tag = "alarms", operation_id = "list_advice",
    responses((status = 200, body = AdviceListView)))]
pub(super) async fn advice(
    State(service): State<Service>,
) -> Result<Json<AdviceListView>, Problem> {
    Ok(Json(service.advice().await?))
}

/// Replaces the owner's note on a code; an empty text removes it. All users see the note beside
/// the checks. With `If-Match` it is replaced only if nobody has changed it meanwhile.
#[utoipa::path(put, path = "/advice/{code}/note", tag = "alarms", operation_id = "put_note",
    params(("code" = AlarmCodeWord, description = "Code of the alarm"), ActorQuery,
        ("If-Match" = Option<String>, Header), ("If-None-Match" = Option<String>, Header)),
    request_body = NewNoteView,
    responses((status = 200, body = NoteView, headers(("ETag"))), (status = 400, body = Problem),
        (status = 404, body = Problem), (status = 422, body = Problem)))]
pub(super) async fn put_note(
    State(app): State<App>,
    Path(code): Path<String>,
    Query(query): Query<ActorQuery>,
    Extension(caller): Extension<Caller>,
    IfMatch(expected): IfMatch,
    JsonBody(note): JsonBody<NewNoteView>,
) -> Result<Tagged<NoteView>, Problem> {
    let note = app.service.put_note(&code, note, query.actor(&caller), &expected).await?;
    Ok(with_tag(note.etag.clone(), note))
}

/// Lists the mutes of an asset that are in force. All are in one page. A mute that has expired is
/// not listed.
#[utoipa::path(get, path = "/assets/{asset}/mutes", tag = "alarms", operation_id = "list_mutes",
    params(("asset" = String, description = "Name of the asset")),
    responses((status = 200, body = Page<MuteView>), (status = 404, body = Problem)))]
pub(super) async fn mutes(
    State(service): State<Service>,
    AssetPath(asset): AssetPath,
) -> Result<Json<Page<MuteView>>, Problem> {
    Ok(Json(Page { items: service.mutes(&asset).await?, next: None }))
}

/// Mutes a monitor until a time: it is shown as not tested, and no notification of it is sent.
/// The fault memory records what it finds all the same.
#[utoipa::path(put, path = "/assets/{asset}/mutes/{code}", tag = "alarms",
    operation_id = "mute_monitor",
    params(("asset" = String, description = "Name of the asset"),
        ("code" = AlarmCodeWord, description = "Code of the alarm"), ActorQuery,
        ("If-Match" = Option<String>, Header), ("If-None-Match" = Option<String>, Header)),
    request_body = NewMuteView,
    responses((status = 200, body = MuteView, headers(("ETag"))), (status = 400, body = Problem),
        (status = 404, body = Problem), (status = 422, body = Problem)))]
pub(super) async fn mute(
    State(app): State<App>,
    AssetItemPath(asset, code): AssetItemPath,
    Query(query): Query<ActorQuery>,
    Extension(caller): Extension<Caller>,
    IfMatch(expected): IfMatch,
    JsonBody(new): JsonBody<NewMuteView>,
) -> Result<Tagged<MuteView>, Problem> {
    let mute = app.service.mute(&asset, &code, new, query.actor(&caller), &expected).await?;
    Ok(with_tag(mute.etag.clone(), mute))
}

/// Ends the mute of a monitor. Without one, the request has no effect.
#[utoipa::path(delete, path = "/assets/{asset}/mutes/{code}", tag = "alarms",
    operation_id = "unmute_monitor",
    params(("asset" = String, description = "Name of the asset"),
        ("code" = AlarmCodeWord, description = "Code of the alarm"),
        ("If-Match" = Option<String>, Header)),
    responses((status = 204), (status = 404, body = Problem)))]
pub(super) async fn unmute(
    State(service): State<Service>,
    AssetItemPath(asset, code): AssetItemPath,
    IfMatch(expected): IfMatch,
) -> Result<StatusCode, Problem> {
    service.unmute(&asset, &code, &expected).await?;
    Ok(StatusCode::NO_CONTENT)
}
