//! What a recorded session would have found with other limits and debounce times.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::trace::ThresholdsView;

/// What the monitors find in a session with the settings that are tried.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct TrialView {
    /// One entry for each monitor.
    pub monitors: Vec<TriedMonitorView>,
}

/// What one monitor finds with the settings that are tried.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct TriedMonitorView {
    /// The values at which it decides with them.
    pub thresholds: ThresholdsView,
    /// How often its test fails.
    pub failures: u64,
    /// How often it raises an alarm: a failure that is confirmed.
    pub alarms: u64,
    /// Times of the first 500 alarms, s on the device's clock.
    pub alarms_t_s: Vec<f64>,
}
