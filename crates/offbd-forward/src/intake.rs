//! Takes batches over HTTP, at the path and in the formats of the service.

use std::sync::Arc;

use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Path, RawQuery, State};
use axum::http::HeaderMap;
use axum::http::header::CONTENT_TYPE;
use axum::middleware::from_fn;
use axum::routing::{get, post};
use axum::{Json, Router};
use offbd_core::engine::Rig;
use serde::Serialize;
use tower_http::request_id::{MakeRequestUuid, PropagateRequestIdLayer, SetRequestIdLayer};

use super::delays::{DelayView, Delays};
use super::media_type;
use super::refusal::{self, Refusal};
use super::spool::{NewBatch, Spool, SpoolStatus};
use offbd_net::unread_body;
use offbd_wire::telemetry::{AckView, Batch, RowView, TelemetryFormat};

/// Longest body, bytes; a longer one is refused with 413.
const MAX_BODY_BYTES: usize = 4 << 20;
/// Most samples of a batch; more are refused with 413. The default limit of the service.
pub(super) const MAX_BATCH_SAMPLES: usize = 10_000;

type AgentState = (Arc<Spool>, Arc<Delays>);

/// What `GET /api/v1/spool` says.
#[derive(Serialize)]
struct AgentStatus {
    #[serde(flatten)]
    spool: SpoolStatus,
    /// Assets whose batches could not be sent, at most [`MAX_NAMED`](super::spool::MAX_NAMED).
    held_up: Vec<DelayView>,
}

/// The routes of the agent.
pub fn router(spool: Arc<Spool>, delays: Arc<Delays>) -> Router {
    let router = Router::new()
        .route("/api/v1/assets/{asset}/telemetry", post(take))
        .route("/api/v1/spool", get(status))
        .route("/healthz", get(|| async { Json(serde_json::json!({ "status": "ok" })) }))
        .layer(DefaultBodyLimit::max(MAX_BODY_BYTES))
        .with_state((spool, delays));
    router.layer((
        SetRequestIdLayer::x_request_id(MakeRequestUuid),
        PropagateRequestIdLayer::x_request_id(),
        from_fn(unread_body::discard),
        from_fn(refusal::name_request),
    ))
}

/// Takes a batch; the answer is sent once it is on the disk. It is checked as the service
/// checks it, so that a device learns of invalid rows at once.
async fn take(
    State((spool, _)): State<AgentState>,
    Path(asset): Path<String>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
    body: Bytes,
) -> Result<Json<AckView>, Refusal> {
    let header = headers.get(CONTENT_TYPE).map(|header| header.to_str().unwrap_or_default());
    let media_type = media_type(header).to_owned();
    let parsed = TelemetryFormat::of_type(&media_type)?.parse(&body, MAX_BATCH_SAMPLES)?;
    Rig::chapter(&asset).check()?;
    let query = query.unwrap_or_default();
    spool.put(&NewBatch { asset, query, media_type, body: body.into() }).await?;
    Ok(Json(acknowledgement(parsed)))
}

/// The acknowledgement of a batch in the spool. What the service alone knows is missing: its
/// session, duplicates, late samples.
fn acknowledgement(batch: Batch) -> AckView {
    let rows = batch.rows.iter().enumerate();
    let rejected = rows.filter_map(|(index, row)| {
        row.as_ref().err().map(|reason| RowView { index, reason: reason.clone() })
    });
    let samples = || batch.rows.iter().flatten();
    AckView {
        rejected: rejected.collect(),
        accepted: samples().count(),
        last_seq: samples().filter_map(|sample| sample.seq).max(),
        session: batch.session.clone(),
        unknown: batch.unknown,
        ..AckView::default()
    }
}

async fn status(State((spool, delays)): State<AgentState>) -> Result<Json<AgentStatus>, Refusal> {
    let status = spool.status().await?;
    // An asset of which the last batch has just been stored is not held up.
    let (held_up, waiting) = (delays.views(), spool.assets().await?);
    let held_up = held_up.into_iter().filter(|delay| waiting.contains(&delay.asset)).collect();
    Ok(Json(AgentStatus { spool: status, held_up }))
}
