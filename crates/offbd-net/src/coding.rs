//! Request bodies that are compressed, by their `Content-Encoding` (RFC 9110, section 8.4).

use std::io;

use async_compression::codecs::zstd::params::DParameter;
use async_compression::tokio::bufread::{GzipDecoder, ZstdDecoder};
use axum::body::{Body, Bytes};
use axum::http::HeaderMap;
use axum::http::header::CONTENT_ENCODING;
use futures_util::StreamExt;
use futures_util::stream::BoxStream;
use tokio::io::AsyncRead;
use tokio_util::io::{ReaderStream, StreamReader};

/// The codings that a request body may have, for `Accept-Encoding`.
pub const ACCEPTED_CODINGS: &str = "gzip, zstd";

/// Largest window of zstd, as a power of two of bytes: a decoder must support 8 MiB and should
/// refuse more (RFC 9659). The library would permit 128 MiB.
const MAX_ZSTD_WINDOW_LOG: u32 = 23;

/// Bytes that are decompressed before other requests have their turn. Chosen: a fraction of a
/// millisecond of a thread.
const DECODED_AT_A_TIME: usize = 64 << 10;

/// The coding of a request body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coding {
    Identity,
    Gzip,
    Zstd,
}

/// A body has another coding than [`ACCEPTED_CODINGS`], or several.
#[derive(Debug, thiserror::Error)]
#[error("the content coding `{0}` is not supported; use one of {ACCEPTED_CODINGS}, or none")]
pub struct UnsupportedCoding(String);

/// Why a body cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum BodyError {
    #[error("the body is longer than {limit} bytes{}", if *decoded { ", decompressed" } else { "" })]
    TooLong { limit: usize, decoded: bool },
    #[error("the body was not received completely: {0}")]
    Incomplete(io::Error),
    #[error("the body was not received completely, or cannot be decompressed: {0}")]
    Undecodable(io::Error),
}

impl Coding {
    /// Returns the coding that the headers name.
    ///
    /// # Errors
    /// [`UnsupportedCoding`], for 415.
    pub fn of(headers: &HeaderMap) -> Result<Self, UnsupportedCoding> {
        let fields = headers.get_all(CONTENT_ENCODING).iter();
        let fields: Vec<&str> = fields.map(|field| field.to_str().unwrap_or("?")).collect();
        let header = fields.join(", ");
        let codings = header.split(',').map(str::trim);
        let codings: Vec<String> = codings
            .map(str::to_ascii_lowercase)
            .filter(|coding| !matches!(coding.as_str(), "" | "identity"))
            .collect();
        match codings.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
            [] => Ok(Self::Identity),
            ["gzip" | "x-gzip"] => Ok(Self::Gzip),
            ["zstd"] => Ok(Self::Zstd),
            _ => Err(UnsupportedCoding(header)),
        }
    }

    /// Returns the most bytes of the decoded body that the decoder keeps, besides some KiB.
    #[must_use]
    pub const fn window(self) -> usize {
        match self {
            Self::Identity | Self::Gzip => 0,
            Self::Zstd => 1 << MAX_ZSTD_WINDOW_LOG,
        }
    }

    /// Returns the decoded body in pieces, and an error as soon as more than `limit` bytes have
    /// arrived or been decoded. After each piece of a compressed body other tasks of the thread
    /// have their turn.
    #[must_use]
    pub fn decode(self, body: Body, limit: usize) -> BoxStream<'static, Result<Bytes, BodyError>> {
        let mut n_arrived = 0;
        let arriving = body.into_data_stream().map(move |frame| {
            let frame = frame.map_err(io::Error::other)?;
            n_arrived += frame.len();
            if n_arrived > limit { Err(io::ErrorKind::FileTooLarge.into()) } else { Ok(frame) }
        });
        let pieces = match self {
            Self::Identity => arriving.boxed(),
            Self::Gzip => {
                let mut decoder = GzipDecoder::new(StreamReader::new(arriving));
                decoder.multiple_members(true);
                pieces(decoder)
            }
            Self::Zstd => {
                let window = [DParameter::window_log_max(MAX_ZSTD_WINDOW_LOG)];
                let mut decoder = ZstdDecoder::with_params(StreamReader::new(arriving), &window);
                decoder.multiple_members(true);
                pieces(decoder)
            }
        };
        let mut n_decoded = 0;
        let counted = pieces.map(move |piece| {
            let piece = piece.map_err(|error| self.error(error, limit))?;
            n_decoded += piece.len();
            let is_too_long = n_decoded > limit;
            if is_too_long { Err(BodyError::TooLong { limit, decoded: true }) } else { Ok(piece) }
        });
        counted.boxed()
    }

    fn error(self, error: io::Error, limit: usize) -> BodyError {
        match self {
            _ if error.kind() == io::ErrorKind::FileTooLarge => {
                BodyError::TooLong { limit, decoded: false }
            }
            Self::Identity => BodyError::Incomplete(error),
            Self::Gzip | Self::Zstd => BodyError::Undecodable(error),
        }
    }
}

fn pieces(decoder: impl AsyncRead + Send + 'static) -> BoxStream<'static, io::Result<Bytes>> {
    ReaderStream::with_capacity(decoder, DECODED_AT_A_TIME)
        .then(|piece| async {
            tokio::task::yield_now().await;
            piece
        })
        .boxed()
}
