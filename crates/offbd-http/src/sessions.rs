//! `/sessions`: opening, ending, importing, listing and exporting sessions.

use std::collections::HashMap;

use axum::body::{Body, Bytes};
use axum::extract::State;
use axum::http::header::{CONTENT_DISPOSITION, CONTENT_TYPE, LOCATION};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use axum::{Extension, Json};
use futures_util::{Stream, StreamExt};
use serde::Deserialize;

use super::body::BodyShare;
use super::gather::Gathering;
use super::import_files::{BodyKind, File};
use super::json_body::JsonBody;
use super::session_format::BinaryFile;
use super::{
    App, AssetPath, PageQuery, Path, Problem, Query, body, page_limit, query_columns, query_time,
    query_word, session_format, time_range,
};
use offbd_core::vocabulary::{Invalid, in_range};
use offbd_service::{RecordingReader, Route, Service, ServiceError, SessionListQuery};
use offbd_wire::inspection::InspectionView;
use offbd_wire::service::{ImportView, Page, SessionCalibrationView, SessionView};
use offbd_wire::session_file::{SessionFormat, SessionWriter};
use offbd_wire::table::{RATES_HZ, TableOptions};
use offbd_wire::verdict::FaultView;
use offbd_wire::words::{SessionSort, SessionState, VerdictFilter};

/// Row limit of an imported file.
const MAX_IMPORT_ROWS: usize = 2_000_000;

/// Time limit to receive an imported file, in multiples of the limit of a batch.
const IMPORT_TIMEOUT_FACTOR: u32 = 10;

#[derive(Debug, Default, Deserialize, utoipa::ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct NewSession {
    /// Name of the session, 1 to 200 bytes; the time of opening by default.
    name: Option<String>,
}

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct SessionsQuery {
    /// Only sessions of this asset.
    asset: Option<String>,
    #[param(value_type = Option<SessionState>)]
    state: Option<String>,
    /// Only sessions whose name begins with this.
    name: Option<String>,
    /// Only sessions that were opened at this time or later, RFC 3339.
    #[param(format = DateTime)]
    opened_from: Option<String>,
    /// Only sessions that were opened before this time, RFC 3339.
    #[param(format = DateTime)]
    opened_to: Option<String>,
    /// Only ended sessions in which a fault was, or was not, confirmed.
    #[param(value_type = Option<VerdictFilter>)]
    verdict: Option<String>,
    /// Only sessions of assets with this tag.
    tag: Option<String>,
    /// `-opened_at` (the newest first) by default.
    #[param(value_type = Option<SessionSort>)]
    sort: Option<String>,
    /// `next` of the previous page, which must have the same `sort`.
    cursor: Option<String>,
    /// Items per page, 1 to 500; 50 by default.
    #[param(format = Int32, minimum = 1, maximum = 500)]
    limit: Option<u32>,
}

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct ImportQuery {
    /// Name of the session; the time of the import by default.
    name: Option<String>,
    /// Whether the files of a form are one recording, in the order of their times; they must not
    /// overlap. A form with several files is refused otherwise.
    join: Option<bool>,
    /// Which columns are which quantities, such as `t_s=time/ms, x_m=ball_x/mm`: a sum of
    /// columns and constants for each, with `*NUMBER`, `/NUMBER` or `/UNIT` behind a column. By
    /// default, those of the asset file or the columns with the names of the quantities;
    /// `QUANTITY=none` leaves one out.
    columns: Option<String>,
    /// Rows a second of a file without a time.
    #[param(minimum = 0.001, maximum = 1000000)]
    rate: Option<f64>,
    /// Whether to import nothing, and to answer what the file holds and how its columns are
    /// probably to be read. The asset need not exist.
    dry_run: Option<bool>,
}

/// The files of an import, for the description of the interface.
#[derive(utoipa::ToSchema)]
#[expect(dead_code, reason = "only its schema is used")]
pub(super) struct ImportForm {
    /// The files.
    file: Vec<BinaryFile>,
}

impl ImportQuery {
    /// Checks that this request may have `files`.
    fn check(&self, files: &[File]) -> Result<(), Problem> {
        let (n, is_joined) = (files.len(), self.join == Some(true));
        if n > 1 && self.dry_run == Some(true) {
            let reason = format!("inspects one file at a time; the form has {n}");
            return Err(Invalid::new("?dry_run", reason).into());
        }
        if n > 1 && !is_joined {
            let reason =
                format!("must be true: the form has {n} files, which are one recording then");
            return Err(Invalid::new("?join", reason).into());
        }
        Ok(())
    }

    fn options(&self) -> Result<TableOptions, Problem> {
        let columns = query_columns(self.columns.as_deref())?;
        if let Some(rate) = self.rate {
            in_range("?rate", rate, RATES_HZ)?;
        }
        Ok(TableOptions { columns, rate_hz: self.rate, ..TableOptions::default() })
    }
}

impl SessionsQuery {
    fn parsed(self) -> Result<SessionListQuery, Problem> {
        let opened_from = query_time("?opened_from", self.opened_from.as_deref())?;
        let opened_to = query_time("?opened_to", self.opened_to.as_deref())?;
        if opened_from.is_some() && opened_to.is_some() && opened_to < opened_from {
            return Err(Invalid::new("?opened_to", "is before `opened_from`").into());
        }
        Ok(SessionListQuery {
            asset: self.asset,
            state: query_word("?state", self.state.as_deref())?,
            name: self.name,
            opened_from,
            opened_to,
            verdict: query_word("?verdict", self.verdict.as_deref())?,
            tag: self.tag,
            sort: query_word("?sort", self.sort.as_deref())?,
            cursor: self.cursor,
        })
    }
}

fn created<T: serde::Serialize>(id: &str, view: T) -> impl IntoResponse + use<T> {
    (StatusCode::CREATED, [(LOCATION, format!("/api/v1/sessions/{id}"))], Json(view))
}

/// Opens a session and ends the asset's open session. The body may be empty.
#[utoipa::path(post, path = "/assets/{asset}/sessions", tag = "sessions",
    operation_id = "open_session", params(("asset" = String, description = "Name of the asset")),
    request_body = Option<NewSession>,
    responses((status = 201, body = SessionView, headers(("Location"))), (status = 404, body = Problem),
        (status = 409, body = Problem, description = "A session of this name exists"),
        (status = 422, body = Problem)))]
pub(super) async fn open(
    State(app): State<App>,
    AssetPath(asset): AssetPath,
    JsonBody(request): JsonBody<NewSession>,
) -> Result<impl IntoResponse, Problem> {
    let session = app.service.open_session(&asset, request.name).await?;
    Ok(created(&session.id.clone(), session))
}

/// Imports a recorded file as a session: CSV or, in a build with these formats, Parquet and
/// Arrow (streams and files without compression), with the columns of the CSV file in any
/// numeric type, MCAP with JSON messages of the schema `offbd.Sample`, the first sheet of an Excel
/// workbook, in which a time may be a date, or a JSON document with rows or columns. A text may have
/// any usual encoding, separator and decimal sign, comments and lines before the table; other names,
/// units and a missing time are given by `columns` and `rate`. A form (`multipart/form-data`) has one
/// file, or with `join` several that are one recording.
/// If its clock starts again, each run becomes a session. Its samples are processed like live
/// telemetry. The asset's open session is ended first, and the new session is ended after
/// the last row; live telemetry of the asset gets 429 until then. Two files are read at a time,
/// others wait. Of a file that is damaged, ends too early or expands too far, or if the
/// connection is closed before the response, nothing is kept. The request may be compressed, with
/// `Content-Encoding: gzip` or `zstd`; the limit is for what it expands to.
#[utoipa::path(post, path = "/assets/{asset}/sessions/import", tag = "sessions",
    operation_id = "import_session",
    params(("asset" = String, description = "Name of the asset"), ImportQuery),
    request_body(content((String = "text/csv"), (BinaryFile = "application/octet-stream"),
        (BinaryFile = "application/vnd.apache.parquet"),
        (BinaryFile = "application/vnd.apache.arrow.stream"),
        (BinaryFile = "application/vnd.mcap"),
        (BinaryFile = "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet"),
        (ImportForm = "multipart/form-data"))),
    responses((status = 201, body = ImportView, headers(("Location"))),
        (status = 200, body = InspectionView, description = "With `dry_run`"),
        (status = 400, body = Problem),
        (status = 404, body = Problem), (status = 409, body = Problem),
        (status = 413, body = Problem), (status = 415, body = Problem)))]
pub(super) async fn import(
    State(app): State<App>,
    AssetPath(asset): AssetPath,
    Query(query): Query<ImportQuery>,
    Extension(share): Extension<BodyShare>,
    headers: HeaderMap,
    body: Body,
) -> Result<Response, Problem> {
    let kind = BodyKind::of(&headers)?;
    let options = query.options()?;
    let is_dry_run = query.dry_run == Some(true);
    let options = match app.service.asset(&asset).await {
        Ok(known) => options.of_rig(known.columns.as_deref()),
        Err(ServiceError::UnknownAsset { .. }) if is_dry_run => options,
        Err(error) => return Err(error.into()),
    };
    let limits = &app.service.limits().requests;
    let timeout = limits.body_timeout() * IMPORT_TIMEOUT_FACTOR;
    let read = body::read(&headers, body, limits.import_bytes, timeout, &share).await?;
    let mut files = kind.files(read, &share).await?;
    query.check(&files)?;
    if is_dry_run && let Some(file) = files.pop() {
        return Ok(Json(app.service.inspect(file.source, options).await?).into_response());
    }
    let (name, limit) = (query.name, MAX_IMPORT_ROWS);
    let imported = app.service.import(&asset, name, files, options, limit).await?;
    Ok(created(&imported.session.id.clone(), imported).into_response())
}

/// Lists sessions by the time at which they were opened. In a cluster, the open sessions of a
/// node that does not answer in time are listed as last stored, with fewer samples than it has
/// acknowledged.
#[utoipa::path(get, path = "/sessions", tag = "sessions", operation_id = "list_sessions",
    params(SessionsQuery),
    responses((status = 200, body = Page<SessionView>), (status = 400, body = Problem),
        (status = 404, body = Problem, description = "No such asset")))]
pub(super) async fn list(
    State(service): State<Service>,
    Query(query): Query<SessionsQuery>,
    gathering: Gathering,
) -> Result<Json<Page<SessionView>>, Problem> {
    let limit = page_limit(query.limit);
    let mut page = service.sessions(query.parsed()?, limit).await?;
    let is_elsewhere = |session: &SessionView| {
        session.state == SessionState::Open && service.route(&session.asset) != Route::Here
    };
    if gathering.is_needed() && page.items.iter().any(is_elsewhere) {
        let answers: Vec<(String, Option<Page<SessionView>>)> = gathering.ask_all().await;
        let known = answers.into_iter().filter_map(|(_, page)| page).flat_map(|page| page.items);
        take_latest(&mut page.items, known);
    }
    Ok(Json(page))
}

/// Replaces sessions by what their owner knows of them: it alone counts the samples that are not
/// in the tables yet.
fn take_latest(sessions: &mut [SessionView], known: impl Iterator<Item = SessionView>) {
    let mut at: HashMap<String, &mut SessionView> =
        sessions.iter_mut().map(|session| (session.id.clone(), session)).collect();
    for session in known {
        if let Some(listed) = at.get_mut(&session.id)
            && (session.samples, session.rejected) > (listed.samples, listed.rejected)
        {
            **listed = session;
        }
    }
}

/// Returns a session, with its verdict if it has ended. The verdict names the faults, and for each
/// monitor how long it has judged.
#[utoipa::path(get, path = "/sessions/{id}", tag = "sessions", operation_id = "get_session",
    params(("id" = String, description = "The service's id of the session")),
    responses((status = 200, body = SessionView), (status = 404, body = Problem)))]
pub(super) async fn get(
    State(service): State<Service>,
    Path(id): Path<String>,
) -> Result<Json<SessionView>, Problem> {
    Ok(Json(service.session(&id).await?))
}

/// Returns the calibration that a session is judged with: that of the rig when the session was
/// opened, whatever has been activated since. `calibration` is null if the rig was not calibrated.
#[utoipa::path(get, path = "/sessions/{id}/calibration", tag = "sessions",
    operation_id = "get_session_calibration",
    params(("id" = String, description = "The service's id of the session")),
    responses((status = 200, body = SessionCalibrationView), (status = 404, body = Problem)))]
pub(super) async fn calibration(
    State(service): State<Service>,
    Path(id): Path<String>,
) -> Result<Json<SessionCalibrationView>, Problem> {
    Ok(Json(service.session_calibration(&id).await?))
}

/// Deletes a session with its recording and transitions. The asset's fault memory is
/// not changed. The session is hidden immediately; the response is sent when all its data
/// are deleted. A deletion that takes longer than 60 s is answered with 503 and continues.
/// Opening a session of the same name before it has finished gets 409.
#[utoipa::path(delete, path = "/sessions/{id}", tag = "sessions",
    operation_id = "delete_session",
    params(("id" = String, description = "The service's id of the session")),
    responses((status = 204), (status = 404, body = Problem)))]
pub(super) async fn delete(
    State(service): State<Service>,
    Path(id): Path<String>,
) -> Result<StatusCode, Problem> {
    service.delete_session(&id).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Ends a session: evaluates the samples still in the reordering buffer and finalizes the
/// verdict. Has no effect on a session that has ended.
#[utoipa::path(post, path = "/sessions/{id}/end", tag = "sessions", operation_id = "end_session",
    params(("id" = String, description = "The service's id of the session")),
    responses((status = 200, body = SessionView), (status = 404, body = Problem)))]
pub(super) async fn end(
    State(service): State<Service>,
    Path(id): Path<String>,
) -> Result<Json<SessionView>, Problem> {
    Ok(Json(service.end_session(&id).await?))
}

/// The range of a recording.
#[derive(Debug, Default, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct RecordingRangeQuery {
    /// First time on the device's clock, s; the start of the session by default.
    from_s: Option<f64>,
    /// Last time on the device's clock, s; the end of the session by default.
    to_s: Option<f64>,
}

/// Returns the recording, or a stretch of it, in order of arrival: as CSV, or as `Accept`
/// prefers as JSON rows, a Parquet file, an Arrow stream or an MCAP file. The last three need
/// a build with these formats. An MCAP file also has what is judged of these samples.
#[utoipa::path(get, path = "/sessions/{id}/telemetry", tag = "sessions",
    operation_id = "get_session_telemetry",
    params(("id" = String, description = "The service's id of the session"),
        RecordingRangeQuery),
    responses((status = 200, content((String = "text/csv"),
            (offbd_wire::telemetry::RowsView = "application/json"),
            (BinaryFile = "application/vnd.apache.parquet"),
            (BinaryFile = "application/vnd.apache.arrow.stream"),
            (BinaryFile = "application/vnd.mcap")), headers(("Content-Disposition"))),
        (status = 400, body = Problem), (status = 404, body = Problem),
        (status = 406, body = Problem)))]
pub(super) async fn telemetry(
    State(service): State<Service>,
    Path(id): Path<String>,
    Query(query): Query<RecordingRangeQuery>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let format = session_format::negotiate(&headers, &SessionFormat::WRITTEN, SessionFormat::Csv)?;
    let range = time_range(query.from_s, query.to_s)?;
    let (session, info, recording) = service.recording(&id, range).await?;
    let file = format!("attachment; filename=\"{id}.{}\"", format.suffix());
    let writer = SessionWriter::new(format, &info, session.last_seq.is_some())?;
    let body = Body::from_stream(parts(recording, writer));
    let kind = session_format::content_type(format).to_owned();
    Ok(([(CONTENT_TYPE, kind), (CONTENT_DISPOSITION, file)], body).into_response())
}

/// Lists the fault transitions of a session, in order. Each transition has the time on the
/// device's clock and the evidence.
#[utoipa::path(get, path = "/sessions/{id}/faults", tag = "sessions",
    operation_id = "list_session_faults",
    params(("id" = String, description = "The service's id of the session"), PageQuery),
    responses((status = 200, body = Page<FaultView>), (status = 400, body = Problem),
        (status = 404, body = Problem)))]
pub(super) async fn faults(
    State(service): State<Service>,
    Path(id): Path<String>,
    Query(page): Query<PageQuery>,
) -> Result<Json<Page<FaultView>>, Problem> {
    let limit = page_limit(page.limit);
    Ok(Json(service.session_faults(&id, page.cursor.as_deref(), limit).await?))
}

/// The part of an export to send next.
enum ExportPart {
    Start(Vec<u8>),
    Rows,
    Done,
}

/// Streams the recording chunk by chunk. If the store fails, the response is aborted, so
/// that the client does not take it for complete.
fn parts(
    recording: RecordingReader,
    (writer, start): (SessionWriter, Vec<u8>),
) -> impl Stream<Item = Result<Bytes, std::io::Error>> + Send {
    let begin = (recording, Some(writer), ExportPart::Start(start));
    let parts =
        futures_util::stream::unfold(begin, |(mut recording, mut writer, part)| async move {
            let sent = match part {
                ExportPart::Start(start) => Ok(start),
                ExportPart::Rows => next_rows(&mut recording, &mut writer).await,
                ExportPart::Done => return None,
            };
            let next =
                if sent.is_ok() && writer.is_some() { ExportPart::Rows } else { ExportPart::Done };
            Some((sent.map(Bytes::from), (recording, writer, next)))
        });
    // The compression layer polls once more after the end.
    parts.fuse()
}

/// Returns the next rows of an export; at the end of the recording, takes the writer and
/// returns the end of the file.
async fn next_rows(
    recording: &mut RecordingReader,
    writer: &mut Option<SessionWriter>,
) -> Result<Vec<u8>, std::io::Error> {
    let samples = recording.next().await.map_err(std::io::Error::other)?;
    let written = match (samples, writer.as_mut()) {
        (Some(samples), Some(writer)) => writer.rows(&samples),
        _ => writer.take().map_or_else(|| Ok(Vec::new()), SessionWriter::end),
    };
    written.map_err(std::io::Error::other)
}
