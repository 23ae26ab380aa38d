//! The connection to an MQTT broker, on which messages that are too long are shortened.
//!
//! A client that ends the connection at a message of QoS 1 that is too long gets the same one
//! again over the next connection, for ever. So the rest of such a message is passed over while
//! it arrives: it takes no memory, and the message can be refused and acknowledged as any other.

use std::collections::VecDeque;
use std::io;
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, ready};

use rumqttc::Publish;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::TcpStream;
use tokio_rustls::TlsConnector;
use tokio_rustls::rustls::pki_types::ServerName;
use tokio_util::either::Either;

/// Longest that MQTT can say a packet is, bytes after its fixed header.
pub(super) const PROTOCOL_LENGTH: usize = (1 << 28) - 1;

/// Bytes that are read from the broker at a time.
const CHUNK: usize = 16 << 10;

/// The type of a packet that publishes a message.
const PUBLISH: u8 = 3;

/// Length of a fixed header at most: the type, and a length of four bytes.
const HEADER_BYTES: usize = 5;

/// Where a broker is, and what is taken of its messages.
#[derive(Clone)]
pub(super) struct Dialer {
    pub(super) host: String,
    pub(super) port: u16,
    pub(super) tls: Option<TlsConnector>,
    pub(super) shortened: Shortened,
}

impl Dialer {
    /// Connects to the broker.
    pub(super) async fn connect(
        self,
    ) -> io::Result<ShorteningStream<impl AsyncRead + AsyncWrite + Send + Sync + Unpin>> {
        let Self { host, port, tls, shortened } = self;
        let socket = TcpStream::connect((host.as_str(), port)).await?;
        let stream = match tls {
            None => Either::Left(socket),
            Some(tls) => {
                let name = ServerName::try_from(host).map_err(io::Error::other)?;
                Either::Right(tls.connect(name, socket).await?)
            }
        };
        // What an earlier connection has shortened and nobody has asked for.
        shortened.lock().clear();
        Ok(ShorteningStream::new(stream, shortened))
    }
}

/// The messages of a connection that were shortened.
#[derive(Clone)]
pub(super) struct Shortened {
    /// Length to which packets are shortened, bytes after the fixed header.
    limit: usize,
    /// The lengths of those that were longer or as long, in order of arrival.
    lengths: Arc<Mutex<VecDeque<usize>>>,
}

impl Shortened {
    pub(super) fn to(limit: usize) -> Self {
        Self { limit: limit.min(PROTOCOL_LENGTH), lengths: Arc::default() }
    }

    /// Returns the length to which packets are shortened.
    pub(super) const fn limit(&self) -> usize {
        self.limit
    }

    /// Returns the bytes of the packet as it was sent, if it was shortened. Each message of a
    /// connection has to be asked for, in order of arrival.
    pub(super) fn original(&self, publish: &Publish) -> Option<usize> {
        let number = if publish.pkid == 0 { 0 } else { 2 };
        let length = 2 + publish.topic.len() + number + publish.payload.len();
        if length < self.limit {
            return None;
        }
        self.lock().pop_front()
    }

    fn lock(&self) -> MutexGuard<'_, VecDeque<usize>> {
        self.lengths.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A connection from which messages arrive shortened.
pub(super) struct ShorteningStream<S> {
    stream: S,
    chunk: Box<[u8]>,
    filter: Filter,
    /// Bytes of the output of the filter that have been handed over.
    n_taken: usize,
}

impl<S> ShorteningStream<S> {
    fn new(stream: S, shortened: Shortened) -> Self {
        let chunk = vec![0; CHUNK].into_boxed_slice();
        Self { stream, chunk, filter: Filter::new(shortened), n_taken: 0 }
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for ShorteningStream<S> {
    fn poll_read(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        into: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let Self { stream, chunk, filter, n_taken } = self.get_mut();
        // Nothing comes out of the filter while a header is incomplete or a rest is passed over.
        while *n_taken == filter.output.len() {
            filter.output.clear();
            *n_taken = 0;
            let mut arrived = ReadBuf::new(chunk);
            ready!(Pin::new(&mut *stream).poll_read(context, &mut arrived))?;
            if arrived.filled().is_empty() {
                return Poll::Ready(Ok(()));
            }
            filter.take(arrived.filled());
        }
        let rest = &filter.output[*n_taken..];
        let part = &rest[..rest.len().min(into.remaining())];
        into.put_slice(part);
        *n_taken += part.len();
        Poll::Ready(Ok(()))
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for ShorteningStream<S> {
    fn poll_write(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.get_mut().stream).poll_write(context, bytes)
    }

    fn poll_flush(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.get_mut().stream).poll_flush(context)
    }

    fn poll_shutdown(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.get_mut().stream).poll_shutdown(context)
    }
}

/// Shortens what a broker sends, in pieces of any size.
struct Filter {
    shortened: Shortened,
    /// The fixed header that is arriving.
    header: Vec<u8>,
    /// Bytes of the present packet that are still to be kept, and then to be passed over.
    n_kept: usize,
    n_passed_over: usize,
    output: Vec<u8>,
}

impl Filter {
    fn new(shortened: Shortened) -> Self {
        let (header, output) = (Vec::with_capacity(HEADER_BYTES), Vec::new());
        Self { shortened, header, n_kept: 0, n_passed_over: 0, output }
    }

    fn take(&mut self, mut input: &[u8]) {
        while let Some((byte, after)) = input.split_first() {
            if self.n_kept > 0 {
                let (kept, rest) = input.split_at(self.n_kept.min(input.len()));
                self.output.extend_from_slice(kept);
                self.n_kept -= kept.len();
                input = rest;
            } else if self.n_passed_over > 0 {
                let n = self.n_passed_over.min(input.len());
                self.n_passed_over -= n;
                input = &input[n..];
            } else {
                self.header.push(*byte);
                input = after;
                let is_last = byte & 0x80 == 0 || self.header.len() == HEADER_BYTES;
                if self.header.len() > 1 && is_last {
                    self.begin();
                }
            }
        }
    }

    /// Begins a packet, whose fixed header is complete.
    fn begin(&mut self) {
        let Self { shortened, header, n_kept, n_passed_over, output } = self;
        let length = length(&header[1..]);
        if header[0] >> 4 == PUBLISH && length >= shortened.limit {
            shortened.lock().push_back(length);
            output.push(header[0]);
            write_length(output, shortened.limit);
            (*n_kept, *n_passed_over) = (shortened.limit, length - shortened.limit);
        } else {
            output.extend_from_slice(header);
            *n_kept = length;
        }
        header.clear();
    }
}

/// Returns the length that a fixed header says: seven bits in each byte, the lowest first.
fn length(bytes: &[u8]) -> usize {
    bytes.iter().rev().fold(0, |length, byte| length << 7 | usize::from(byte & 0x7f))
}

fn write_length(output: &mut Vec<u8>, length: usize) {
    let mut rest = length;
    loop {
        let low = (rest & 0x7f) as u8;
        rest >>= 7;
        if rest == 0 {
            return output.push(low);
        }
        output.push(low | 0x80);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn packet(first: u8, body: &[u8]) -> Vec<u8> {
        let mut packet = vec![first];
        write_length(&mut packet, body.len());
        packet.extend_from_slice(body);
        packet
    }

    proptest! {
        #[test]
        fn messages_are_shortened_and_everything_else_passes_however_it_is_cut(
            packets in prop::collection::vec((any::<bool>(), 0..400_usize), 1..12),
            limit in 1..300_usize,
            piece in 1..50_usize,
        ) {
            let (mut sent, mut expected, mut lengths) = (Vec::new(), Vec::new(), Vec::new());
            for (n, (is_publish, length)) in packets.into_iter().enumerate() {
                let body: Vec<_> = (0..length).map(|i| (i * 7 + n) as u8).collect();
                let first = if is_publish { 0x32 } else { 0x90 };
                let is_long = is_publish && length >= limit;
                sent.extend(packet(first, &body));
                expected.extend(packet(first, if is_long { &body[..limit] } else { &body }));
                lengths.extend(is_long.then_some(length));
            }
            let mut filter = Filter::new(Shortened::to(limit));
            sent.chunks(piece).for_each(|piece| filter.take(piece));
            prop_assert_eq!(&filter.output, &expected);
            prop_assert_eq!(filter.shortened.lock().drain(..).collect::<Vec<_>>(), lengths);
        }

        #[test]
        fn every_length_is_read_as_it_is_written(written in 0..=PROTOCOL_LENGTH) {
            let mut bytes = Vec::new();
            write_length(&mut bytes, written);
            prop_assert!(bytes.len() < HEADER_BYTES);
            prop_assert_eq!(length(&bytes), written);
        }
    }

    #[test]
    fn the_original_length_of_a_shortened_message_is_told_once() {
        let shortened = Shortened::to(20);
        let mut filter = Filter::new(shortened.clone());
        let short = Publish::new("t", rumqttc::QoS::AtMostOnce, vec![0; 16]);
        let long = Publish::new("t", rumqttc::QoS::AtMostOnce, vec![0; 17]);
        let body = |n: usize| [&[0, 1, b't'][..], &vec![0; n]].concat();
        for n in [16, 17, 900, 16] {
            filter.take(&packet(0x30, &body(n)));
        }
        let told: Vec<_> =
            [&short, &long, &long, &short].map(|publish| shortened.original(publish)).into();
        assert_eq!(told, [None, Some(20), Some(903), None]);
    }
}
