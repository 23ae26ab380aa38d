//! The parameters of a servo over a whole session, for trends.

use super::filter::{PARAMETERS, ParameterPrior, ServoFilter};
#[cfg(not(feature = "std"))]
use crate::no_std::*;
use serde::{Deserialize, Serialize};

/// Least time of motion for an estimate, s. Chosen.
const LEAST_MOTION_S: f64 = 20.0;

/// The parameters of a servo over a session, relative to the twin's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServoEstimate {
    /// Acceleration that no command explains, m/s², and its standard error.
    pub offset_m_s2: f64,
    pub offset_error_m_s2: f64,
    /// Fraction of the command that the ball answers, and its standard error.
    pub gain: f64,
    pub gain_error: f64,
    /// Delay beyond the twin's, s, and its standard error.
    pub delay_s: f64,
    pub delay_error_s: f64,
    /// Time of motion that the estimate is based on, s.
    pub seconds: f64,
}

/// Sums over a session. The filter of the broken servo is read once per its memory, when
/// its information is new, and weighted by its information beyond the prior.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct SessionEstimator {
    seconds: f64,
    since_s: f64,
    precision: [f64; PARAMETERS],
    weighted: [f64; PARAMETERS],
}

impl SessionEstimator {
    pub(super) fn take(&mut self, dt: f64, faulty: &ServoFilter, prior: &ParameterPrior) {
        self.seconds += dt;
        self.since_s += dt;
        if self.since_s < prior.memory_s[0] {
            return;
        }
        self.since_s = 0.0;
        for k in 0..PARAMETERS {
            let (mean, variance) = faulty.parameter(k);
            let learnt = 1.0 / variance - 1.0 / (prior.deviation[k] * prior.deviation[k]);
            self.precision[k] += learnt.max(0.0);
            self.weighted[k] += mean / variance;
        }
    }

    pub(super) fn estimate(&self) -> Option<ServoEstimate> {
        if self.seconds < LEAST_MOTION_S || self.precision.iter().any(|&p| p <= 0.0) {
            return None;
        }
        let mean = |k: usize| self.weighted[k] / self.precision[k];
        let error = |k: usize| self.precision[k].sqrt().recip();
        Some(ServoEstimate {
            offset_m_s2: mean(0),
            offset_error_m_s2: error(0),
            gain: 1.0 + mean(1),
            gain_error: error(1),
            delay_s: mean(2),
            delay_error_s: error(2),
            seconds: self.seconds,
        })
    }
}
