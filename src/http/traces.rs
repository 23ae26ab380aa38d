//! `/sessions/{id}/trace`: a session to be drawn.

use axum::Json;
use axum::extract::State;
use serde::Deserialize;

use super::{Path, Problem, Query};
use crate::service::{MAX_TRACE_POINTS, Service, TraceQuery};
use crate::wire::service::ReplaySettingsView;
use crate::wire::trace::TraceView;

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct StretchQuery {
    /// From this time on the device's clock, s; from the beginning without it.
    from_s: Option<f64>,
    /// Up to this time, s; to the end without it.
    to_s: Option<f64>,
    /// Moments wanted at most, brought into 1 to 20000; 5000 without it. A longer
    /// stretch is thinned out.
    #[param(format = Int64, maximum = 4_294_967_295_u32)]
    points: Option<u32>,
    /// `default` or `textbook`; without it the one of the asset file.
    #[param(pattern = "^(default|textbook)$")]
    profile: Option<String>,
}

/// Moments of a trace where none are asked for.
const DEFAULT_POINTS: u32 = 5000;

/// A stretch of a session as it is judged: positions, accelerations, limits and
/// gates of rig and twin over time. The recording is judged again for it, from
/// its beginning; nothing of it changes.
#[utoipa::path(get, path = "/sessions/{id}/trace", tag = "sessions",
    operation_id = "get_trace",
    params(("id" = String, description = "The service's id of the session"), StretchQuery),
    responses((status = 200, body = TraceView), (status = 400, body = Problem),
        (status = 404, body = Problem),
        (status = 413, body = Problem, description = "The session is too long"),
        (status = 422, body = Problem), (status = 429, body = Problem)))]
pub(super) async fn trace(
    State(service): State<Service>,
    Path(id): Path<String>,
    Query(query): Query<StretchQuery>,
) -> Result<Json<TraceView>, Problem> {
    let stretch = TraceQuery {
        from_s: query.from_s.unwrap_or(f64::NEG_INFINITY),
        to_s: query.to_s.unwrap_or(f64::INFINITY),
        points: query.points.unwrap_or(DEFAULT_POINTS).clamp(1, MAX_TRACE_POINTS),
        settings: ReplaySettingsView { profile: query.profile, ..Default::default() },
    };
    Ok(Json(service.trace(&id, stretch).await?))
}
