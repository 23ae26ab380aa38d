//! Clients of the devices: minimal HTTP and WebSocket.

use std::collections::VecDeque;
use std::net::SocketAddr;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};
use axum::body::Bytes;
use futures_util::{SinkExt, StreamExt};
use offbd_core::vocabulary::Sample;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::Message;

use crate::load::columns_as_msgpack;

/// Largest number of batches of a WebSocket with a pending acknowledgement.
const MAX_PENDING: usize = 16;

/// An HTTP connection that sends one request after the other.
pub(crate) struct Client {
    stream: TcpStream,
    bytes: Vec<u8>,
}

impl Client {
    pub(crate) async fn connect(address: SocketAddr) -> Result<Self> {
        let stream = TcpStream::connect(address).await?;
        stream.set_nodelay(true)?;
        Ok(Self { stream, bytes: Vec::new() })
    }

    /// Posts `body` and waits for a successful response.
    pub(crate) async fn post(&mut self, path: &str, media_type: &str, body: &[u8]) -> Result<()> {
        let head = format!("POST {path} HTTP/1.1\r\ncontent-type: {media_type}");
        self.exchange(&head, body).await.map(drop)
    }

    /// Waits for a successful response and returns its body.
    pub(crate) async fn get(&mut self, path: &str) -> Result<String> {
        self.exchange(&format!("GET {path} HTTP/1.1"), &[]).await
    }

    async fn exchange(&mut self, head: &str, body: &[u8]) -> Result<String> {
        let length = body.len();
        let head = format!("{head}\r\nhost: localhost\r\ncontent-length: {length}\r\n\r\n");
        self.bytes.clear();
        self.bytes.extend_from_slice(head.as_bytes());
        self.bytes.extend_from_slice(body);
        self.stream.write_all(&self.bytes).await?;
        self.bytes.clear();
        loop {
            ensure!(
                self.stream.read_buf(&mut self.bytes).await? > 0,
                "the server closed the connection"
            );
            let text = std::str::from_utf8(&self.bytes)?;
            let Some((head, rest)) = text.split_once("\r\n\r\n") else { continue };
            ensure!(head.starts_with("HTTP/1.1 2"), "{text}");
            if head.starts_with("HTTP/1.1 204") {
                return Ok(String::new());
            }
            let (_, length) = head.split_once("content-length: ").context("no length")?;
            let length: usize = length.lines().next().unwrap_or_default().parse()?;
            if rest.len() >= length {
                return Ok(rest.to_owned());
            }
        }
    }
}

/// A WebSocket that sends batches and receives fault events.
pub(crate) struct Socket {
    stream: WebSocketStream<TcpStream>,
}

impl Socket {
    pub(crate) async fn connect(address: SocketAddr, device: usize) -> Result<Self> {
        let stream = TcpStream::connect(address).await?;
        stream.set_nodelay(true)?;
        let url = format!("ws://{address}/api/v1/assets/device-{device}/stream");
        let (stream, _) = tokio_tungstenite::client_async(url, stream).await?;
        Ok(Self { stream })
    }

    /// Sends every body and waits for every acknowledgement.
    pub(crate) async fn send(&mut self, bodies: &[Bytes]) -> Result<()> {
        let mut n_pending = 0;
        for body in bodies {
            self.stream.feed(Message::Binary(body.clone())).await?;
            n_pending += 1;
            // Waits for half of them, so that each write and read has several batches.
            if n_pending == MAX_PENDING {
                self.stream.flush().await?;
                n_pending = self.read_acknowledgements(n_pending, MAX_PENDING / 2).await?;
            }
        }
        self.stream.flush().await?;
        self.read_acknowledgements(n_pending, 0).await.map(drop)
    }

    /// Reads until at most `until` acknowledgements are pending; returns their number.
    async fn read_acknowledgements(&mut self, mut n_pending: usize, until: usize) -> Result<usize> {
        while n_pending > until {
            let text = self.frame().await?;
            n_pending -= usize::from(text.contains(r#""type":"ack""#));
            ensure!(!text.contains(r#""type":"error""#), "{text}");
        }
        Ok(n_pending)
    }

    async fn frame(&mut self) -> Result<String> {
        loop {
            match self.stream.next().await.context("the server closed the connection")?? {
                Message::Text(text) => return Ok(text.to_string()),
                Message::Close(frame) => bail!("the server closed: {frame:?}"),
                _ => {}
            }
        }
    }

    /// Sends a batch every `period` from `begin` on. Returns the latency of each fault event,
    /// from the sending of its sample.
    pub(crate) async fn pace(
        &mut self,
        samples: &[Sample],
        batch: usize,
        begin: Instant,
        period: Duration,
    ) -> Result<Vec<Duration>> {
        let mut sent: VecDeque<(f64, Instant)> = VecDeque::new();
        let (mut latencies, mut n_pending) = (Vec::new(), 0);
        let mut due = begin;
        let mut parts = samples.chunks(batch);
        let mut next = parts.next();
        while next.is_some() || n_pending > 0 {
            tokio::select! {
                () = tokio::time::sleep_until(due.into()), if next.is_some() => {
                    let part = next.take().unwrap_or_default();
                    let last_s = part.last().context("chunks are not empty")?.t_s;
                    sent.push_back((last_s, Instant::now()));
                    self.stream.send(Message::Binary(columns_as_msgpack(part).into())).await?;
                    (n_pending, due, next) = (n_pending + 1, due + period, parts.next());
                }
                text = self.frame() => {
                    let frame: serde_json::Value = serde_json::from_str(&text?)?;
                    match frame["type"].as_str() {
                        Some("ack") => n_pending -= 1,
                        Some("fault") => {
                            let t_s = frame["t_s"].as_f64().context("no t_s")?;
                            let of = sent.iter().find(|(last_s, _)| t_s <= *last_s);
                            latencies.extend(of.map(|(_, at)| at.elapsed()));
                        }
                        _ => bail!("{frame}"),
                    }
                }
            }
        }
        Ok(latencies)
    }
}
