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

use super::Problem;
use offbd_wire::problem::CONTENT_CODING;

/// The codings that a request body may have, for `Accept-Encoding`.
pub(super) const ACCEPTED_CODINGS: &str = "gzip, zstd";

/// Largest window of zstd, as a power of two of bytes: a decoder must support 8 MiB and should
/// refuse more (RFC 9659). The library would permit 128 MiB.
const MAX_ZSTD_WINDOW_LOG: u32 = 23;

/// Bytes that are decompressed before other requests have their turn. Chosen: a fraction of a
/// millisecond of a thread.
const DECODED_AT_A_TIME: usize = 64 << 10;

/// The coding of a request body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Coding {
    Identity,
    Gzip,
    Zstd,
}

impl Coding {
    /// Returns the coding that the headers name.
    ///
    /// # Errors
    /// 415 if it is not one of [`ACCEPTED_CODINGS`], or if there are several.
    pub(super) fn of(headers: &HeaderMap) -> Result<Self, Problem> {
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
            _ => {
                let detail = format!(
                    "the content coding `{header}` is not supported; use one of \
                     {ACCEPTED_CODINGS}, or none"
                );
                Err(Problem::new(CONTENT_CODING, detail))
            }
        }
    }

    /// Returns the most bytes of the decoded body that the decoder keeps, besides some KiB.
    pub(super) const fn window(self) -> usize {
        match self {
            Self::Identity | Self::Gzip => 0,
            Self::Zstd => 1 << MAX_ZSTD_WINDOW_LOG,
        }
    }

    /// Returns the decoded body in pieces. After each piece of a compressed body other tasks of
    /// the thread have their turn. An error is of the kind [`io::ErrorKind::FileTooLarge`] if more
    /// than `limit` bytes arrive; the caller counts the decoded ones.
    pub(super) fn decode(self, body: Body, limit: usize) -> BoxStream<'static, io::Result<Bytes>> {
        let mut n_arrived = 0;
        let arriving = body.into_data_stream().map(move |frame| {
            let frame = frame.map_err(io::Error::other)?;
            n_arrived += frame.len();
            if n_arrived > limit { Err(io::ErrorKind::FileTooLarge.into()) } else { Ok(frame) }
        });
        match self {
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
