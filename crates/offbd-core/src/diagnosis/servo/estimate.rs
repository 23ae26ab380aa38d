//! A servo's parameters over a whole session, for trends from one to the next.

use super::filter::{Filter, PARAMETERS, Prior};
#[cfg(not(feature = "std"))]
use crate::no_std::*;

/// Least motion that an estimate is made of, s.
const LEAST_S: f64 = 20.0;

/// How a servo has answered over a session, against the twin's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServoEstimate {
    /// Acceleration that no command explains, m/s², and its standard error.
    pub offset_m_s2: f64,
    pub offset_error_m_s2: f64,
    /// Share of the command that the ball answers, and its standard error.
    pub gain: f64,
    pub gain_error: f64,
    /// Delay beyond the twin's, s, and its standard error.
    pub delay_s: f64,
    pub delay_error_s: f64,
    /// Motion that it rests on, s.
    pub seconds: f64,
}

/// Sums over a session: the open filter is read once per memory, when what it
/// knows is new, and counts by what it has learnt beyond its prior.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Session {
    seconds: f64,
    since_s: f64,
    precision: [f64; PARAMETERS],
    weighted: [f64; PARAMETERS],
}

impl Session {
    pub(super) fn take(&mut self, dt: f64, open: &Filter, prior: &Prior) {
        self.seconds += dt;
        self.since_s += dt;
        if self.since_s < prior.memory_s[0] {
            return;
        }
        self.since_s = 0.0;
        for k in 0..PARAMETERS {
            let (mean, variance) = open.parameter(k);
            let learnt = 1.0 / variance - 1.0 / (prior.deviation[k] * prior.deviation[k]);
            self.precision[k] += learnt.max(0.0);
            self.weighted[k] += mean / variance;
        }
    }

    pub(super) fn estimate(&self) -> Option<ServoEstimate> {
        if self.seconds < LEAST_S || self.precision.iter().any(|&p| p <= 0.0) {
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
