//! Takes batches over HTTP, at the path and in the formats of the service.

use std::sync::Arc;
use std::time::Duration;

use axum::body::Body;
use axum::extract::{Path, RawQuery, Request, State};
use axum::http::header::CONTENT_TYPE;
use axum::middleware::{from_fn, from_fn_with_state};
use axum::routing::{get, post};
use axum::{Json, Router};
use futures_util::TryStreamExt;
use offbd_core::engine::Rig;
use serde::Serialize;
use tokio::time::timeout;
use tower_http::request_id::{MakeRequestUuid, PropagateRequestIdLayer, SetRequestIdLayer};

use super::batch::NewBatch;
use super::delays::{DelayView, Delays};
use super::refusal::{self, Refusal};
use super::spool::{Spool, SpoolStatus};
use super::strangers;
use offbd_net::coding::{BodyError, Coding};
use offbd_net::unread_body;
use offbd_wire::telemetry::{AckView, Batch, RowView, TelemetryFormat};

/// Longest body as it arrives, and decompressed, bytes; a longer one is refused with 413.
const MAX_BODY_BYTES: usize = 4 << 20;
/// Longest time until a body has arrived; then it is refused with 408.
const BODY_TIMEOUT: Duration = Duration::from_secs(30);
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

/// The routes of the agent, which may be addressed by these names besides IP addresses.
pub fn router(spool: Arc<Spool>, delays: Arc<Delays>, names: &[String]) -> Router {
    let router = Router::new()
        .route("/api/v1/assets/{asset}/telemetry", post(take))
        .route("/api/v1/spool", get(status))
        .route("/healthz", get(|| async { Json(serde_json::json!({ "status": "ok" })) }))
        .with_state((spool, delays));
    router.layer((
        SetRequestIdLayer::x_request_id(MakeRequestUuid),
        PropagateRequestIdLayer::x_request_id(),
        from_fn(unread_body::discard),
        from_fn(refusal::name_request),
        from_fn_with_state(Arc::<[String]>::from(names), strangers::refuse),
    ))
}

/// Takes a batch; the answer is sent once it is on the disk. It is checked as the service
/// checks it, so that a device learns of invalid rows at once.
async fn take(
    State((spool, _)): State<AgentState>,
    Path(asset): Path<String>,
    RawQuery(query): RawQuery,
    request: Request,
) -> Result<Json<AckView>, Refusal> {
    // JSON without the header, as for the service. What pages of other sites may send without it
    // has the header `Origin`.
    let header = request.headers().get(CONTENT_TYPE);
    let media_type =
        header.map_or("application/json", |header| header.to_str().unwrap_or_default()).to_owned();
    let format = TelemetryFormat::of_type(&media_type)?;
    let coding = Coding::of(request.headers())?;
    let body = timeout(BODY_TIMEOUT, collect(coding, request.into_body())).await;
    let body = body.map_err(|_| Refusal::SlowBody(BODY_TIMEOUT))??;
    let parsed = format.parse(&body, MAX_BATCH_SAMPLES)?;
    Rig::chapter(&asset).check()?;
    let query = query.unwrap_or_default();
    spool.put(&NewBatch { asset, query, media_type, body }).await?;
    Ok(Json(acknowledgement(parsed)))
}

/// Returns the decoded body, which the spool keeps.
async fn collect(coding: Coding, body: Body) -> Result<Vec<u8>, BodyError> {
    let (mut whole, mut pieces) = (Vec::new(), coding.decode(body, MAX_BODY_BYTES));
    while let Some(piece) = pieces.try_next().await? {
        whole.extend_from_slice(&piece);
    }
    Ok(whole)
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
