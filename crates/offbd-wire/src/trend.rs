//! Estimates of a rig's servos from session to session, their trends, and warnings.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::words::{AxisWord, CodeWord, CommandWord, ParameterWord};
use offbd_core::diagnosis::ServoEstimate;
use offbd_core::diagnosis::trend::{Drift, Parameter, Warning, drift};
use offbd_core::vocabulary::{Axis, FaultCode, PerAxis};

/// Estimates and trends of the servos of a rig over its sessions.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct TrendsView {
    pub asset: String,
    /// Id of the calibration in the asset file; null if the rig is not calibrated, and then there
    /// are no trends.
    pub calibration_id: Option<String>,
    /// Estimates of the last 200 sessions, oldest first.
    pub points: Vec<TrendPointView>,
    /// Trends over the sessions that were judged with this calibration: one for each axis and
    /// parameter with at least six estimates.
    pub trends: Vec<TrendView>,
}

/// Estimates of one session, relative to the twin.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct TrendPointView {
    /// The session's name.
    pub session: String,
    /// The service's id of the session; null for a file.
    pub session_id: Option<String>,
    /// Time at which the session was ended, RFC 3339; null for a file.
    pub ended_at: Option<String>,
    /// Id of the calibration that was used; null if the rig was not calibrated.
    pub calibration_id: Option<String>,
    /// Number of samples of the session.
    pub samples: u64,
    /// Estimates of the x servo; null if there was too little motion.
    pub x: Option<ServoEstimateView>,
    /// Estimates of the y servo; null if there was too little motion.
    pub y: Option<ServoEstimateView>,
}

/// A servo's parameters in a session, relative to the twin, with standard errors.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, ToSchema)]
pub struct ServoEstimateView {
    /// Gain relative to the calibration: 1 means unchanged.
    pub gain: f64,
    /// Standard error of the gain.
    pub gain_error: f64,
    /// Acceleration that the command does not explain, m/s².
    pub offset_m_s2: f64,
    /// Standard error of the offset, m/s².
    pub offset_error_m_s2: f64,
    /// Delay in addition to the twin's, s.
    pub delay_s: f64,
    /// Standard error of the delay, s.
    pub delay_error_s: f64,
    /// Duration of the motion on which the estimates are based, s.
    pub seconds: f64,
}

/// A straight line through the estimates of one parameter over the sessions.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct TrendView {
    pub axis: AxisWord,
    pub command: CommandWord,
    pub parameter: ParameterWord,
    /// Number of sessions with an estimate.
    pub sessions: usize,
    /// Change per session.
    pub slope: f64,
    /// Lower bound of the slope; it lies between the bounds with a confidence of 99.9 %.
    pub slope_low: f64,
    /// Upper bound of the slope.
    pub slope_high: f64,
    /// Value of the line at the last session.
    pub level: f64,
    /// Standard error of the level.
    pub level_error: f64,
    /// Usual value: the median of the first five estimates.
    pub nominal: f64,
    /// Lower limit, below which the value is a fault.
    pub limit_low: f64,
    /// Upper limit, above which the value is a fault.
    pub limit_high: f64,
    /// Warning of an expected fault; null if there is none.
    pub warning: Option<TrendWarningView>,
}

/// A warning that a servo drifts towards a fault.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct TrendWarningView {
    /// Code of the expected fault.
    pub code: CodeWord,
    pub axis: AxisWord,
    pub command: CommandWord,
    pub parameter: ParameterWord,
    /// Number of sessions until the line reaches the limit at the present slope, at most 20;
    /// null if the value is far from the usual one without a significant slope.
    pub sessions_left: Option<f64>,
    /// The limit that the value approaches.
    pub limit: f64,
    /// The warning in one sentence.
    pub summary: String,
}

/// Returns the view of an estimate.
#[must_use]
pub const fn estimate_view(estimate: &ServoEstimate) -> ServoEstimateView {
    ServoEstimateView {
        gain: estimate.gain,
        gain_error: estimate.gain_error,
        offset_m_s2: estimate.offset_m_s2,
        offset_error_m_s2: estimate.offset_error_m_s2,
        delay_s: estimate.delay_s,
        delay_error_s: estimate.delay_error_s,
        seconds: estimate.seconds,
    }
}

/// Returns the trends of both servos over `sessions`, oldest first.
#[must_use]
pub fn trend_views(sessions: &[PerAxis<Option<ServoEstimate>>]) -> Vec<TrendView> {
    let mut views = Vec::new();
    for axis in Axis::ALL {
        let of_axis: Vec<Option<ServoEstimate>> = sessions.iter().map(|s| s[axis]).collect();
        let drifts = Parameter::ALL.into_iter().filter_map(|p| drift(p, &of_axis));
        views.extend(drifts.map(|drift| trend_view(axis, &drift)));
    }
    views
}

fn trend_view(axis: Axis, drift: &Drift) -> TrendView {
    let (trend, band) = (&drift.trend, &drift.band);
    TrendView {
        axis: axis.into(),
        command: axis.into(),
        parameter: drift.parameter.into(),
        sessions: trend.n_sessions,
        slope: trend.slope,
        slope_low: trend.slope_low,
        slope_high: trend.slope_high,
        level: trend.level,
        level_error: trend.level_error,
        nominal: band.nominal,
        limit_low: band.low,
        limit_high: band.high,
        warning: drift.warning.map(|warning| warning_view(axis, drift, warning)),
    }
}

fn warning_view(axis: Axis, drift: &Drift, warning: Warning) -> TrendWarningView {
    let band = &drift.band;
    let up = match warning {
        Warning::Crosses { .. } => drift.trend.slope > 0.0,
        Warning::Drifted { .. } => drift.trend.level > band.nominal,
    };
    let limit = if up { band.high } else { band.low };
    TrendWarningView {
        code: FaultCode::servo(axis).into(),
        axis: axis.into(),
        command: axis.into(),
        parameter: drift.parameter.into(),
        sessions_left: match warning {
            Warning::Crosses { sessions } => Some(sessions),
            Warning::Drifted { .. } => None,
        },
        limit,
        summary: sentence(axis, drift, warning, limit),
    }
}

/// Describes a warning in one sentence.
fn sentence(axis: Axis, drift: &Drift, warning: Warning, limit: f64) -> String {
    let (trend, parameter) = (&drift.trend, drift.parameter);
    let write = |value: f64| match parameter {
        Parameter::Gain => format!("{value:.2}"),
        Parameter::Offset => format!("{value:.3} m/s²"),
        Parameter::Delay => format!("{:.0} ms", value * 1e3),
    };
    let what =
        format!("{}: its {} is {}", FaultCode::servo(axis), parameter.as_str(), write(trend.level));
    match warning {
        Warning::Crosses { sessions } if sessions < 1.0 => {
            format!("{what}, at its limit, {}", write(limit))
        }
        Warning::Crosses { sessions } => {
            let way = if trend.slope > 0.0 { "rises" } else { "falls" };
            let limit = write(limit);
            format!("{what} and {way}; at this slope it reaches {limit} in {sessions:.0} sessions")
        }
        Warning::Drifted { share } => {
            let share = 100.0 * share;
            format!("{what}, {share:.0} % of the way from what is usual to {}", write(limit))
        }
    }
}
