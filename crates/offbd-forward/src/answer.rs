//! What the response to a batch means. Only an acknowledgement or a refusal by the service itself
//! is final. Anything else, such as the page of a captive portal or the limit of a proxy, says
//! nothing about the batch, which is sent again.

use std::collections::BTreeMap;
use std::time::Duration;

use hyper::StatusCode;
use serde::Deserialize;

use super::batch::NewBatch;
use super::parsed;
use offbd_wire::problem::PROBLEM_TYPE;
use offbd_wire::telemetry::{AckView, RowsView, sample_view};

/// Longest reason that is kept or logged, bytes. Chosen: all reasons for which the service rejects
/// samples, and the start of a page that is not the service's.
const MAX_REASON_BYTES: usize = 2000;

/// The result of sending a batch.
pub(super) enum Attempt {
    Stored,
    /// The service has the batch, and rejected samples that the agent had accepted.
    Rejected {
        samples: NewBatch,
        reason: String,
    },
    /// The service would refuse the same batch again.
    Refused(String),
    Failed(Failure),
}

/// Why a batch is sent again.
#[derive(Debug)]
pub(super) struct Failure {
    /// The kind of failure, logged once while it lasts.
    pub cause: String,
    /// The start of the response, which may differ at each attempt; empty without a response.
    pub answer: String,
    /// The delay that the response asks for.
    pub wait: Option<Duration>,
}

impl Failure {
    /// A failure without a response.
    pub(super) fn new(cause: impl Into<String>) -> Self {
        Self { cause: cause.into(), answer: String::new(), wait: None }
    }
}

/// A problem of the service.
#[derive(Deserialize)]
struct ProblemType {
    #[serde(rename = "type")]
    kind: String,
    status: u16,
}

/// Returns what a response to `batch` means.
pub(super) fn meaning(status: StatusCode, answer: &[u8], batch: &NewBatch) -> Attempt {
    let failed = |cause: String| {
        let answer = shortened(&String::from_utf8_lossy(answer));
        Attempt::Failed(Failure { answer, ..Failure::new(cause) })
    };
    if status == StatusCode::OK {
        return acknowledged(answer, batch)
            .unwrap_or_else(|reason| failed(format!("{status}, but {reason}")));
    }
    let problem = serde_json::from_slice::<ProblemType>(answer).ok();
    match problem.filter(|p| p.status == status.as_u16() && p.kind.starts_with(PROBLEM_TYPE)) {
        Some(_) if is_final(status) => {
            let reason = format!("{status}: {}", String::from_utf8_lossy(answer));
            Attempt::Refused(shortened(&reason))
        }
        Some(problem) => failed(format!("{status}: {}", problem.kind)),
        None => failed(format!("{status}, not from the service")),
    }
}

/// Whether the same batch would be refused again. An asset or a token that is missing may come.
fn is_final(status: StatusCode) -> bool {
    matches!(
        status,
        StatusCode::BAD_REQUEST
            | StatusCode::CONFLICT
            | StatusCode::PAYLOAD_TOO_LARGE
            | StatusCode::UNSUPPORTED_MEDIA_TYPE
            | StatusCode::UNPROCESSABLE_ENTITY
    )
}

/// Returns what the acknowledgement of `batch` says; an error if `answer` is not one.
fn acknowledged(answer: &[u8], batch: &NewBatch) -> Result<Attempt, String> {
    let ack: AckView =
        serde_json::from_slice(answer).map_err(|_| "not an acknowledgement".to_owned())?;
    let sent = parsed(batch);
    let sent = sent.map_err(|reason| format!("the agent cannot count the rows sent: {reason}"))?;
    let rejected: BTreeMap<usize, &str> =
        ack.rejected.iter().map(|row| (row.index, row.reason.as_str())).collect();
    let n_told = ack.accepted.checked_add(ack.duplicate);
    let n_told = n_told.and_then(|n| n.checked_add(rejected.len()));
    let is_of_batch = rejected.len() == ack.rejected.len()
        && rejected.last_key_value().is_none_or(|(index, _)| *index < sent.rows.len());
    if n_told != Some(sent.rows.len()) || !is_of_batch {
        return Err(format!("not an acknowledgement of the {} rows sent", sent.rows.len()));
    }
    // The agent has named the other rows to the device.
    let lost: Vec<_> = rejected
        .into_iter()
        .filter_map(|(index, reason)| {
            let sample = sent.rows.get(index)?.as_ref().ok()?;
            Some((index, sample_view(sample), reason))
        })
        .collect();
    if lost.is_empty() {
        return Ok(Attempt::Stored);
    }
    let reasons = lost.iter().map(|(index, _, reason)| (*index, *reason));
    let reason = rejection(reasons, lost.len(), sent.rows.len());
    let samples = lost.into_iter().map(|(_, sample, _)| sample).collect();
    // In that session, or not at all.
    let session = ack.session.or(sent.session);
    let query = if session.is_some() { String::new() } else { batch.query.clone() };
    // MessagePack keeps what JSON has no number for.
    let body = rmp_serde::to_vec_named(&RowsView { session, samples });
    let body = body.map_err(|e| format!("the rejected samples cannot be written: {e}"))?;
    let media_type = "application/msgpack".to_owned();
    let samples = NewBatch { asset: batch.asset.clone(), query, media_type, body };
    Ok(Attempt::Rejected { samples, reason })
}

/// Says how many of the `n_rows` rows of a batch are rejected, and why: each reason with the first
/// row and the number of rows.
fn rejection<'a>(
    reasons: impl Iterator<Item = (usize, &'a str)>,
    n_rejected: usize,
    n_rows: usize,
) -> String {
    let mut grouped = BTreeMap::<&str, (usize, usize)>::new();
    for (index, reason) in reasons {
        grouped.entry(reason).or_insert((index, 0)).1 += 1;
    }
    let grouped = grouped.into_iter().map(|(reason, (first, n))| match n {
        1 => format!("row {first}: {reason}"),
        n => format!("row {first} and {} more: {reason}", n - 1),
    });
    let grouped = grouped.collect::<Vec<_>>().join("; ");
    shortened(&format!("{n_rejected} of {n_rows} rows rejected: {grouped}"))
}

/// Returns the start of a text that is too long.
pub(super) fn shortened(text: &str) -> String {
    if text.len() <= MAX_REASON_BYTES {
        return text.to_owned();
    }
    format!("{}…", &text[..text.floor_char_boundary(MAX_REASON_BYTES)])
}

#[cfg(test)]
mod tests;
