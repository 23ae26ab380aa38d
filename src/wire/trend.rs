//! How a rig's servos have answered from session to session, and what that
//! leads to.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use offbd_core::diagnosis::ServoEstimate;
use offbd_core::diagnosis::trend::{Drift, Parameter, Warning, drift};
use offbd_core::vocabulary::{Axis, FaultCode, PerAxis};

/// The servos of a rig over its sessions.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct TrendsView {
    pub asset: String,
    /// Of the calibration in the asset file; null on a rig not learnt, of which
    /// there are no trends.
    pub calibration_id: Option<String>,
    /// What the sessions estimated, oldest first, the last 200.
    pub points: Vec<TrendPointView>,
    /// Of the sessions that were judged by this calibration: one for each axis
    /// and parameter of which there are seven estimates.
    pub trends: Vec<TrendView>,
}

/// What one session estimated, against its twin.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct TrendPointView {
    /// The session's name.
    pub session: String,
    /// Null for a file.
    pub session_id: Option<String>,
    /// RFC 3339; null for a file.
    pub ended_at: Option<String>,
    /// Of the calibration that it was judged by.
    pub calibration_id: Option<String>,
    /// Samples of the session.
    pub samples: u64,
    /// Null where too little motion was seen.
    pub x: Option<ServoEstimateView>,
    pub y: Option<ServoEstimateView>,
}

/// A servo's parameters over a session against the twin's, with standard errors.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, ToSchema)]
pub struct ServoEstimateView {
    /// Share of the command that the ball answers; 1 is as calibrated.
    pub gain: f64,
    pub gain_error: f64,
    /// Acceleration that no command explains, m/s².
    pub offset_m_s2: f64,
    pub offset_error_m_s2: f64,
    /// Delay beyond the twin's, s.
    pub delay_s: f64,
    pub delay_error_s: f64,
    /// Motion that it rests on, s.
    pub seconds: f64,
}

/// A straight line through what the sessions estimated of one parameter.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct TrendView {
    pub axis: String,
    pub command: String,
    /// `gain`, `offset` (m/s²) or `delay` (s).
    pub parameter: String,
    /// Sessions that it goes through.
    pub sessions: usize,
    /// Change per session.
    pub slope: f64,
    /// The slope lies between these with a confidence of 99.9 %.
    pub slope_low: f64,
    pub slope_high: f64,
    /// What the line says of the last session, and its standard error.
    pub level: f64,
    pub level_error: f64,
    /// What is usual: the median of the first five of these.
    pub nominal: f64,
    /// Between these it is no fault.
    pub limit_low: f64,
    pub limit_high: f64,
    /// Before the fault; null where nothing is to be said.
    pub warning: Option<TrendWarningView>,
}

/// A fault that is on its way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct TrendWarningView {
    /// The code of the fault that it leads to.
    pub code: String,
    pub axis: String,
    pub command: String,
    /// `gain`, `offset` (m/s²) or `delay` (s).
    pub parameter: String,
    /// Sessions until the line reaches the limit at the present slope, at most
    /// 20; null where it is far from what is usual, but has no slope.
    pub sessions_left: Option<f64>,
    /// The limit that it goes to.
    pub limit: f64,
    /// The same in one sentence.
    pub summary: String,
}

/// The view of an estimate.
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

/// The trends of a servo of each axis over `sessions`, oldest first.
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
        axis: axis.as_str().to_owned(),
        command: axis.command().to_owned(),
        parameter: drift.parameter.as_str().to_owned(),
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
        code: FaultCode::servo(axis).to_string(),
        axis: axis.as_str().to_owned(),
        command: axis.command().to_owned(),
        parameter: drift.parameter.as_str().to_owned(),
        sessions_left: match warning {
            Warning::Crosses { sessions } => Some(sessions),
            Warning::Drifted { .. } => None,
        },
        limit,
        summary: sentence(axis, drift, warning, limit),
    }
}

/// What is to be said of a drift, in one sentence.
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
