//! The format of a recording in a request or a response, by `Accept` and `Content-Type`.

use std::fmt::Display;

use axum::http::HeaderMap;
use axum::http::header::{ACCEPT, CONTENT_TYPE};

use super::Problem;
use super::negotiate::weight_of_first;
use offbd_wire::problem::{MEDIA_TYPE, NOT_ACCEPTABLE};
use offbd_wire::session_file::{SessionFileError, SessionFormat};
use offbd_wire::telemetry::BatchError;

/// A file in a binary format, for the description of the interface.
#[derive(utoipa::ToSchema)]
#[schema(value_type = String, format = Binary)]
#[expect(dead_code, reason = "only its schema is used")]
pub(super) struct BinaryFile(Vec<u8>);

/// The formats of responses that are not whole sessions.
pub(super) const TABLES: [SessionFormat; 2] = [SessionFormat::Csv, SessionFormat::Json];

/// Returns the format of `offered` that `Accept` prefers; `default` if it prefers none.
///
/// # Errors
/// 406 if it accepts none that this build has.
pub(super) fn negotiate(
    headers: &HeaderMap,
    offered: &[SessionFormat],
    default: SessionFormat,
) -> Result<SessionFormat, Problem> {
    let Some(accept) = headers.get(ACCEPT) else { return Ok(default) };
    let accept = accept.to_str().unwrap_or_default();
    let others = offered.iter().copied().filter(|format| *format != default);
    let mut best = (default, weight(accept, default));
    let mut missing = None;
    for format in others {
        let weight = weight(accept, format);
        match format.check() {
            Ok(()) if weight > best.1 => best = (format, weight),
            Err(error) if weight > 0.0 => missing = Some(error),
            _ => {}
        }
    }
    if best.1 > 0.0 {
        return Ok(best.0);
    }
    let detail = missing.map_or_else(
        || format!("`{accept}` is not available; use {}", list(offered)),
        |error| error.to_string(),
    );
    Err(Problem::new(NOT_ACCEPTABLE, detail))
}

/// The weight of `format` in the header `Accept`.
fn weight(accept: &str, format: SessionFormat) -> f64 {
    let media_type = format.media_type();
    let group = if media_type.starts_with("text/") { "text/*" } else { "application/*" };
    weight_of_first(accept, &[media_type, group, "*/*"])
}

fn list(formats: &[SessionFormat]) -> String {
    formats.iter().map(|format| format.media_type()).collect::<Vec<_>>().join(", ")
}

/// Returns the `Content-Type` of a response in `format`.
pub(super) const fn content_type(format: SessionFormat) -> &'static str {
    match format {
        SessionFormat::Csv => "text/csv; charset=utf-8",
        other => other.media_type(),
    }
}

/// Returns the format of a session file by its `Content-Type`: CSV without the header, `None`
/// for a file that says nothing of itself, whose first bytes tell.
///
/// # Errors
/// 415 if it is not a format of session files, or this build does not have it.
pub(super) fn of_file(headers: &HeaderMap) -> Result<Option<SessionFormat>, Problem> {
    let Some(header) = headers.get(CONTENT_TYPE) else { return Ok(Some(SessionFormat::Csv)) };
    let text = header.to_str().unwrap_or_default();
    let essence = text.split(';').next().unwrap_or_default().trim().to_ascii_lowercase();
    let format = match essence.as_str() {
        "text/csv" => SessionFormat::Csv,
        "application/json" | "application/x-ndjson" => SessionFormat::Json,
        "application/octet-stream" => return Ok(None),
        "application/vnd.apache.parquet" => SessionFormat::Parquet,
        "application/vnd.apache.arrow.stream" | "application/vnd.apache.arrow.file" => {
            SessionFormat::Arrow
        }
        "application/vnd.mcap" => SessionFormat::Mcap,
        "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet" => SessionFormat::Xlsx,
        _ => {
            let formats = list(&SessionFormat::ALL);
            return Err(unsupported(format!(
                "`{text}` is not a media type of an imported recording; use {formats}"
            )));
        }
    };
    format.check().map_err(unsupported)?;
    Ok(Some(format))
}

fn unsupported(detail: impl Display) -> Problem {
    Problem::new(MEDIA_TYPE, detail.to_string())
}

impl From<SessionFileError> for Problem {
    fn from(error: SessionFileError) -> Self {
        let (pointer, reason) = (String::new(), error.to_string());
        BatchError::Malformed { pointer, reason }.into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    fn accepted(accept: &'static str) -> Result<SessionFormat, u16> {
        let mut headers = HeaderMap::new();
        headers.insert(ACCEPT, HeaderValue::from_static(accept));
        let format = negotiate(&headers, &SessionFormat::WRITTEN, SessionFormat::Csv);
        format.map_err(|problem| problem.status)
    }

    #[test]
    fn the_heaviest_format_is_taken_and_the_default_if_all_are_equal() {
        assert_eq!(accepted("*/*"), Ok(SessionFormat::Csv));
        assert_eq!(accepted("application/*"), Ok(SessionFormat::Json));
        assert_eq!(accepted("text/csv;q=0.5, application/json"), Ok(SessionFormat::Json));
        assert_eq!(accepted("image/png"), Err(406));
    }

    #[test]
    fn a_format_that_is_not_built_is_never_taken() {
        let built = SessionFormat::Parquet.check().is_ok();
        let alone = accepted("application/vnd.apache.parquet");
        assert_eq!(alone, if built { Ok(SessionFormat::Parquet) } else { Err(406) });
        let or_csv = accepted("application/vnd.apache.parquet, text/csv;q=0.5");
        assert_eq!(or_csv, Ok(if built { SessionFormat::Parquet } else { SessionFormat::Csv }));
    }
}
