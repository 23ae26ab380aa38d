//! `/sessions/{id}/trial`: what other limits and debounce times would find.

use axum::Json;
use axum::extract::State;
use serde::Deserialize;

use super::{Path, Problem, Query, query_word};
use offbd_core::engine::Trial;
use offbd_core::vocabulary::{Axis, FaultCode, Invalid};
use offbd_service::Service;
use offbd_wire::service::ReplaySettingsView;
use offbd_wire::trial::TrialView;
use offbd_wire::words::ProfileWord;

#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct TriedSettingsQuery {
    /// The profile of the asset file by default.
    #[param(value_type = Option<ProfileWord>)]
    profile: Option<String>,
    /// Factor on the limits of the x servo's residual, path and evidence.
    #[param(minimum = 0.01, maximum = 1000)]
    x_servo_limit: Option<f64>,
    /// The same of the y servo.
    #[param(minimum = 0.01, maximum = 1000)]
    y_servo_limit: Option<f64>,
    /// Debounce time of the x servo's monitor, s.
    #[param(minimum = 0, maximum = 60)]
    x_servo_debounce_s: Option<f64>,
    /// The same of the y servo's.
    #[param(minimum = 0, maximum = 60)]
    y_servo_debounce_s: Option<f64>,
    /// The same of the ball's.
    #[param(minimum = 0, maximum = 60)]
    stuck_ball_debounce_s: Option<f64>,
    /// The same of the sensor's.
    #[param(minimum = 0, maximum = 60)]
    sensor_debounce_s: Option<f64>,
}

impl TriedSettingsQuery {
    fn trial(&self) -> Result<Trial, Invalid> {
        let limits = [
            ("?x_servo_limit", Axis::X, self.x_servo_limit),
            ("?y_servo_limit", Axis::Y, self.y_servo_limit),
        ];
        let debounces = [
            ("?x_servo_debounce_s", FaultCode::XServo, self.x_servo_debounce_s),
            ("?y_servo_debounce_s", FaultCode::YServo, self.y_servo_debounce_s),
            ("?stuck_ball_debounce_s", FaultCode::StuckBall, self.stuck_ball_debounce_s),
            ("?sensor_debounce_s", FaultCode::Sensor, self.sensor_debounce_s),
        ];
        let mut trial = Trial::default();
        for (name, axis, factor) in limits {
            trial = factor.map_or(Ok(trial), |factor| trial.with_limit(name, axis, factor))?;
        }
        for (name, code, fail_s) in debounces {
            trial = fail_s.map_or(Ok(trial), |fail_s| trial.with_debounce(name, code, fail_s))?;
        }
        Ok(trial)
    }
}

/// Counts what the monitors would find in a session with other limits and debounce times. The
/// whole recording is judged on its own, ignoring earlier sessions; nothing is stored or changed.
#[utoipa::path(get, path = "/sessions/{id}/trial", tag = "sessions",
    operation_id = "try_settings",
    params(("id" = String, description = "The service's id of the session"),
        TriedSettingsQuery),
    responses((status = 200, body = TrialView), (status = 400, body = Problem),
        (status = 404, body = Problem),
        (status = 413, body = Problem, description = "The session is too long"),
        (status = 429, body = Problem)))]
pub(super) async fn try_out(
    State(service): State<Service>,
    Path(id): Path<String>,
    Query(query): Query<TriedSettingsQuery>,
) -> Result<Json<TrialView>, Problem> {
    let profile = query_word("?profile", query.profile.as_deref())?;
    let settings = ReplaySettingsView { profile, ..Default::default() };
    Ok(Json(service.try_out(&id, settings, query.trial()?).await?))
}
