//! `/sessions/{id}/trace`: the time series of a session for plotting.

use crate::wire::words::ProfileWord;
use axum::Json;
use axum::extract::State;
use serde::Deserialize;

use super::{Path, Problem, Query, query_word, time_range};
use crate::service::{MAX_TRACE_POINTS, Service, TraceQuery};
use crate::wire::service::ReplaySettingsView;
use crate::wire::trace::TraceView;

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct TraceRangeQuery {
    /// Start on the device's clock, s; the start of the session by default.
    from_s: Option<f64>,
    /// End on the device's clock, s; the end of the session by default.
    to_s: Option<f64>,
    /// Most points to return, 1 to 20000; 5000 by default. A range with more points is
    /// decimated.
    #[param(format = Int32, minimum = 1, maximum = 20_000)]
    points: Option<u32>,
    /// The profile of the asset file by default.
    #[param(value_type = Option<ProfileWord>)]
    profile: Option<String>,
}

/// Points of a trace without `points`.
const DEFAULT_POINTS: u32 = 5000;

/// Returns the time series of a session or of a part of it: positions, accelerations,
/// limits and gates of rig and twin. The service evaluates the recording again to compute
/// them, from its start or from a stored state of the engine shortly before the range;
/// nothing stored is changed.
#[utoipa::path(get, path = "/sessions/{id}/trace", tag = "sessions",
    operation_id = "get_trace",
    params(("id" = String, description = "The service's id of the session"), TraceRangeQuery),
    responses((status = 200, body = TraceView), (status = 400, body = Problem),
        (status = 404, body = Problem),
        (status = 413, body = Problem, description = "The range is too long"),
        (status = 422, body = Problem), (status = 429, body = Problem)))]
pub(super) async fn trace(
    State(service): State<Service>,
    Path(id): Path<String>,
    Query(query): Query<TraceRangeQuery>,
) -> Result<Json<TraceView>, Problem> {
    let profile = query_word("?profile", query.profile.as_deref())?;
    let range = TraceQuery {
        range: time_range(query.from_s, query.to_s)?,
        points: query.points.unwrap_or(DEFAULT_POINTS).clamp(1, MAX_TRACE_POINTS),
        settings: ReplaySettingsView { profile, ..Default::default() },
    };
    Ok(Json(service.trace(&id, range).await?))
}
