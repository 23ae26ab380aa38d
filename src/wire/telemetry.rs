//! Batches of telemetry: rows or columns as JSON or MessagePack, NDJSON and CSV.
//!
//! Two kinds of trouble are kept apart. A document that cannot be read is
//! refused as a whole, with the place; a row that is no sample is reported by
//! its index, with the reason, and the other rows are taken. `NaN`, `Infinity`
//! and numbers too large for a double, which JSON does not have but devices
//! send, spoil their row alone.

mod cells;
mod lenient;

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use self::cells::{Document, Row};
use super::session_csv::Reader;
use offbd_core::vocabulary::Sample;

/// Largest `seq`: what the store's whole numbers hold. A row beyond is rejected.
pub const MAX_SEQ: u64 = i64::MAX as u64;

/// Most bytes of a reason that is given for a row.
const MAX_REASON: usize = 200;

/// A batch, row by row in the order of the document.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Batch {
    /// The device's name of the session, if it says one.
    pub session: Option<String>,
    /// The client's own mark, to be echoed.
    pub id: Option<String>,
    /// A sample, or the reason why the row is none.
    pub rows: Vec<Result<Sample, String>>,
}

/// Why a document is no batch.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BatchError {
    /// `pointer` is the JSON pointer of the offending element, empty for the
    /// document as a whole.
    #[error("{reason}")]
    Malformed { pointer: String, reason: String },
    /// More rows than allowed.
    #[error("{found} samples in one batch, at most {limit} are taken; send several batches")]
    TooMany { found: usize, limit: usize },
}

/// Reads JSON rows or columns; at most `limit` of them.
///
/// # Errors
/// [`BatchError`] if the document is malformed or too long.
pub fn json(document: &[u8], limit: usize) -> Result<Batch, BatchError> {
    let parsed = cells::json(document, limit).or_else(|error| {
        let quoted = lenient::quote_non_finite(document);
        quoted.and_then(|quoted| cells::json(&quoted, limit).ok()).ok_or(error)
    });
    batch(parsed?, limit)
}

/// Reads the same document as MessagePack; at most `limit` rows.
///
/// # Errors
/// [`BatchError`] if the document is malformed or too long.
pub fn msgpack(document: &[u8], limit: usize) -> Result<Batch, BatchError> {
    batch(cells::msgpack(document, limit)?, limit)
}

fn batch(document: Document, limit: usize) -> Result<Batch, BatchError> {
    let Document { session, id, samples, columns } = document;
    let rows = match (samples, columns.is_empty()) {
        (Some(_), false) => {
            let reason = "a batch has either `samples` or columns, not both".to_owned();
            return Err(BatchError::Malformed { pointer: "/samples".to_owned(), reason });
        }
        (Some(samples), true) => {
            check_length(samples.n, limit)?;
            samples.kept.into_iter().map(Row::sample).collect()
        }
        (None, _) => {
            check_length(columns.n(), limit)?;
            columns.samples().map_err(|(column, reason)| BatchError::Malformed {
                pointer: format!("/{column}"),
                reason,
            })?
        }
    };
    Ok(Batch { session, id, rows })
}

fn check_length(found: usize, limit: usize) -> Result<(), BatchError> {
    if found > limit { Err(BatchError::TooMany { found, limit }) } else { Ok(()) }
}

/// Reads NDJSON: one sample object a line, blank lines skipped; at most
/// `limit` of them. A line that is no JSON spoils itself alone.
///
/// # Errors
/// [`BatchError::TooMany`].
pub fn ndjson(document: &[u8], limit: usize) -> Result<Batch, BatchError> {
    let lines = document.split(|b| *b == b'\n').map(<[u8]>::trim_ascii).filter(|l| !l.is_empty());
    check_length(lines.clone().count(), limit)?;
    let row = |line: &[u8]| match serde_json::from_slice::<Row>(line) {
        Ok(row) => row.sample(),
        Err(error) => match lenient::quote_non_finite(line).map(|q| serde_json::from_slice(&q)) {
            Some(Ok(row)) => Row::sample(row),
            _ => Err(error.to_string()),
        },
    };
    Ok(Batch { rows: lines.map(row).collect(), ..Batch::default() })
}

/// Reads CSV with the header of a session file; at most `limit` rows.
///
/// # Errors
/// [`BatchError`] if the header is no session file's or there are too many rows.
pub fn csv(document: &[u8], limit: usize) -> Result<Batch, BatchError> {
    let malformed = |reason| BatchError::Malformed { pointer: String::new(), reason };
    let reader = Reader::new(document).map_err(|e| malformed(e.to_string()))?;
    let mut rows = Vec::new();
    for row in reader {
        check_length(rows.len() + 1, limit)?;
        rows.push(row.map_err(|e| shorten(&e.to_string())).and_then(check_seq));
    }
    Ok(Batch { rows, ..Batch::default() })
}

fn check_seq(sample: Sample) -> Result<Sample, String> {
    match sample.seq {
        Some(seq) if seq > MAX_SEQ => Err(format!("`seq` is {seq}, beyond {MAX_SEQ}")),
        _ => Ok(sample),
    }
}

/// `reason`, cut where it is so long that it must be quoting the data.
fn shorten(reason: &str) -> String {
    if reason.len() <= MAX_REASON {
        return reason.to_owned();
    }
    let cut = (0..=MAX_REASON).rev().find(|&i| reason.is_char_boundary(i)).unwrap_or(0);
    format!("{}…", &reason[..cut])
}

/// A row and what is to be said about it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct RowView {
    /// Place in the batch, from 0.
    pub index: usize,
    pub reason: String,
}

/// What became of a batch: every row is accepted, a duplicate or rejected.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct AckView {
    /// Name of the session that the samples went to; null if they went to none.
    pub session: Option<String>,
    /// The service's id of that session.
    pub session_id: Option<String>,
    /// Samples recorded, those in `late` included.
    pub accepted: usize,
    /// Samples that were there already.
    pub duplicate: usize,
    /// Rows that are no samples: neither recorded nor judged.
    pub rejected: Vec<RowView>,
    /// Samples recorded but not judged: too late, or far ahead of the clock.
    pub late: Vec<RowView>,
    /// The highest `seq` recorded in the session.
    pub last_seq: Option<u64>,
}

/// A sample as it goes out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SampleView {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seq: Option<u64>,
    /// Seconds on the device's clock.
    pub t_s: f64,
    pub cmd_qx_rad: Option<f64>,
    pub cmd_qy_rad: Option<f64>,
    pub x_m: Option<f64>,
    pub y_m: Option<f64>,
}

/// JSON rows, as a device sends them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RowsView {
    /// The device's name of the session; without it the open one is meant.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub session: Option<String>,
    pub samples: Vec<SampleView>,
}

/// The view of a sample.
#[must_use]
pub const fn sample_view(sample: &Sample) -> SampleView {
    let Sample { seq, t_s, cmd_qx_rad, cmd_qy_rad, x_m, y_m } = *sample;
    SampleView { seq, t_s, cmd_qx_rad, cmd_qy_rad, x_m, y_m }
}

/// By what a sample is known within its session: `seq`, or `t_s` without one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum SampleKey {
    Seq(u64),
    Time(u64),
}

/// The keys of `samples`.
pub fn keys<'a>(samples: impl IntoIterator<Item = &'a Sample>) -> BTreeSet<SampleKey> {
    samples.into_iter().map(key).collect()
}

/// The key of a sample.
#[must_use]
pub fn key(sample: &Sample) -> SampleKey {
    sample.seq.map_or_else(|| SampleKey::Time(sample.t_s.to_bits()), SampleKey::Seq)
}

#[cfg(test)]
mod tests;
