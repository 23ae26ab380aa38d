//! `/assets/{asset}/telemetry`: samples in.

use axum::Json;
use axum::body::Body;
use axum::extract::State;
use axum::http::header::CONTENT_TYPE;
use axum::http::{HeaderMap, StatusCode};
use serde::Deserialize;

use super::{App, Asset, Problem, Query, body};
use crate::wire::telemetry::{self, AckView, Batch, BatchError, RowsView};
use offbd_core::vocabulary::Invalid;

/// How a batch is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Json,
    Msgpack,
    Ndjson,
    Csv,
}

impl Format {
    /// The format that a request's `Content-Type` says; JSON without one.
    pub(super) fn of(headers: &HeaderMap) -> Result<Self, Problem> {
        let Some(header) = headers.get(CONTENT_TYPE) else { return Ok(Self::Json) };
        let text = header.to_str().unwrap_or_default();
        let essence = text.split(';').next().unwrap_or_default().trim().to_ascii_lowercase();
        match essence.as_str() {
            "application/json" => Ok(Self::Json),
            "application/msgpack" | "application/vnd.msgpack" | "application/x-msgpack" => {
                Ok(Self::Msgpack)
            }
            "application/x-ndjson" | "application/ndjson" | "application/jsonl" => Ok(Self::Ndjson),
            "text/csv" => Ok(Self::Csv),
            _ => Err(unsupported(text)),
        }
    }

    /// The format of a binary frame: MessagePack begins with the mark of a map,
    /// which no JSON begins with.
    pub(super) fn of_bytes(document: &[u8]) -> Self {
        match document.first() {
            Some(0x80..=0x8f | 0xde | 0xdf) => Self::Msgpack,
            _ => Self::Json,
        }
    }

    pub(super) fn parse(self, document: &[u8], limit: usize) -> Result<Batch, BatchError> {
        match self {
            Self::Json => telemetry::json(document, limit),
            Self::Msgpack => telemetry::msgpack(document, limit),
            Self::Ndjson => telemetry::ndjson(document, limit),
            Self::Csv => telemetry::csv(document, limit),
        }
    }
}

fn unsupported(found: &str) -> Problem {
    let detail = format!(
        "`{found}` is not taken; take application/json, application/msgpack, \
         application/x-ndjson or text/csv"
    );
    let title = "No such format";
    Problem::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, "media-type", title, detail)
}

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct SessionQuery {
    /// The device's name of the session, for formats that have no place for it.
    session: Option<String>,
}

/// Takes a batch of samples. Answered once it is durable.
///
/// JSON rows as below, or columns (`{"t_s":[…],"x_m":[…],…}`), the same document
/// as MessagePack, NDJSON with one sample a line, or CSV with the header of a
/// session file. A row that is no sample is reported by its index and the others
/// are taken. A sample is known by `seq` within its session, or by `t_s` where it
/// has no `seq`; sent twice, it counts once.
///
/// Without the name of a session the samples go to the asset's open session,
/// or to a new one. When the clock of such a device falls back by more than
/// 10 s, and with it its `seq`, it has started anew: a new session begins.
/// Another name than that of the open session ends that and opens the other.
#[utoipa::path(post, path = "/assets/{asset}/telemetry", tag = "telemetry",
    operation_id = "post_telemetry",
    params(("asset" = String, description = "Name of the asset"), SessionQuery),
    request_body(content((RowsView = "application/json"), (RowsView = "application/msgpack"),
        (String = "application/x-ndjson"), (String = "text/csv"))),
    responses((status = 200, body = AckView, description = "Durable"),
        (status = 400, body = Problem, description = "Not a batch; `pointer` names the place"),
        (status = 404, body = Problem, description = "No such asset"),
        (status = 408, body = Problem, description = "The body did not end in time"),
        (status = 409, body = Problem, description = "The session has ended"),
        (status = 413, body = Problem, description = "Too long"),
        (status = 415, body = Problem, description = "Another format"),
        (status = 422, body = Problem, description = "Not the name of a session"),
        (status = 429, body = Problem, description = "Too much at once; `Retry-After` says when"),
        (status = 503, body = Problem, description = "Not taken; `Retry-After` says when")))]
pub(super) async fn post(
    State(app): State<App>,
    Asset(asset): Asset,
    Query(query): Query<SessionQuery>,
    headers: HeaderMap,
    body: Body,
) -> Result<Json<AckView>, Problem> {
    let format = Format::of(&headers)?;
    let limits = app.service.limits();
    let read = body::read(body, limits.batch_bytes, limits.body_timeout, &app.budget).await?;
    let mut batch = format.parse(&read.bytes, limits.batch_samples)?;
    drop(read);
    batch.session = one_session(batch.session, query.session)?;
    Ok(Json(app.service.submit(&asset, batch)?.acknowledged().await?))
}

fn one_session(body: Option<String>, query: Option<String>) -> Result<Option<String>, Problem> {
    match (body, query) {
        (Some(body), Some(query)) if body != query => {
            let reason = format!("is `{body}`, but the address says `{query}`");
            Err(Invalid::new("/session", reason).into())
        }
        (body, query) => Ok(body.or(query)),
    }
}
