//! `/assets/{asset}/series` and `/annotations`: results over time, for charts.

use axum::Json;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::http::header::CONTENT_TYPE;
use axum::response::{IntoResponse, Response};
use serde::Deserialize;

use super::session_format;
use super::{AssetPath, Problem, Query, query_time, query_word};
use offbd_core::vocabulary::Invalid;
use offbd_service::{SeriesQuery, Service};
use offbd_wire::series::{AnnotationView, SeriesView, write_csv};
use offbd_wire::session_file::SessionFormat;
use offbd_wire::words::SeriesAggregate;

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct SeriesRangeQuery {
    /// Only sessions that were opened at this time or later, RFC 3339.
    #[param(format = DateTime)]
    from: Option<String>,
    /// Only sessions that were opened before this time, RFC 3339.
    #[param(format = DateTime)]
    to: Option<String>,
    /// Length of a step, s: one row for the sessions that were opened within it. Without it
    /// each session has a row.
    #[param(format = Int32, minimum = 1, maximum = 31_622_400)]
    step_s: Option<u32>,
    /// How the sessions of a step become one value; `mean` by default.
    #[param(value_type = Option<SeriesAggregate>)]
    aggregate: Option<String>,
}

/// Parses the query parameters `from` and `to`.
fn time_span(from: Option<&str>, to: Option<&str>) -> Result<(Option<i64>, Option<i64>), Problem> {
    let (from, to) = (query_time("?from", from)?, query_time("?to", to)?);
    if from.is_some() && to.is_some() && to < from {
        return Err(Invalid::new("?to", "is before `from`").into());
    }
    Ok((from, to))
}

/// Returns the results of the ended sessions of an asset over time: gain, offset and delay
/// of both servos, the size of the residual, the share of time for which each monitor could
/// judge, and the number of sessions with a fault. The rows are flat, as charts need them:
/// JSON, or CSV if `Accept` prefers `text/csv`. Nothing is judged again; the time series
/// within a session is its `trace`.
#[utoipa::path(get, path = "/assets/{asset}/series", tag = "assets", operation_id = "get_series",
    params(("asset" = String, description = "Name of the asset"), SeriesRangeQuery),
    responses((status = 200, content((SeriesView = "application/json"), (String = "text/csv"))),
        (status = 400, body = Problem), (status = 404, body = Problem),
        (status = 406, body = Problem),
        (status = 413, body = Problem, description = "More than 2000 sessions in the range")))]
pub(super) async fn series(
    State(service): State<Service>,
    AssetPath(asset): AssetPath,
    Query(query): Query<SeriesRangeQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let format = session_format::negotiate(&headers, &session_format::TABLES, SessionFormat::Json)?;
    let (from, to) = time_span(query.from.as_deref(), query.to.as_deref())?;
    let aggregate = query_word("?aggregate", query.aggregate.as_deref())?;
    let aggregate = aggregate.unwrap_or(SeriesAggregate::Mean);
    let wanted = SeriesQuery { from, to, step_s: query.step_s, aggregate };
    let view = service.series(&asset, wanted).await?;
    if format == SessionFormat::Json {
        return Ok(Json(view).into_response());
    }
    let mut text = Vec::new();
    // Writing to a vector cannot fail.
    let _ = write_csv(&mut text, &view);
    Ok(([(CONTENT_TYPE, session_format::content_type(format))], text).into_response())
}

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct AnnotationsQuery {
    /// Only transitions of this asset.
    asset: Option<String>,
    /// Only transitions at this time or later, RFC 3339.
    #[param(format = DateTime)]
    from: Option<String>,
    /// Only transitions before this time, RFC 3339.
    #[param(format = DateTime)]
    to: Option<String>,
    /// Most marks, 1 to 500, the latest ones; 500 by default.
    #[param(format = Int32, minimum = 1, maximum = 500)]
    limit: Option<u32>,
}

/// Lists fault transitions as marks on a chart, the latest first, with the fields that Grafana
/// expects of an annotation. The service does not judge again: these are the stored transitions,
/// at most `limit`.
#[utoipa::path(get, path = "/annotations", tag = "faults", operation_id = "list_annotations",
    params(AnnotationsQuery),
    responses((status = 200, body = Vec<AnnotationView>), (status = 400, body = Problem),
        (status = 404, body = Problem, description = "No such asset")))]
pub(super) async fn annotations(
    State(service): State<Service>,
    Query(query): Query<AnnotationsQuery>,
) -> Result<Json<Vec<AnnotationView>>, Problem> {
    let span = time_span(query.from.as_deref(), query.to.as_deref())?;
    let limit = query.limit.unwrap_or(super::MAX_PAGE);
    Ok(Json(service.annotations(query.asset.as_deref(), span, limit).await?))
}
