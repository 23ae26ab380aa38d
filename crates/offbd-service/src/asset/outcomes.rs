//! What became of samples, as metrics and for each asset.

use super::link_health::LinkHealth;
use offbd_store::Micros;
use offbd_wire::telemetry::AckView;
use offbd_wire::words::UnjudgedWord;

/// Counts `n` samples that arrive over `link` at `at` and are not judged.
pub(super) fn count_unjudged(
    link: &mut LinkHealth,
    reason: impl Into<UnjudgedWord>,
    n: u64,
    at: Micros,
) {
    let reason = reason.into();
    metrics::counter!("offbd_samples_unjudged_total", "reason" => reason.as_str()).increment(n);
    if n > 0 {
        link.unjudged(reason, n, at);
    }
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
