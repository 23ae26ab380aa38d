//! What became of samples, as metrics.

use crate::wire::telemetry::AckView;

/// Counts `n` samples that are not evaluated. `reason` is a metric label with few values.
pub(super) fn count_unjudged(reason: &'static str, n: u64) {
    metrics::counter!("offbd_samples_unjudged_total", "reason" => reason).increment(n);
}

/// Counts the samples of a batch by what became of them.
pub(super) fn count_outcomes(ack: &AckView) {
    let outcome = |outcome: &'static str, n: usize| {
        metrics::counter!("offbd_samples_total", "outcome" => outcome).increment(n as u64);
    };
    outcome("accepted", ack.accepted);
    outcome("duplicate", ack.duplicate);
    outcome("rejected", ack.rejected.len());
    outcome("late", ack.late.len());
}
