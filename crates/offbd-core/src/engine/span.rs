//! The time from the first sample of a session to its last, on a clock that may be set
//! back.

use serde::{Deserialize, Serialize};
/// The times of samples so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Span {
    /// Time before the clock was last set back, s.
    finished_s: f64,
    /// First and last time since, s.
    present_s: Option<(f64, f64)>,
    /// Earliest and latest time of all, s.
    whole_s: Option<(f64, f64)>,
}

impl Span {
    pub(super) fn take(&mut self, t_s: f64) {
        for span in [&mut self.present_s, &mut self.whole_s] {
            let (first, last) = span.get_or_insert((t_s, t_s));
            if t_s > *last {
                *last = t_s;
            } else if t_s < *first {
                *first = t_s;
            }
        }
    }

    /// The clock is set back before the next sample.
    pub(super) fn set_back(&mut self) {
        (self.finished_s, self.present_s) = (self.duration_s(), None);
    }

    /// Time from the first sample to the last, gaps included, s.
    pub(super) fn duration_s(&self) -> f64 {
        self.finished_s + self.present_s.map_or(0.0, |(first, last)| last - first)
    }

    /// Earliest and latest time, s.
    pub(super) const fn whole_s(&self) -> Option<(f64, f64)> {
        self.whole_s
    }
}
