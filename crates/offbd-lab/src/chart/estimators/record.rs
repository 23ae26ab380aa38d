use serde::{Deserialize, Serialize};

/// One configuration at one rate and noise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Samples per second.
    pub rate_hz: f64,
    /// White noise of the positions, m rms.
    pub noise_m: f64,
    pub family: String,
    /// What is tuned: `window_s`, `cutoff_hz` or `jerk_density_m2_s5`.
    pub setting: String,
    pub value: f64,
    /// The estimator's own delay: by which the truth agrees best with what it
    /// says of positions without noise, s.
    pub delay_s: f64,
    /// Rms against the truth of `delay_s` before, m/s².
    pub error_m_s2: f64,
    /// Rms against the truth of the moment, m/s².
    pub undelayed_error_m_s2: f64,
    /// What of the error is there without noise, m/s² rms.
    pub distortion_m_s2: f64,
    /// What noise alone makes, m/s² rms.
    pub noise_m_s2: f64,
    /// CPU time per sample, ns: the minimum over repeats.
    pub cost_ns: f64,
    /// Median over minimum of the repeats.
    pub spread: f64,
    /// No other drawn one has both less delay and less error at this rate and noise.
    pub front: bool,
    /// What the engine uses.
    pub offbd: bool,
}
