//! `/assets/{asset}/telemetry`: ingest of samples.

use axum::body::Body;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::http::header::CONTENT_TYPE;
use axum::{Extension, Json};
use serde::Deserialize;

use super::body::BodyShare;
use super::forward::is_from_bus;
use super::{App, AssetPath, Problem, Query, body, query_columns};
use offbd_core::vocabulary::Invalid;
use offbd_wire::problem::MEDIA_TYPE;
use offbd_wire::table::TableOptions;
use offbd_wire::telemetry::{AckView, RowsView, TelemetryFormat, csv};

/// Returns the format in `Content-Type`; JSON without the header.
fn format(headers: &HeaderMap) -> Result<TelemetryFormat, Problem> {
    let header = headers.get(CONTENT_TYPE).map(|header| header.to_str().unwrap_or_default());
    header
        .map_or(Ok(TelemetryFormat::Json), TelemetryFormat::of_type)
        .map_err(|error| Problem::new(MEDIA_TYPE, error.to_string()))
}

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct SessionQuery {
    /// The device's session name, for formats without a field for it.
    session: Option<String>,
    /// Which columns of CSV are which quantities, as of an import; by default `columns` of the asset
    /// file, for a batch that has them all.
    columns: Option<String>,
}

/// Ingests a batch of samples. The response is sent once the batch is durable.
///
/// Formats: JSON rows as below; JSON columns (`{"t_s":[…],"x_m":[…],…}`); either document
/// as MessagePack; NDJSON with one sample per line; CSV with the columns of a session file, or
/// with those that `columns` or the asset file map.
/// An invalid row is reported by its index; the valid rows are ingested. Within a session
/// a sample is identified by `seq`, or by `t_s` if it has no `seq`. A sample that is sent
/// again with the same values is counted as a duplicate and ignored, so that a batch can be
/// retried safely; with other values it is rejected as a conflict.
///
/// The body may be compressed, with `Content-Encoding: gzip` or `zstd`; the limits are for what it
/// expands to.
///
/// Without a session name the samples are added to the asset's open session, or to a new
/// one: two conflicting samples in a row, or two whose clock has gone back by more than
/// 10 s to times that are not a gap of the recording, show that the device has restarted, and
/// a new session is opened; a device without session names should therefore wait for the
/// acknowledgement of its first batch after it has started. A session name other than that
/// of the open session ends the open session and opens one of that name.
///
/// A jump of the clock is followed once five samples in a row agree; a single wrong time
/// costs one sample. Samples that fill a gap later are recorded and not judged.
#[utoipa::path(post, path = "/assets/{asset}/telemetry", tag = "telemetry",
    operation_id = "post_telemetry",
    params(("asset" = String, description = "Name of the asset"), SessionQuery),
    request_body(content((RowsView = "application/json"), (RowsView = "application/msgpack"),
        (String = "application/x-ndjson"), (String = "text/csv"))),
    responses((status = 200, body = AckView, description = "Durable"),
        (status = 400, body = Problem,
            description = "Malformed batch; `pointer` names the element"),
        (status = 404, body = Problem, description = "No such asset"),
        (status = 408, body = Problem, description = "The body was not received in time"),
        (status = 409, body = Problem, description = "The session has ended"),
        (status = 413, body = Problem, description = "The batch is too long"),
        (status = 415, body = Problem, description = "Unsupported format or content coding"),
        (status = 422, body = Problem, description = "Invalid session name"),
        (status = 429, body = Problem, description = "Too many requests; see `Retry-After`"),
        (status = 503, body = Problem,
            description = "Not stored; retry after `Retry-After`")))]
pub(super) async fn post(
    State(app): State<App>,
    AssetPath(asset): AssetPath,
    Query(query): Query<SessionQuery>,
    Extension(share): Extension<BodyShare>,
    headers: HeaderMap,
    body: Body,
) -> Result<Json<AckView>, Problem> {
    let format = format(&headers)?;
    let limits = &app.service.limits().requests;
    let read = body::read(&headers, body, limits.batch_bytes, limits.body_timeout(), &share);
    let read = read.await?;
    let mut batch = match format {
        // What another node took from a bus has the names of the quantities.
        TelemetryFormat::Csv if !is_from_bus(&headers) => {
            let options = table_options(&app, &asset, query.columns.as_deref()).await?;
            csv(&read.bytes, &options, limits.batch_samples)?
        }
        _ if query.columns.is_some() => {
            return Err(Invalid::new("?columns", "applies to text/csv alone").into());
        }
        _ => format.parse(&read.bytes, limits.batch_samples)?,
    };
    drop(read);
    batch.session = session_name(batch.session, query.session)?;
    Ok(Json(app.service.submit(&asset, batch)?.acknowledged().await?))
}

/// Returns how CSV of the asset is read.
async fn table_options(
    app: &App,
    asset: &str,
    columns: Option<&str>,
) -> Result<TableOptions, Problem> {
    let options = TableOptions { columns: query_columns(columns)?, ..TableOptions::default() };
    let known = app.service.asset(asset).await?;
    Ok(options.of_rig(known.columns.as_deref()))
}

/// Returns the session name in body or query; an error if both have one and they differ.
fn session_name(body: Option<String>, query: Option<String>) -> Result<Option<String>, Problem> {
    match (body, query) {
        (Some(body), Some(query)) if body != query => {
            let reason = format!("`{body}` differs from `{query}` in the query");
            Err(Invalid::new("/session", reason).into())
        }
        (body, query) => Ok(body.or(query)),
    }
}
