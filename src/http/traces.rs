//! `/sessions/{id}/trace`: the time series of a session for plotting.

use crate::wire::words::ProfileWord;
use axum::Json;
use axum::extract::State;
use serde::Deserialize;
use serde_json::json;

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
    /// Id of a calibration of the asset, or of the job that made it, to judge with instead of
    /// the one that was in use when the session was opened; `none` judges without any.
    calibration: Option<String>,
}

/// The value of `calibration` that asks for none.
const NO_CALIBRATION: &str = "none";

/// Returns the settings with a profile and the requested calibration.
fn settings(profile: Option<ProfileWord>, calibration: Option<String>) -> ReplaySettingsView {
    let without = calibration.as_deref() == Some(NO_CALIBRATION);
    ReplaySettingsView {
        profile,
        asset: without.then(|| json!({ "calibration": null })),
        calibration: calibration.filter(|_| !without),
        ..Default::default()
    }
}

/// Points of a trace without `points`.
const DEFAULT_POINTS: u32 = 5000;

/// Returns the time series of a session or of a part of it: positions, accelerations,
/// limits and gates of rig and twin. The service evaluates the recording again to compute
/// them, from its start or from a stored state of the engine shortly before the range;
/// nothing stored is changed, also with another calibration than the recorded one.
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
        settings: settings(profile, query.calibration),
    };
    Ok(Json(service.trace(&id, range).await?))
}
