//! `/sessions/{id}/trace`: the time series of a session, for plotting and as a table.

use axum::Json;
use axum::body::{Body, Bytes};
use axum::extract::State;
use axum::http::HeaderMap;
use axum::http::header::{CONTENT_DISPOSITION, CONTENT_TYPE};
use axum::response::{IntoResponse, Response};
use futures_util::{Stream, StreamExt};
use serde::Deserialize;
use serde_json::json;

use super::session_format::{self, BinaryFile};
use super::{Path, Problem, Query, query_word, time_range};
use offbd_core::vocabulary::Invalid;
use offbd_service::{MAX_TRACE_POINTS, Service, TraceQuery, TraceReader};
use offbd_wire::service::ReplaySettingsView;
use offbd_wire::session_file::{SessionFormat, TraceWriter};
use offbd_wire::trace::TraceView;
use offbd_wire::words::ProfileWord;

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct TraceRangeQuery {
    /// Start on the device's clock, s; the start of the session by default.
    from_s: Option<f64>,
    /// End on the device's clock, s; the end of the session by default.
    to_s: Option<f64>,
    /// Most points to return as JSON, 1 to 20000; 5000 by default. A range with more points is
    /// decimated. A Parquet file and an Arrow stream have all points.
    #[param(format = Int32, minimum = 1, maximum = 20_000)]
    points: Option<u32>,
    /// The profile of the asset file by default.
    #[param(value_type = Option<ProfileWord>)]
    profile: Option<String>,
    /// Id of a calibration of the asset, or of the job that made it, to judge with instead of
    /// the one that was in use when the session was opened; `none` judges without any.
    calibration: Option<String>,
}

/// The value of `calibration` that asks for none.
const NO_CALIBRATION: &str = "none";

/// Returns the settings with a profile and the requested calibration.
fn settings(profile: Option<ProfileWord>, calibration: Option<String>) -> ReplaySettingsView {
    let without = calibration.as_deref() == Some(NO_CALIBRATION);
    ReplaySettingsView {
        profile,
        asset: without.then(|| json!({ "calibration": null })),
        calibration: calibration.filter(|_| !without),
        ..Default::default()
    }
}

/// The formats of a trace; the first is the one by default.
const FORMATS: [SessionFormat; 3] =
    [SessionFormat::Json, SessionFormat::Parquet, SessionFormat::Arrow];

/// Points of a trace without `points`.
const DEFAULT_POINTS: u32 = 5000;

/// Returns the time series of a session or of a part of it: positions, accelerations,
/// limits and gates of rig and twin. The service evaluates the recording again to compute
/// them, from its start or from a stored state of the engine shortly before the range;
/// nothing stored is changed, also with another calibration than the recorded one.
///
/// As `Accept` prefers, the answer is JSON, or a Parquet file or an Arrow stream with every
/// judged moment, whose columns are those of the JSON document: `x.nats` is `x_nats`. Their
/// metadata are those of the recording, and the `thresholds` (`offbd.thresholds`). They need a
/// build with these formats. The body breaks off if the recording cannot be read.
#[utoipa::path(get, path = "/sessions/{id}/trace", tag = "sessions",
    operation_id = "get_trace",
    params(("id" = String, description = "The service's id of the session"), TraceRangeQuery),
    responses((status = 200, content((TraceView = "application/json"),
            (BinaryFile = "application/vnd.apache.parquet"),
            (BinaryFile = "application/vnd.apache.arrow.stream")),
            headers(("Content-Disposition"))),
        (status = 400, body = Problem), (status = 404, body = Problem),
        (status = 406, body = Problem),
        (status = 413, body = Problem, description = "The range is too long"),
        (status = 422, body = Problem), (status = 429, body = Problem)))]
pub(super) async fn trace(
    State(service): State<Service>,
    Path(id): Path<String>,
    Query(query): Query<TraceRangeQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let format = session_format::negotiate(&headers, &FORMATS, SessionFormat::Json)?;
    let profile = query_word("?profile", query.profile.as_deref())?;
    let range = time_range(query.from_s, query.to_s)?;
    let settings = settings(profile, query.calibration);
    if format == SessionFormat::Json {
        let points = query.points.unwrap_or(DEFAULT_POINTS).clamp(1, MAX_TRACE_POINTS);
        let trace = service.trace(&id, TraceQuery { range, points, settings }).await?;
        return Ok(Json(trace).into_response());
    }
    if query.points.is_some() {
        let reason = "is for JSON only; this format has all points";
        return Err(Invalid::new("?points", reason).into());
    }
    let trace = service.whole_trace(&id, range, settings).await?;
    let writer = TraceWriter::new(format, &trace.info, &trace.thresholds)?;
    let file = format!("attachment; filename=\"{id}-trace.{}\"", format.suffix());
    let body = Body::from_stream(parts(trace, writer));
    let kind = session_format::content_type(format).to_owned();
    Ok(([(CONTENT_TYPE, kind), (CONTENT_DISPOSITION, file)], body).into_response())
}

/// Streams a trace block by block. If the recording cannot be read, the response is aborted,
/// so that the client does not take it for complete.
fn parts(
    trace: TraceReader,
    writer: TraceWriter,
) -> impl Stream<Item = Result<Bytes, std::io::Error>> + Send {
    let begin = (trace, Some(writer));
    let parts = futures_util::stream::unfold(begin, |(mut trace, writer)| async move {
        let mut writer = writer?;
        let (sent, writer) = match trace.next().await {
            Some(Ok(block)) => (writer.rows(&block), Some(writer)),
            Some(Err(error)) => return Some((Err(std::io::Error::other(error)), (trace, None))),
            None => (writer.end(), None),
        };
        Some((sent.map(Bytes::from).map_err(std::io::Error::other), (trace, writer)))
    });
    // The compression layer polls once more after the end.
    parts.fuse()
}
