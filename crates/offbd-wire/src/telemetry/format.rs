//! The formats in which a batch of telemetry comes.

use super::{Batch, BatchError, TableOptions, csv, json, msgpack, ndjson};

/// The format of a batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TelemetryFormat {
    Json,
    Msgpack,
    Ndjson,
    Csv,
}

/// A media type in which no batch comes.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{0}` is not supported; use application/json, application/msgpack, application/x-ndjson or \
     text/csv"
)]
pub struct UnsupportedMediaType(pub String);

impl TelemetryFormat {
    /// Returns the format of a media type.
    ///
    /// # Errors
    /// [`UnsupportedMediaType`].
    pub fn of_type(media_type: &str) -> Result<Self, UnsupportedMediaType> {
        let essence = media_type.split(';').next().unwrap_or_default().trim().to_ascii_lowercase();
        match essence.as_str() {
            "application/json" => Ok(Self::Json),
            "application/msgpack" | "application/vnd.msgpack" | "application/x-msgpack" => {
                Ok(Self::Msgpack)
            }
            "application/x-ndjson" | "application/ndjson" | "application/jsonl" => Ok(Self::Ndjson),
            "text/csv" => Ok(Self::Csv),
            _ => Err(UnsupportedMediaType(media_type.to_owned())),
        }
    }

    /// Returns the format of a binary frame: a MessagePack document starts with the tag of
    /// a map, with which no JSON document starts.
    #[must_use]
    pub fn of_bytes(document: &[u8]) -> Self {
        match document.first() {
            Some(0x80..=0x8f | 0xde | 0xdf) => Self::Msgpack,
            _ => Self::Json,
        }
    }

    /// Parses a batch of at most `limit` samples, whose keys have the names of the quantities.
    ///
    /// # Errors
    /// [`BatchError`].
    pub fn parse(self, document: &[u8], limit: usize) -> Result<Batch, BatchError> {
        match self {
            Self::Json => json(document, limit),
            Self::Msgpack => msgpack(document, limit),
            Self::Ndjson => ndjson(document, limit),
            Self::Csv => csv(document, &TableOptions::default(), limit),
        }
    }
}
