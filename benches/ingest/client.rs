//! Devices: as little of HTTP and of WebSockets as it takes.

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

/// Batches of a WebSocket that wait for their acknowledgement.
const UNDER_WAY: usize = 16;

/// A connection that sends requests, one after the other.
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

    /// Posts `body` and waits for an answer that must be a success.
    pub(crate) async fn post(&mut self, path: &str, media_type: &str, body: &[u8]) -> Result<()> {
        let length = body.len();
        let head = format!(
            "POST {path} HTTP/1.1\r\nhost: localhost\r\ncontent-type: {media_type}\r\n\
             content-length: {length}\r\n\r\n"
        );
        self.bytes.clear();
        self.bytes.extend_from_slice(head.as_bytes());
        self.bytes.extend_from_slice(body);
        self.stream.write_all(&self.bytes).await?;
        self.bytes.clear();
        loop {
            ensure!(self.stream.read_buf(&mut self.bytes).await? > 0, "the server is gone");
            let text = std::str::from_utf8(&self.bytes)?;
            let Some((head, rest)) = text.split_once("\r\n\r\n") else { continue };
            ensure!(head.starts_with("HTTP/1.1 2"), "{text}");
            if head.starts_with("HTTP/1.1 204") {
                return Ok(());
            }
            let (_, length) = head.split_once("content-length: ").context("no length")?;
            let length: usize = length.lines().next().unwrap_or_default().parse()?;
            if rest.len() >= length {
                return Ok(());
            }
        }
    }
}

/// A WebSocket that sends batches and hears of faults.
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

    /// Sends every body; waits for every acknowledgement.
    pub(crate) async fn send(&mut self, bodies: &[Bytes]) -> Result<()> {
        let mut owed = 0;
        for body in bodies {
            self.stream.feed(Message::Binary(body.clone())).await?;
            owed += 1;
            // In halves, so that a write and a read carry several batches.
            if owed == UNDER_WAY {
                self.stream.flush().await?;
                owed = self.hear(owed, UNDER_WAY / 2).await?;
            }
        }
        self.stream.flush().await?;
        self.hear(owed, 0).await.map(drop)
    }

    async fn hear(&mut self, mut owed: usize, until: usize) -> Result<usize> {
        while owed > until {
            let text = self.frame().await?;
            owed -= usize::from(text.contains(r#""type":"ack""#));
            ensure!(!text.contains(r#""type":"error""#), "{text}");
        }
        Ok(owed)
    }

    async fn frame(&mut self) -> Result<String> {
        loop {
            match self.stream.next().await.context("the server hung up")?? {
                Message::Text(text) => return Ok(text.to_string()),
                Message::Close(frame) => bail!("the server closed: {frame:?}"),
                _ => {}
            }
        }
    }

    /// Sends a batch every `period` from `begin` on; how long each fault event
    /// took since the sample that it is about was sent.
    pub(crate) async fn pace(
        &mut self,
        samples: &[Sample],
        batch: usize,
        begin: Instant,
        period: Duration,
    ) -> Result<Vec<Duration>> {
        let mut sent: VecDeque<(f64, Instant)> = VecDeque::new();
        let (mut latencies, mut owed) = (Vec::new(), 0);
        let mut due = begin;
        let mut parts = samples.chunks(batch);
        let mut next = parts.next();
        while next.is_some() || owed > 0 {
            tokio::select! {
                () = tokio::time::sleep_until(due.into()), if next.is_some() => {
                    let part = next.take().unwrap_or_default();
                    let last_s = part.last().context("chunks are not empty")?.t_s;
                    sent.push_back((last_s, Instant::now()));
                    self.stream.send(Message::Binary(columns_as_msgpack(part).into())).await?;
                    (owed, due, next) = (owed + 1, due + period, parts.next());
                }
                text = self.frame() => {
                    let frame: serde_json::Value = serde_json::from_str(&text?)?;
                    match frame["type"].as_str() {
                        Some("ack") => owed -= 1,
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
