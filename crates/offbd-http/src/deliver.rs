//! Sends batches that have come over NATS or MQTT to the node that owns their asset.

use std::time::Duration;

use axum::body::Body;
use axum::extract::Request;
use axum::http::StatusCode;
use axum::http::header::{CONTENT_TYPE, HOST};
use percent_encoding::{NON_ALPHANUMERIC, utf8_percent_encode};
use tokio::time::timeout;

use super::forward::{FROM_BUS, Forwarder, moved};
use offbd_core::vocabulary::Sample;
use offbd_service::{Route, Service};
use offbd_wire::session_csv;
use offbd_wire::telemetry::Batch;

/// Longest time until the owner has stored a batch; then it has to be sent again. Chosen: a
/// commit takes at most 30 s, but a node that stops has no more than 20 s for everything.
const DELIVERY_TIMEOUT: Duration = Duration::from_secs(10);

impl Forwarder {
    /// Sends the valid samples of a batch to the owner of `asset`. Returns whether they are
    /// stored or refused for good; otherwise the batch has to be sent again.
    pub async fn deliver(&self, service: &Service, asset: &str, batch: &Batch) -> bool {
        let samples: Vec<_> = batch.rows.iter().flatten().copied().collect();
        if samples.is_empty() {
            return true;
        }
        let Route::Node { address, .. } = service.route(asset) else { return false };
        let Ok(request) = request(asset, batch.session.as_deref(), &samples) else { return true };
        metrics::counter!("offbd_requests_forwarded_total").increment(1);
        let moved = timeout(DELIVERY_TIMEOUT, moved(service, asset, &address));
        tokio::select! {
            biased;
            answer = self.send(service, &address, request) => {
                answer.is_ok_and(|answer| !is_temporary(answer.status()))
            }
            _ = moved => false,
        }
    }
}

/// A request that submits samples, as CSV, which keeps every value.
fn request(
    asset: &str,
    session: Option<&str>,
    samples: &[Sample],
) -> Result<Request, axum::http::Error> {
    let encoded = |text| utf8_percent_encode(text, NON_ALPHANUMERIC);
    let query = session.map(|name| format!("?session={}", encoded(name))).unwrap_or_default();
    let mut document = Vec::new();
    // Writing to memory does not fail.
    let _ = session_csv::write(&mut document, samples);
    Request::post(format!("/api/v1/assets/{}/telemetry{query}", encoded(asset)))
        // The name of a node is a host name that a service without authentication does not permit.
        .header(HOST, "localhost")
        .header(CONTENT_TYPE, "text/csv")
        .header(FROM_BUS, "1")
        .body(Body::from(document))
}

/// Whether a refusal may be another one later. A node of an earlier version asks for a token.
fn is_temporary(status: StatusCode) -> bool {
    matches!(status.as_u16(), 401 | 403 | 408 | 429) || status.is_server_error()
}
