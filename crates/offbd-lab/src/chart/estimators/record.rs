use serde::{Deserialize, Serialize};

/// The result of one estimator at one tuning, rate and noise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EstimatorRecord {
    /// Sampling rate, Hz.
    pub rate_hz: f64,
    /// White noise of the positions, m rms.
    pub noise_m: f64,
    pub family: String,
    /// The tuning parameter: `window_s`, `cutoff_hz` or `jerk_density_m2_s5`.
    pub setting: String,
    /// Value of the tuning parameter.
    pub value: f64,
    /// Delay of the truth at which it agrees best with the estimate from noiseless
    /// positions, s.
    pub delay_s: f64,
    /// Rms error against the truth delayed by `delay_s`, m/s².
    pub error_m_s2: f64,
    /// Rms error against the truth without delay, m/s².
    pub undelayed_error_m_s2: f64,
    /// Rms error without noise, m/s².
    pub distortion_m_s2: f64,
    /// Rms of the noise of the estimate, m/s².
    pub noise_m_s2: f64,
    /// CPU time per sample, ns: the minimum over the repeated measurements.
    pub cost_ns: f64,
    /// Median over minimum of the repeated measurements.
    pub spread: f64,
    /// Whether it is on the Pareto front of delay and error among the drawn families at
    /// this rate and noise.
    pub front: bool,
    /// Whether it is the estimator that the engine uses.
    pub offbd: bool,
}
