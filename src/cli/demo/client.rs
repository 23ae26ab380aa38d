//! The demo's client of the service, over HTTP and WebSocket. It uses addresses and JSON
//! only, nothing internal to the service.

use std::time::Duration;

use anyhow::{Context, bail};
use futures_util::{SinkExt, StreamExt};
use reqwest::{Response, StatusCode};
use serde_json::{Value, json};
use tokio::net::TcpStream;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream};

use offbd_core::engine::Rig;
use offbd_core::vocabulary::{FaultCode, Sample};
use offbd_wire::asset;
use offbd_wire::service::SessionView;
use offbd_wire::telemetry::{AckView, RowsView, sample_view};

/// Maximum number of attempts to send a batch; chosen.
const ATTEMPTS: u32 = 5;
/// Delay before a retry if the service gives none; chosen.
const RETRY: Duration = Duration::from_millis(200);
/// Timeout of an acknowledgement; chosen: the store commits within milliseconds.
const ANSWER: Duration = Duration::from_secs(20);

/// A client for one asset.
#[derive(Clone, Debug)]
pub(super) struct Client {
    http: reqwest::Client,
    /// `HOST:PORT`.
    address: String,
    asset: String,
}

/// The transport of batches.
pub(super) enum Uplink {
    Http(Client),
    WebSocket(Box<WebSocketStream<MaybeTlsStream<TcpStream>>>),
}

impl Client {
    pub(super) fn new(address: String, asset: &str) -> anyhow::Result<Self> {
        let http = reqwest::Client::builder().no_proxy().build()?;
        Ok(Self { http, address, asset: asset.to_owned() })
    }

    fn of_asset(&self, rest: &str) -> String {
        format!("http://{}/api/v1/assets/{}{rest}", self.address, self.asset)
    }

    /// Registers the rig, or replaces the registered one.
    pub(super) async fn register(&self, rig: &Rig) -> anyhow::Result<()> {
        let request = self.http.put(self.of_asset("")).json(&asset::view(rig));
        accepted(request.send().await?).await.context("registering the asset")?;
        Ok(())
    }

    /// Clears the fault memory of `code`, as a workshop does after a repair.
    pub(super) async fn clear(&self, code: FaultCode) -> anyhow::Result<()> {
        let request = self.http.delete(self.of_asset(&format!("/faults/{code}?by=demo")));
        accepted(request.send().await?).await.context("clearing a fault")?;
        Ok(())
    }

    /// Opens the stream of the asset's fault transitions.
    pub(super) async fn events(&self) -> anyhow::Result<Response> {
        let url = format!("http://{}/api/v1/events?asset={}", self.address, self.asset);
        accepted(self.http.get(url).send().await?).await.context("listening to events")
    }

    /// Ends a session; returns it with its verdict.
    pub(super) async fn end_session(&self, id: &str) -> anyhow::Result<SessionView> {
        let url = format!("http://{}/api/v1/sessions/{id}/end", self.address);
        let answer = accepted(self.http.post(url).send().await?).await;
        Ok(answer.context("ending the session")?.json().await?)
    }

    /// Opens a WebSocket to the asset's stream.
    pub(super) async fn connect(&self) -> anyhow::Result<Uplink> {
        let url = format!("ws://{}/api/v1/assets/{}/stream", self.address, self.asset);
        let (socket, _) = tokio_tungstenite::connect_async(url).await.context("the WebSocket")?;
        Ok(Uplink::WebSocket(Box::new(socket)))
    }

    /// Posts a batch, with retries, until it is acknowledged; duplicates have no effect.
    async fn post(&self, batch: &RowsView) -> anyhow::Result<AckView> {
        let mut attempts = 0;
        loop {
            attempts += 1;
            let answer = self.http.post(self.of_asset("/telemetry")).json(batch).send().await;
            let wait = match answer {
                Ok(answer) if may_retry(answer.status()) && attempts < ATTEMPTS => {
                    retry_after(&answer)
                }
                Err(_) if attempts < ATTEMPTS => RETRY,
                answer => return Ok(accepted(answer?).await?.json().await?),
            };
            tokio::time::sleep(wait).await;
        }
    }
}

fn may_retry(status: StatusCode) -> bool {
    matches!(status, StatusCode::TOO_MANY_REQUESTS | StatusCode::SERVICE_UNAVAILABLE)
}

fn retry_after(answer: &Response) -> Duration {
    let seconds = answer.headers().get("retry-after").and_then(|v| v.to_str().ok()?.parse().ok());
    seconds.map_or(RETRY, Duration::from_secs)
}

/// Returns the response if it is a success, else an error with its body.
async fn accepted(answer: Response) -> anyhow::Result<Response> {
    let status = answer.status();
    if status.is_success() {
        return Ok(answer);
    }
    bail!("{status}: {}", answer.text().await.unwrap_or_default())
}

/// Returns whether a batch was refused because its session has ended.
pub(super) fn is_ended(error: &anyhow::Error) -> bool {
    format!("{error:#}").contains("urn:offbd:problem:session-ended")
}

impl Uplink {
    /// Returns the name of the transport.
    pub(super) const fn name(&self) -> &'static str {
        match self {
            Self::Http(_) => "HTTP batches",
            Self::WebSocket(_) => "WebSocket",
        }
    }

    /// Sends a batch of `session` and waits until it is durable.
    pub(super) async fn send(
        &mut self,
        session: &str,
        samples: &[Sample],
    ) -> anyhow::Result<AckView> {
        let samples = samples.iter().map(sample_view).collect();
        let batch = RowsView { session: Some(session.to_owned()), samples };
        match self {
            Self::Http(client) => client.post(&batch).await.context("sending a batch over HTTP"),
            Self::WebSocket(socket) => {
                socket.send(Message::text(json!(batch).to_string())).await?;
                let answer = tokio::time::timeout(ANSWER, acknowledgement(socket)).await;
                answer.context("no acknowledgement came")?.context("sending over the WebSocket")
            }
        }
    }

    /// Closes a WebSocket.
    pub(super) async fn close(self) {
        if let Self::WebSocket(mut socket) = self {
            // The service may have closed it first.
            let _ = SinkExt::close(&mut socket).await;
        }
    }
}

/// Returns the next acknowledgement. Fault frames are skipped: the event stream has them
/// too.
async fn acknowledgement(
    socket: &mut WebSocketStream<MaybeTlsStream<TcpStream>>,
) -> anyhow::Result<AckView> {
    while let Some(message) = socket.next().await {
        let Message::Text(text) = message? else { continue };
        let frame: Value = serde_json::from_str(&text)?;
        match frame["type"].as_str() {
            Some("ack") => return Ok(serde_json::from_value(frame)?),
            Some("error") => bail!("{}", frame["problem"]),
            _ => {}
        }
    }
    bail!("the service closed the stream")
}
