//! `/sessions`: recordings.

use std::cmp::Ordering;

use axum::Json;
use axum::body::{Body, Bytes};
use axum::extract::State;
use axum::http::header::{ACCEPT, CONTENT_DISPOSITION, CONTENT_TYPE, LOCATION};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use futures_util::{Stream, StreamExt};
use serde::Deserialize;

use super::negotiate::weight_of_first;
use super::telemetry::Format;
use super::{App, Asset, PageQuery, Path, Problem, Query, body, page_limit};
use crate::service::{Recording, Service, ServiceError};
use crate::wire::service::{ImportView, Page, SessionView};
use crate::wire::session_csv::{write_header, write_rows};
use crate::wire::telemetry::sample_view;
use crate::wire::verdict::FaultView;
use offbd_core::vocabulary::{Invalid, Sample};

/// Most rows of an imported file; a longer one is refused.
const MAX_IMPORT_ROWS: usize = 2_000_000;

/// How many times as long as a batch a file may take to arrive.
const FILE_TIMEOUT: u32 = 10;

/// Longest body that opens a session, bytes.
const MAX_SMALL_BYTES: usize = 16 << 10;

#[derive(Debug, Default, Deserialize, utoipa::ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct NewSession {
    /// 1 to 200 bytes; without it the moment of opening is the name.
    name: Option<String>,
}

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct SessionsQuery {
    /// Sessions of this asset alone.
    asset: Option<String>,
    /// `open` or `ended`.
    #[param(pattern = "^(open|ended)$")]
    state: Option<String>,
    /// `next` of the page before.
    cursor: Option<String>,
    /// Items on the page, brought into 1 to 500; 50 without it.
    #[param(format = Int64, maximum = 4_294_967_295_u32)]
    limit: Option<u32>,
}

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct ImportQuery {
    /// Name of the session; without it the moment of the import.
    name: Option<String>,
}

fn created<T: serde::Serialize>(id: &str, view: T) -> impl IntoResponse + use<T> {
    (StatusCode::CREATED, [(LOCATION, format!("/api/v1/sessions/{id}"))], Json(view))
}

/// Opens a session; the asset's open one is ended. The body may be empty.
#[utoipa::path(post, path = "/assets/{asset}/sessions", tag = "sessions",
    operation_id = "open_session", params(("asset" = String, description = "Name of the asset")),
    request_body = Option<NewSession>,
    responses((status = 201, body = SessionView), (status = 404, body = Problem),
        (status = 409, body = Problem, description = "The name is taken"),
        (status = 422, body = Problem)))]
pub(super) async fn open(
    State(app): State<App>,
    Asset(asset): Asset,
    body: Body,
) -> Result<impl IntoResponse, Problem> {
    let wanted: NewSession = small(&app, body).await?;
    let session = app.service.open_session(&asset, wanted.name).await?;
    Ok(created(&session.id.clone(), session))
}

/// A small JSON body, its default if it is empty or null.
pub(super) async fn small<T: Default + serde::de::DeserializeOwned>(
    app: &App,
    body: Body,
) -> Result<T, Problem> {
    let time = app.service.limits().body_timeout;
    let read = body::read(body, MAX_SMALL_BYTES, time, &app.budget).await?;
    if read.bytes.trim_ascii().is_empty() {
        return Ok(T::default());
    }
    crate::wire::asset::check_object(&read.bytes)?;
    let mut json = serde_json::Deserializer::from_slice(&read.bytes);
    let parsed: Option<T> = serde_path_to_error::deserialize(&mut json).map_err(|error| {
        let pointer = crate::wire::asset::pointer(error.path());
        Problem::from(Invalid::new(pointer, error.inner().to_string()))
    })?;
    json.end().map_err(|error| Problem::from(Invalid::new("", error.to_string())))?;
    Ok(parsed.unwrap_or_default())
}

/// Imports a recorded CSV as a session, by the path that live samples take. It
/// is ended with the file's end; the asset's open session is ended before, and
/// live telemetry of the asset has to wait.
#[utoipa::path(post, path = "/assets/{asset}/sessions/import", tag = "sessions",
    operation_id = "import_session",
    params(("asset" = String, description = "Name of the asset"), ImportQuery),
    request_body(content = String, content_type = "text/csv"),
    responses((status = 201, body = ImportView), (status = 400, body = Problem),
        (status = 404, body = Problem), (status = 409, body = Problem),
        (status = 413, body = Problem), (status = 415, body = Problem)))]
pub(super) async fn import(
    State(app): State<App>,
    Asset(asset): Asset,
    Query(query): Query<ImportQuery>,
    headers: HeaderMap,
    body: Body,
) -> Result<impl IntoResponse, Problem> {
    if headers.contains_key(CONTENT_TYPE) && Format::of(&headers)? != Format::Csv {
        let detail = "a recording is imported as text/csv";
        let status = StatusCode::UNSUPPORTED_MEDIA_TYPE;
        return Err(Problem::new(status, "media-type", "No such format", detail));
    }
    app.service.asset(&asset).await?;
    let limits = app.service.limits();
    let time = limits.body_timeout * FILE_TIMEOUT;
    let read = body::read(body, limits.import_bytes, time, &app.budget).await?;
    let parse = move || Format::Csv.parse(&read.bytes, MAX_IMPORT_ROWS);
    let parsed = tokio::task::spawn_blocking(parse).await;
    let failed = |_| ServiceError::Unavailable { what: "reading the file has failed" };
    let recording = parsed.map_err(failed)??;
    let imported = app.service.import(&asset, query.name, recording).await?;
    Ok(created(&imported.session.id.clone(), imported))
}

/// Lists sessions, newest first.
#[utoipa::path(get, path = "/sessions", tag = "sessions", operation_id = "list_sessions",
    params(SessionsQuery),
    responses((status = 200, body = Page<SessionView>), (status = 400, body = Problem)))]
pub(super) async fn list(
    State(service): State<Service>,
    Query(query): Query<SessionsQuery>,
) -> Result<Json<Page<SessionView>>, Problem> {
    if let Some(state) = query.state.as_deref().filter(|s| !matches!(*s, "open" | "ended")) {
        let reason = format!("`{state}` is not one of open, ended");
        return Err(Invalid::new("?state", reason).into());
    }
    let limit = page_limit(query.limit);
    Ok(Json(service.sessions(query.asset, query.state, query.cursor.as_deref(), limit).await?))
}

/// A session, with its verdict once it has ended.
#[utoipa::path(get, path = "/sessions/{id}", tag = "sessions", operation_id = "get_session",
    params(("id" = String, description = "The service's id of the session")),
    responses((status = 200, body = SessionView), (status = 404, body = Problem)))]
pub(super) async fn get(
    State(service): State<Service>,
    Path(id): Path<String>,
) -> Result<Json<SessionView>, Problem> {
    Ok(Json(service.session(&id).await?))
}

/// Deletes a session with its recording and transitions; the asset's fault
/// memory keeps what the session left in it. It is hidden at once; the answer comes
/// when all of it is gone. A deletion that takes longer than an answer may is answered
/// with 503 and goes on; until its end a new session of the name gets 409.
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

/// Ends a session: what waits is judged, the verdict is settled. One that has
/// ended stays as it is.
#[utoipa::path(post, path = "/sessions/{id}/end", tag = "sessions", operation_id = "end_session",
    params(("id" = String, description = "The service's id of the session")),
    responses((status = 200, body = SessionView), (status = 404, body = Problem)))]
pub(super) async fn end(
    State(service): State<Service>,
    Path(id): Path<String>,
) -> Result<Json<SessionView>, Problem> {
    Ok(Json(service.end_session(&id).await?))
}

/// The recording, in order of arrival: CSV, or JSON rows if `Accept` asks for
/// `application/json`.
#[utoipa::path(get, path = "/sessions/{id}/telemetry", tag = "sessions",
    operation_id = "get_recording",
    params(("id" = String, description = "The service's id of the session")),
    responses((status = 200, content((String = "text/csv"),
            (crate::wire::telemetry::RowsView = "application/json"))),
        (status = 404, body = Problem), (status = 406, body = Problem)))]
pub(super) async fn telemetry(
    State(service): State<Service>,
    Path(id): Path<String>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let form = Form::wanted(&headers, Form::Csv)?;
    let (session, recording) = service.recording(&id).await?;
    let file = format!("attachment; filename=\"{id}.{}\"", form.suffix());
    let with_seq = session.last_seq.is_some();
    let start = form.start(&session.name, with_seq);
    let body = Body::from_stream(parts(recording, form, start, with_seq));
    Ok(([(CONTENT_TYPE, form.kind().to_owned()), (CONTENT_DISPOSITION, file)], body)
        .into_response())
}

/// The changes of status in a session, in order.
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

/// How a recording is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    Csv,
    Json,
}

impl Form {
    /// The form that `Accept` asks for, `usual` if any will do.
    pub(super) fn wanted(headers: &HeaderMap, usual: Self) -> Result<Self, Problem> {
        let Some(accept) = headers.get(ACCEPT) else { return Ok(usual) };
        let accept = accept.to_str().unwrap_or_default();
        let json = weight_of_first(accept, &["application/json", "application/*", "*/*"]);
        let csv = weight_of_first(accept, &["text/csv", "text/*", "*/*"]);
        if json.max(csv) > 0.0 {
            return Ok(match json.total_cmp(&csv) {
                Ordering::Greater => Self::Json,
                Ordering::Less => Self::Csv,
                Ordering::Equal => usual,
            });
        }
        let detail = format!("`{accept}` is not there; there are text/csv and application/json");
        Err(Problem::new(StatusCode::NOT_ACCEPTABLE, "not-acceptable", "No such format", detail))
    }

    pub(super) const fn kind(self) -> &'static str {
        match self {
            Self::Csv => "text/csv; charset=utf-8",
            Self::Json => "application/json",
        }
    }

    const fn suffix(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Json => "json",
        }
    }

    fn start(self, session: &str, with_seq: bool) -> Vec<u8> {
        let mut bytes = Vec::new();
        match self {
            // A vector takes everything that is written to it.
            Self::Csv => drop(write_header(&mut bytes, with_seq)),
            Self::Json => {
                let name = serde_json::to_string(session).unwrap_or_default();
                bytes.extend(format!(r#"{{"session":{name},"samples":["#).into_bytes());
            }
        }
        bytes
    }

    /// The rows; in JSON with a comma before each but the very first.
    fn rows(self, samples: &[Sample], with_seq: bool, first: bool) -> Vec<u8> {
        let mut bytes = Vec::new();
        match self {
            Self::Csv => drop(write_rows(&mut bytes, samples, with_seq)),
            Self::Json => {
                for (i, sample) in samples.iter().enumerate() {
                    if i > 0 || !first {
                        bytes.push(b',');
                    }
                    let _ = serde_json::to_writer(&mut bytes, &sample_view(sample));
                }
            }
        }
        bytes
    }

    const fn end(self) -> &'static [u8] {
        match self {
            Self::Csv => b"",
            Self::Json => b"]}",
        }
    }
}

/// What of a recording has been sent.
enum Part {
    Start(Vec<u8>),
    First,
    More,
    Done,
}

/// The recording chunk by chunk. If the store fails in the middle, the answer
/// breaks off rather than look complete.
fn parts(
    recording: Recording,
    form: Form,
    start: Vec<u8>,
    with_seq: bool,
) -> impl Stream<Item = Result<Bytes, std::io::Error>> + Send {
    let begin = (recording, Part::Start(start));
    let parts = futures_util::stream::unfold(begin, move |(mut recording, part)| async move {
        let first = match part {
            Part::Start(start) => return Some((Ok(start.into()), (recording, Part::First))),
            Part::First => true,
            Part::More => false,
            Part::Done => return None,
        };
        match recording.next().await {
            Ok(Some(samples)) => {
                let rows = form.rows(&samples, with_seq, first);
                Some((Ok(rows.into()), (recording, Part::More)))
            }
            Ok(None) => Some((Ok(Bytes::from_static(form.end())), (recording, Part::Done))),
            Err(error) => Some((Err(std::io::Error::other(error)), (recording, Part::Done))),
        }
    });
    // Compression asks once more after the end.
    parts.fuse()
}
