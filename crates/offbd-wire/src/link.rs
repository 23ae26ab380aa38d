//! How the samples of a rig arrive.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::telemetry::UnknownKeyView;
use super::words::UnjudgedWord;

/// How the samples of a rig arrive: their rate and spacing on the device's clock, gaps, delay,
/// and rows that are not judged. It is counted in memory, from zero after a restart of the
/// service, or when another node of a cluster takes the asset over.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = Link)]
pub struct LinkView {
    pub asset: String,
    /// Id of the session whose samples came last; null if none has come since it is counted.
    pub session_id: Option<String>,
    /// The rate that the asset file states, Hz.
    pub expected_rate_hz: f64,
    /// Longer pauses restart the evaluation, s; null without a session.
    pub gap_s: Option<f64>,
    /// The time of the service minus that of the device, s, at the batch of the session with the
    /// least delay, so that the shortest way of a batch is in it. A clock that counts from the
    /// start of the device is far behind.
    pub clock_offset_s: Option<f64>,
    /// The session, as far as it has been counted; null without one.
    pub session: Option<LinkStretchView>,
    /// The last minutes, also of earlier sessions; null if nothing has arrived in them.
    pub recent: Option<LinkStretchView>,
    /// Keys of the telemetry that are not understood, those of the last batch in the last minutes
    /// that has any; at most 8.
    #[serde(default)]
    #[schema(required)]
    pub unknown: Vec<UnknownKeyView>,
}

/// How the samples of a stretch of time have arrived.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = LinkStretch)]
pub struct LinkStretchView {
    /// Since when rows are counted.
    pub from: String,
    /// Rows that are recorded.
    pub samples: u64,
    /// Rows that were recorded already.
    pub duplicates: u64,
    /// Recorded rows with a time before that of an earlier row. They are in no spacing.
    pub unordered: u64,
    /// Samples per second of the device's clock, without the gaps; null before the second
    /// sample.
    pub rate_hz: Option<f64>,
    /// Mean spacing of the samples, without the gaps, s.
    pub spacing_s: Option<f64>,
    /// Standard deviation of the spacing, s.
    pub jitter_s: Option<f64>,
    pub gaps: u64,
    /// The longest gap, s; null without one.
    pub longest_gap_s: Option<f64>,
    /// All gaps together, s.
    pub gaps_s: f64,
    /// Batches with a sample.
    pub batches: u64,
    /// Mean delay of the batches behind the fastest batch of their session so far, s.
    pub delay_s: Option<f64>,
    /// Longest delay of a batch behind the fastest batch of its session so far, s.
    pub longest_delay_s: Option<f64>,
    /// Rows that are not judged, by reason; only reasons that occurred.
    pub unjudged: Vec<UnjudgedRowsView>,
}

/// Rows that are not judged for one reason.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = UnjudgedRows)]
pub struct UnjudgedRowsView {
    pub reason: UnjudgedWord,
    pub rows: u64,
}
