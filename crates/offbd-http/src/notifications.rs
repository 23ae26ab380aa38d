//! `/notifications`: channels, rules and deliveries.

use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use axum::http::header::LOCATION;
use axum::response::{IntoResponse, Response};
use serde::Deserialize;

use super::edition::{IfMatch, IfNoneMatch, Tagged, with_tag};
use super::json_body::JsonBody;
use super::{App, Path, Problem, Query, page_limit, query_word};
use offbd_core::vocabulary::Invalid;
use offbd_service::{DeliveryQuery, Service};
use offbd_wire::notification::{
    ChannelView, DeliveryView, MadeChannelView, NewChannelView, NewRuleView, RuleView,
};
use offbd_wire::service::Page;
use offbd_wire::words::DeliveryState;

const fn whole<T>(items: Vec<T>) -> Json<Page<T>> {
    Json(Page { items, next: None })
}

/// Returns the value of a body that must not be empty.
fn given<T>(body: JsonBody<Option<T>>) -> Result<T, Problem> {
    body.0.ok_or_else(|| Invalid::new("", "the body is empty").into())
}

/// Lists the channels of notifications, without their secrets. All are in one page.
#[utoipa::path(get, path = "/notifications/channels", tag = "notifications",
    operation_id = "list_channels", responses((status = 200, body = Page<ChannelView>)))]
pub(super) async fn channels(
    State(service): State<Service>,
) -> Result<Json<Page<ChannelView>>, Problem> {
    Ok(whole(service.channels().await?))
}

/// Creates a channel: a webhook, or e-mail. The secret of a webhook is returned only in this
/// response.
#[utoipa::path(post, path = "/notifications/channels", tag = "notifications",
    operation_id = "create_channel", request_body = NewChannelView,
    responses((status = 201, body = MadeChannelView, headers(("Location"))), (status = 400, body = Problem),
        (status = 409, body = Problem, description = "The name is taken, or too many channels"),
        (status = 422, body = Problem)))]
pub(super) async fn create_channel(
    State(app): State<App>,
    body: JsonBody<Option<NewChannelView>>,
) -> Result<impl IntoResponse, Problem> {
    let made = app.service.create_channel(given(body)?).await?;
    let location = format!("/api/v1/notifications/channels/{}", made.channel.id);
    Ok((StatusCode::CREATED, [(LOCATION, location)], Json(made)))
}

/// Returns a channel, without its secrets. Its `ETag` is for `If-Match` when it is replaced or
/// deleted.
#[utoipa::path(get, path = "/notifications/channels/{channel}", tag = "notifications",
    operation_id = "get_channel", params(("channel" = String, description = "Id of the channel")),
    responses((status = 200, body = ChannelView, headers(("ETag"))),
        (status = 404, body = Problem)))]
pub(super) async fn channel(
    State(service): State<Service>,
    Path(channel): Path<String>,
    known: IfNoneMatch,
) -> Result<Response, Problem> {
    let channel = service.channel(&channel).await?;
    Ok(known.answer(with_tag(channel.etag.clone(), channel)))
}

/// Replaces the settings of a channel. A secret or password that is not given stays.
#[utoipa::path(put, path = "/notifications/channels/{channel}", tag = "notifications",
    operation_id = "put_channel", params(("channel" = String, description = "Id of the channel"),
        ("If-Match" = Option<String>, Header)),
    request_body = NewChannelView,
    responses((status = 200, body = MadeChannelView, headers(("ETag"))),
        (status = 400, body = Problem), (status = 404, body = Problem),
        (status = 409, body = Problem, description = "The name is taken"),
        (status = 422, body = Problem)))]
pub(super) async fn put_channel(
    State(app): State<App>,
    Path(channel): Path<String>,
    IfMatch(expected): IfMatch,
    body: JsonBody<Option<NewChannelView>>,
) -> Result<Tagged<MadeChannelView>, Problem> {
    let made = app.service.put_channel(&channel, given(body)?, &expected).await?;
    Ok(with_tag(made.channel.etag.clone(), made))
}

/// Deletes a channel with its deliveries. A channel that a rule uses is not deleted: the response
/// is 409.
#[utoipa::path(delete, path = "/notifications/channels/{channel}", tag = "notifications",
    operation_id = "delete_channel",
    params(("channel" = String, description = "Id of the channel"),
        ("If-Match" = Option<String>, Header)),
    responses((status = 204), (status = 404, body = Problem),
        (status = 409, body = Problem, description = "A rule uses it")))]
pub(super) async fn delete_channel(
    State(service): State<Service>,
    Path(channel): Path<String>,
    IfMatch(expected): IfMatch,
) -> Result<StatusCode, Problem> {
    service.delete_channel(&channel, &expected).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Sends a test message to a channel. It takes the way of all messages; the delivery tells how
/// it went.
#[utoipa::path(post, path = "/notifications/channels/{channel}/test", tag = "notifications",
    operation_id = "test_channel",
    params(("channel" = String, description = "Id of the channel")),
    responses((status = 202, body = DeliveryView, headers(("Location"))), (status = 404, body = Problem)))]
pub(super) async fn test(
    State(service): State<Service>,
    Path(channel): Path<String>,
) -> Result<impl IntoResponse, Problem> {
    let delivery = service.test_channel(&channel).await?;
    let location = format!("/api/v1/notifications/deliveries/{}", delivery.id);
    Ok((StatusCode::ACCEPTED, [(LOCATION, location)], Json(delivery)))
}

/// Lists the rules in the order of their creation. All are in one page.
#[utoipa::path(get, path = "/notifications/rules", tag = "notifications",
    operation_id = "list_rules", responses((status = 200, body = Page<RuleView>)))]
pub(super) async fn rules(State(service): State<Service>) -> Result<Json<Page<RuleView>>, Problem> {
    Ok(whole(service.rules().await?))
}

/// Creates a rule, which is for the changes from now on. It selects changes by asset, tag and
/// code, and names the channel that gets a message of each.
#[utoipa::path(post, path = "/notifications/rules", tag = "notifications",
    operation_id = "create_rule", request_body = NewRuleView,
    responses((status = 201, body = RuleView, headers(("Location"))), (status = 400, body = Problem),
        (status = 409, body = Problem, description = "Too many rules"),
        (status = 422, body = Problem)))]
pub(super) async fn create_rule(
    State(app): State<App>,
    body: JsonBody<Option<NewRuleView>>,
) -> Result<impl IntoResponse, Problem> {
    let rule = app.service.create_rule(given(body)?).await?;
    let location = format!("/api/v1/notifications/rules/{}", rule.id);
    Ok((StatusCode::CREATED, [(LOCATION, location)], Json(rule)))
}

/// Returns a rule. Its `ETag` is for `If-Match` when it is replaced or deleted.
#[utoipa::path(get, path = "/notifications/rules/{rule}", tag = "notifications",
    operation_id = "get_rule", params(("rule" = String, description = "Id of the rule")),
    responses((status = 200, body = RuleView, headers(("ETag"))),
        (status = 404, body = Problem)))]
pub(super) async fn rule(
    State(service): State<Service>,
    Path(rule): Path<String>,
    known: IfNoneMatch,
) -> Result<Response, Problem> {
    let rule = service.rule(&rule).await?;
    Ok(known.answer(with_tag(rule.etag.clone(), rule)))
}

/// Replaces a rule. The body is the whole rule; an element that is left out has its default again.
#[utoipa::path(put, path = "/notifications/rules/{rule}", tag = "notifications",
    operation_id = "put_rule", params(("rule" = String, description = "Id of the rule"),
        ("If-Match" = Option<String>, Header)),
    request_body = NewRuleView,
    responses((status = 200, body = RuleView, headers(("ETag"))),
        (status = 400, body = Problem), (status = 404, body = Problem),
        (status = 422, body = Problem)))]
pub(super) async fn put_rule(
    State(app): State<App>,
    Path(rule): Path<String>,
    IfMatch(expected): IfMatch,
    body: JsonBody<Option<NewRuleView>>,
) -> Result<Tagged<RuleView>, Problem> {
    let rule = app.service.put_rule(&rule, given(body)?, &expected).await?;
    Ok(with_tag(rule.etag.clone(), rule))
}

/// Deletes a rule, with its reminders. Its channel is kept.
#[utoipa::path(delete, path = "/notifications/rules/{rule}", tag = "notifications",
    operation_id = "delete_rule", params(("rule" = String, description = "Id of the rule"),
        ("If-Match" = Option<String>, Header)),
    responses((status = 204), (status = 404, body = Problem)))]
pub(super) async fn delete_rule(
    State(service): State<Service>,
    Path(rule): Path<String>,
    IfMatch(expected): IfMatch,
) -> Result<StatusCode, Problem> {
    service.delete_rule(&rule, &expected).await?;
    Ok(StatusCode::NO_CONTENT)
}

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct DeliveriesQuery {
    /// Id of the channel; all channels by default.
    channel: Option<String>,
    #[param(inline, value_type = Option<DeliveryState>)]
    state: Option<String>,
    /// `next` of the previous page.
    cursor: Option<String>,
    /// Items per page, clamped to 1 to 500; 50 by default.
    #[param(format = Int64, maximum = 4_294_967_295_u32)]
    limit: Option<u32>,
}

/// Lists the deliveries, the latest first. Of each channel the last 1000 of each finished state
/// are kept.
#[utoipa::path(get, path = "/notifications/deliveries", tag = "notifications",
    operation_id = "list_deliveries", params(DeliveriesQuery),
    responses((status = 200, body = Page<DeliveryView>), (status = 400, body = Problem)))]
pub(super) async fn deliveries(
    State(service): State<Service>,
    Query(query): Query<DeliveriesQuery>,
) -> Result<Json<Page<DeliveryView>>, Problem> {
    let DeliveriesQuery { channel, state, cursor, limit } = query;
    let state = query_word("?state", state.as_deref())?;
    let query = DeliveryQuery { channel, state, cursor };
    Ok(Json(service.deliveries(query, page_limit(limit)).await?))
}

/// Returns a delivery. It has the number of attempts, the error of the last one, and the time of
/// the next.
#[utoipa::path(get, path = "/notifications/deliveries/{delivery}", tag = "notifications",
    operation_id = "get_delivery",
    params(("delivery" = String, description = "Id of the delivery")),
    responses((status = 200, body = DeliveryView), (status = 404, body = Problem)))]
pub(super) async fn delivery(
    State(service): State<Service>,
    Path(delivery): Path<String>,
) -> Result<Json<DeliveryView>, Problem> {
    Ok(Json(service.delivery(&delivery).await?))
}
