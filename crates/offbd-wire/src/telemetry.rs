//! Batches of telemetry: rows or columns as JSON or MessagePack, NDJSON and CSV.
//!
//! There are two kinds of errors. A document that cannot be parsed is rejected as a whole,
//! with the pointer of the error. An invalid row is reported by its index, with the reason,
//! and the other rows are accepted. `NaN`, `Infinity` and numbers too large for a double,
//! which JSON does not have but some devices send, invalidate only their row.

mod cells;
mod format;
pub(crate) mod lenient;

use serde::de::DeserializeSeed;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use self::cells::{BatchDocument, BatchRowSeed, UnknownKeys};
pub use self::format::{TelemetryFormat, UnsupportedMediaType};
use super::foreign_file;
use super::table::{TableOptions, TableReader, nearest_of};
use offbd_core::vocabulary::Sample;

/// Largest `seq`: the largest integer of the store.
pub const MAX_SEQ: u64 = i64::MAX as u64;

/// Longest reason given for a row, bytes.
const MAX_REASON_BYTES: usize = 200;

/// A batch, with its rows in the order of the document.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Batch {
    /// The device's name for the session, if given.
    pub session: Option<String>,
    /// The client's id of the batch, which the acknowledgement repeats.
    pub id: Option<String>,
    /// A sample, or the reason why the row is invalid.
    pub rows: Vec<Result<Sample, String>>,
    /// Keys that are not understood, each with the key that is probably meant.
    pub unknown: Vec<UnknownKeyView>,
}

/// Why a document is not a valid batch.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BatchError {
    /// `pointer` is the JSON pointer of the invalid element; it is empty for the whole
    /// document.
    #[error("{reason}")]
    Malformed { pointer: String, reason: String },
    /// More rows than allowed.
    #[error("{found} samples in one batch; at most {limit} are allowed: send several batches")]
    TooMany { found: usize, limit: usize },
}

/// Parses JSON rows or columns, with at most `limit` samples.
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

/// Parses the same document as MessagePack, with at most `limit` samples.
///
/// # Errors
/// [`BatchError`] if the document is malformed or too long.
pub fn msgpack(document: &[u8], limit: usize) -> Result<Batch, BatchError> {
    batch(cells::msgpack(document, limit)?, limit)
}

fn batch(document: BatchDocument, limit: usize) -> Result<Batch, BatchError> {
    let BatchDocument { session, id, samples, columns, unknown } = document;
    let has_unknown = !unknown.is_empty();
    let rows = match (samples, columns.is_empty()) {
        (Some(_), false) => {
            let reason = "a batch has either `samples` or columns, not both".to_owned();
            return Err(BatchError::Malformed { pointer: "/samples".to_owned(), reason });
        }
        (Some(samples), true) => {
            check_length(samples.n, limit)?;
            samples.values.into_iter().map(|row| row.sample(has_unknown)).collect()
        }
        (None, _) => {
            check_length(columns.n(), limit)?;
            columns.samples(has_unknown).map_err(|(column, reason)| BatchError::Malformed {
                pointer: format!("/{column}"),
                reason,
            })?
        }
    };
    Ok(Batch { session, id, rows, unknown: named(unknown) })
}

fn check_length(found: usize, limit: usize) -> Result<(), BatchError> {
    if found > limit { Err(BatchError::TooMany { found, limit }) } else { Ok(()) }
}

/// Parses NDJSON: one sample object per line, with at most `limit` lines; blank lines are
/// skipped. A line with invalid JSON is an invalid row.
///
/// # Errors
/// [`BatchError::TooMany`] if there are too many lines.
pub fn ndjson(document: &[u8], limit: usize) -> Result<Batch, BatchError> {
    let lines = document.split(|b| *b == b'\n').map(<[u8]>::trim_ascii).filter(|l| !l.is_empty());
    check_length(lines.clone().count(), limit)?;
    let unknown = UnknownKeys::default();
    let rows = lines.map(|line| row(line, &unknown)).collect();
    Ok(Batch { rows, unknown: named(unknown), ..Batch::default() })
}

/// Parses one sample object.
fn row(document: &[u8], unknown: &UnknownKeys) -> Result<Sample, String> {
    let parse = |document: &[u8]| {
        let mut json = serde_json::Deserializer::from_slice(document);
        let row = BatchRowSeed(unknown).deserialize(&mut json)?;
        json.end().map(|()| row)
    };
    match parse(document) {
        Ok(row) => row.sample(!unknown.is_empty()),
        Err(error) => {
            let quoted = lenient::quote_non_finite(document);
            match quoted.map(|quoted| parse(&quoted)) {
                Some(Ok(row)) => row.sample(!unknown.is_empty()),
                _ => Err(super::json::words(&error)),
            }
        }
    }
}

/// Returns unknown keys with those that are probably meant.
fn named(unknown: UnknownKeys) -> Vec<UnknownKeyView> {
    let likely = |key: &str| {
        let starts = |field: &&&str| !key.is_empty() && field.starts_with(&format!("{key}_"));
        let alike = nearest_of(key, cells::FIELDS.into_iter());
        cells::FIELDS.iter().find(starts).copied().or(alike).map(str::to_owned)
    };
    let view = |key: String| UnknownKeyView { meant: likely(&key), key };
    unknown.into_names().into_iter().map(view).collect()
}

/// Parses CSV as `options` say, with at most `limit` rows. Unless they map columns, those without
/// the name of a quantity are unknown keys.
///
/// # Errors
/// [`BatchError`] if a column is missing, or there are too many rows.
pub fn csv(document: &[u8], options: &TableOptions, limit: usize) -> Result<Batch, BatchError> {
    let malformed = |reason| BatchError::Malformed { pointer: String::new(), reason };
    let head = &document[..document.len().min(foreign_file::HEAD_BYTES as usize)];
    foreign_file::check_own(head).map_err(|error| malformed(error.to_string()))?;
    let reader = TableReader::batch(document, options).map_err(|e| malformed(e.to_string()))?;
    let unknown = UnknownKeys::default();
    reader.unread().for_each(|name| unknown.note(name));
    let mut rows = Vec::new();
    for row in reader {
        check_length(rows.len() + 1, limit)?;
        rows.push(file_row(row.map_err(|e| e.to_string())));
    }
    Ok(Batch { rows, unknown: named(unknown), ..Batch::default() })
}

/// Returns a row of a session file as one of a batch: its `seq` is checked, and a reason is
/// shortened.
///
/// # Errors
/// The reason why the row is invalid.
pub fn file_row(row: Result<Sample, String>) -> Result<Sample, String> {
    row.map_err(|reason| shorten(&reason)).and_then(check_seq)
}

fn check_seq(sample: Sample) -> Result<Sample, String> {
    match sample.seq {
        Some(seq) if seq > MAX_SEQ => Err(format!("`seq` is {seq}, beyond {MAX_SEQ}")),
        _ => Ok(sample),
    }
}

/// Truncates a reason that is too long because it quotes the data.
pub(super) fn shorten(reason: &str) -> String {
    if reason.len() <= MAX_REASON_BYTES {
        return reason.to_owned();
    }
    let cut = (0..=MAX_REASON_BYTES).rev().find(|&i| reason.is_char_boundary(i)).unwrap_or(0);
    format!("{}…", &reason[..cut])
}

/// A row that was rejected or not judged, with the reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct RowView {
    /// Index of the row in the batch, from 0.
    pub index: usize,
    /// Why it was rejected or not judged.
    pub reason: String,
}

/// The acknowledgement of a batch: each row is accepted, a duplicate or rejected.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct AckView {
    /// Name of the session that the samples belong to; null if the batch has no valid sample.
    pub session: Option<String>,
    /// The service's id of that session; null if there is none.
    pub session_id: Option<String>,
    /// Number of recorded samples, including those in `late`.
    pub accepted: usize,
    /// Number of samples that were already recorded.
    pub duplicate: usize,
    /// Invalid rows, which are neither recorded nor judged.
    pub rejected: Vec<RowView>,
    /// Samples that are recorded but not judged: those that are too late, and those after a
    /// jump of the clock, which are judged once the next samples confirm it.
    pub late: Vec<RowView>,
    /// Highest `seq` recorded in the session; null if no sample has one.
    pub last_seq: Option<u64>,
    /// Keys of the batch that are not understood, at most 8; absent if there are none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub unknown: Vec<UnknownKeyView>,
}

/// A key of a batch that is not understood.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct UnknownKeyView {
    pub key: String,
    /// The known key that is most like it; null if none is.
    pub meant: Option<String>,
}

/// One sample. A value that the device does not have is null.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SampleView {
    /// Number of the sample within the session, by which a duplicate is recognised; absent
    /// if the device does not number its samples, and then `t_s` is used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seq: Option<u64>,
    /// Time, s on the device's clock.
    pub t_s: f64,
    /// Command of the plate angle about x, in the device's unit, sign and axes.
    pub cmd_qx_rad: Option<f64>,
    /// Command of the plate angle about y, in the device's unit, sign and axes.
    pub cmd_qy_rad: Option<f64>,
    /// Position of the ball along x, in the device's unit, sign and axes.
    pub x_m: Option<f64>,
    /// Position of the ball along y, in the device's unit, sign and axes.
    pub y_m: Option<f64>,
}

/// A batch as JSON rows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RowsView {
    /// The device's name for the session; if absent, the open session.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub session: Option<String>,
    pub samples: Vec<SampleView>,
}

/// A batch as JSON columns, all of the same length. A column that the device does not have is
/// absent.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct ColumnsView {
    /// The device's name for the session; if absent, the open session.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub session: Option<String>,
    /// `seq` of each sample, as in rows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seq: Option<Vec<Option<u64>>>,
    /// Times, s on the device's clock.
    pub t_s: Vec<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cmd_qx_rad: Option<Vec<Option<f64>>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cmd_qy_rad: Option<Vec<Option<f64>>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub x_m: Option<Vec<Option<f64>>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub y_m: Option<Vec<Option<f64>>>,
}

/// Returns the view of a sample.
#[must_use]
pub const fn sample_view(sample: &Sample) -> SampleView {
    let Sample { seq, t_s, cmd_qx_rad, cmd_qy_rad, x_m, y_m } = *sample;
    SampleView { seq, t_s, cmd_qx_rad, cmd_qy_rad, x_m, y_m }
}

/// The key that identifies a sample within its session: `seq`, or the bits of `t_s` if it
/// has none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum SampleKey {
    Seq(u64),
    Time(u64),
}

/// Returns the key of a sample.
#[must_use]
pub fn sample_key(sample: &Sample) -> SampleKey {
    sample.seq.map_or_else(|| SampleKey::Time((sample.t_s + 0.0).to_bits()), SampleKey::Seq)
}

#[cfg(test)]
mod tests;
