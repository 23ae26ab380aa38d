//! The servo parameters whose drift is followed, and their limits.

use super::{Band, MAX_SESSIONS, MEDIAN_ERROR, Trend, Warning, warning};
use crate::diagnosis::ServoEstimate;
use crate::maths::{median, robust_deviation};
#[cfg(not(feature = "std"))]
use crate::no_std::*;

/// How many sessions a warning looks ahead: in time to plan a repair, and no further than
/// a line through as many sessions is credible. Chosen.
pub const HORIZON_SESSIONS: f64 = 20.0;

/// Number of first sessions that define the usual value: few, since a drift may begin at
/// once. Chosen.
const USUAL_SESSIONS: usize = 5;

/// Standard error up to which an estimate counts, as a fraction of the distance to the
/// nearer limit. Chosen: beyond it a session tells less than three standard errors of a
/// fault.
const WORST_ERROR_SHARE: f64 = 1.0 / 3.0;

/// A servo parameter that is followed from session to session.
///
/// The limits are the smallest sudden changes within a session that were confirmed in all
/// of four trials on the quiet simulated rig: a gain of 0.7 or 1.5, a horn slipped by
/// 0.015 rad (0.1 m/s²), a servo three times as slow (0.1 s). Slower changes are not
/// confirmed: the monitors adapt to them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parameter {
    /// Fraction of the command that the ball answers.
    Gain,
    /// Acceleration that no command explains, m/s².
    Offset,
    /// Delay beyond the twin's, s.
    Delay,
}

impl Parameter {
    pub const ALL: [Self; 3] = [Self::Gain, Self::Offset, Self::Delay];

    /// `"gain"`, `"offset"` or `"delay"`.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Gain => "gain",
            Self::Offset => "offset",
            Self::Delay => "delay",
        }
    }

    /// The limits for a servo that agrees with the twin's.
    #[must_use]
    pub const fn band(self) -> Band {
        match self {
            Self::Gain => Band { low: 0.7, nominal: 1.0, high: 1.5 },
            Self::Offset => Band { low: -0.1, nominal: 0.0, high: 0.1 },
            Self::Delay => Band { low: -0.1, nominal: 0.0, high: 0.1 },
        }
    }

    /// Scatter of the estimates of a healthy servo from session to session: 1 or 2 % of the
    /// gain where the motions of simulated rigs are alike, 3 % where they are of all kinds;
    /// 0.004 to 0.009 m/s² and 5 to 10 ms.
    const fn usual_scatter(self) -> f64 {
        match self {
            Self::Gain => 0.02,
            Self::Offset => 0.01,
            Self::Delay => 0.01,
        }
    }

    /// Returns the estimate; NaN if its error is too large to tell a drift.
    fn of(self, estimate: &ServoEstimate) -> f64 {
        let (value, error) = match self {
            Self::Gain => (estimate.gain, estimate.gain_error),
            Self::Offset => (estimate.offset_m_s2, estimate.offset_error_m_s2),
            Self::Delay => (estimate.delay_s, estimate.delay_error_s),
        };
        let band = self.band();
        let room = (band.high - band.nominal).min(band.nominal - band.low);
        if error <= WORST_ERROR_SHARE * room { value } else { f64::NAN }
    }
}

/// The drift of a servo parameter over sessions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift {
    pub parameter: Parameter,
    /// The line through the estimates.
    pub trend: Trend,
    /// The limits, shifted to the usual value of this rig.
    pub band: Band,
    pub warning: Option<Warning>,
}

/// Returns the drift of `parameter` over sessions, oldest first, with the estimates of
/// each; `None` for too few sessions.
///
/// Estimates are more repeatable than accurate: stiction and the control loop shift all of
/// them alike, by more than their standard errors. Hence the first sessions, not the
/// calibration, define the usual value, and later sessions should ask the rig for motions
/// of the same kind.
#[must_use]
pub fn drift(parameter: Parameter, sessions: &[Option<ServoEstimate>]) -> Option<Drift> {
    let sessions = &sessions[sessions.len().saturating_sub(MAX_SESSIONS)..];
    let value = |e: &Option<ServoEstimate>| e.as_ref().map_or(f64::NAN, |e| parameter.of(e));
    let values: Vec<f64> = sessions.iter().map(value).collect();
    let mut trend = Trend::of(&values, parameter.usual_scatter())?;
    let (usual, error) = usual(&values)?;
    trend.level_error = trend.level_error.hypot(error);
    let band = parameter.band().about(usual);
    let warning = warning(&trend, &band, HORIZON_SESSIONS);
    Some(Drift { parameter, trend, band, warning })
}

/// Returns the usual value and its standard error: the median of the first estimates.
fn usual(values: &[f64]) -> Option<(f64, f64)> {
    let estimated = values.iter().copied().filter(|value| value.is_finite());
    let mut first: Vec<f64> = estimated.take(USUAL_SESSIONS).collect();
    let usual = median(&mut first)?;
    let error = MEDIAN_ERROR * robust_deviation(&mut first)? / (first.len() as f64).sqrt();
    Some((usual, error))
}
