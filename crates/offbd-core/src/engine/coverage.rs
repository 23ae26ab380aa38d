//! The amount of data in a session, in seconds, independent of the enable conditions.

use super::span::Span;
use crate::vocabulary::{Axis, FaultCode, Sample};
use serde::{Deserialize, Serialize};

/// Time covered by data so far, s. Gaps between samples do not count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Coverage {
    span: Span,
    last_s: Option<f64>,
    /// Time with samples, s.
    sampled_s: f64,
    /// Time with a ball seen, s.
    seen_s: f64,
}

impl Coverage {
    /// Takes the next sample in order; an interval longer than `gap_s` does not count.
    pub(super) fn take(&mut self, sample: &Sample, gap_s: f64) {
        self.span.take(sample.t_s);
        let dt = self.last_s.replace(sample.t_s).map_or(0.0, |last_s| sample.t_s - last_s);
        if !(0.0..=gap_s).contains(&dt) {
            return;
        }
        self.sampled_s += dt;
        if Axis::ALL.into_iter().any(|axis| sample.position(axis).is_some()) {
            self.seen_s += dt;
        }
    }

    /// The clock is set back before the next sample.
    pub(super) fn set_back(&mut self) {
        self.span.set_back();
    }

    /// Returns `judged_s` as a fraction of the session from its first sample to its last,
    /// gaps included, since nothing is judged in a gap. At most 1: a judgement counts for
    /// the period before it, which may begin before the first sample.
    pub(super) fn share(&self, judged_s: f64) -> f64 {
        let session_s = self.span.duration_s();
        if session_s > 0.0 { (judged_s / session_s).min(1.0) } else { 0.0 }
    }

    /// Time that the monitor of `code` could have judged if it had always been enabled,
    /// s: time with samples for the sensor's, time with a ball for the others.
    pub(super) const fn data_s(&self, code: FaultCode) -> f64 {
        match code {
            FaultCode::Sensor => self.sampled_s,
            _ => self.seen_s,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_do_not_count_and_only_the_sensor_needs_no_ball() {
        let mut coverage = Coverage::default();
        for (t_s, x_m) in
            [(0.0, Some(0.0)), (0.25, Some(0.0)), (0.5, None), (9.0, Some(0.0)), (9.25, Some(0.1))]
        {
            coverage.take(&Sample { t_s, x_m, ..Sample::default() }, 0.3);
        }
        assert_eq!(coverage.data_s(FaultCode::Sensor), 0.75);
        assert_eq!(coverage.data_s(FaultCode::XServo), 0.5);
        assert_eq!([0.0, 3.7, 99.0].map(|s| coverage.share(s)), [0.0, 0.4, 1.0]);
    }
}
