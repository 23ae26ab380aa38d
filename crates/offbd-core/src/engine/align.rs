//! Second stage: puts samples in order of time.
//!
//! A sample waits for earlier ones for at most the reorder window, measured in the
//! samples' own time. One whose `seq` follows directly on the last released, with a time
//! soon after it, does not wait. The order depends on the samples alone.

use alloc::collections::VecDeque;
use serde::{Deserialize, Serialize};

use crate::vocabulary::Sample;

/// Most waiting samples; beyond it the earliest is released early. Half a second at 8
/// kHz.
const MAX_WAITING: usize = 4096;

/// Waiting samples for which there is always room. Chosen: most wait for none or few others.
const FEW_WAITING: usize = 4;

/// The waiting samples.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Align {
    /// Ascending in time.
    waiting: VecDeque<Sample>,
    newest_s: f64,
    released: Option<Sample>,
}

impl Align {
    /// Adds a sample later than all that were released.
    pub(super) fn push(&mut self, sample: Sample) {
        let first = self.waiting.is_empty() && self.released.is_none();
        self.newest_s = if first { sample.t_s } else { self.newest_s.max(sample.t_s) };
        // Searched from the end: most samples are the latest.
        let after = self.waiting.iter().rev().take_while(|s| s.t_s > sample.t_s).count();
        match after {
            0 => self.waiting.push_back(sample),
            _ => self.waiting.insert(self.waiting.len() - after, sample),
        }
    }

    /// Lets a sample pass that follows the last one while none waits. Returns whether it has
    /// passed; then it is not to be added. Most samples do.
    pub(super) fn pass(&mut self, sample: &Sample, interval_s: f64) -> bool {
        let passes = self.waiting.is_empty() && self.follows(sample, interval_s);
        if passes {
            self.newest_s = self.newest_s.max(sample.t_s);
            self.released = Some(*sample);
        }
        passes
    }

    /// Returns the next sample in order if it is due, or if it follows the last one.
    pub(super) fn pop(&mut self, reorder_s: f64, interval_s: f64) -> Option<Sample> {
        let next = self.waiting.front()?;
        let due = self.newest_s - next.t_s >= reorder_s || self.waiting.len() > MAX_WAITING;
        if due || self.follows(next, interval_s) { self.flush() } else { None }
    }

    /// Whether a sample is the one after the last released, by its number and at most two
    /// sample intervals later.
    fn follows(&self, next: &Sample, interval_s: f64) -> bool {
        self.released.as_ref().is_some_and(|last| {
            let seq = last.seq.and_then(|seq| seq.checked_add(1));
            seq.is_some() && seq == next.seq && next.t_s - last.t_s <= 2.0 * interval_s
        })
    }

    /// Returns the next sample in order, due or not.
    pub(super) fn flush(&mut self) -> Option<Sample> {
        let next = self.waiting.pop_front()?;
        self.released = Some(next);
        if self.waiting.is_empty() {
            self.waiting.shrink_to(FEW_WAITING);
        }
        Some(next)
    }

    /// Forgets the time of the samples released; none must wait.
    pub(super) fn restart(&mut self) {
        *self = Self::default();
    }

    /// Time of the last released sample, s.
    pub(super) fn released_s(&self) -> Option<f64> {
        self.released.map(|s| s.t_s)
    }

    pub(super) fn n_waiting(&self) -> usize {
        self.waiting.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(seq: Option<u64>, t_s: f64) -> Sample {
        Sample { seq, t_s, ..Sample::default() }
    }

    fn released(samples: &[Sample]) -> Vec<f64> {
        let mut align = Align::default();
        let mut out = Vec::new();
        for &s in samples {
            align.push(s);
            while let Some(s) = align.pop(0.1, 0.1) {
                out.push(s.t_s);
            }
        }
        while let Some(s) = align.flush() {
            out.push(s.t_s);
        }
        out
    }

    #[test]
    fn out_of_order_within_the_window_is_put_in_order() {
        let times = [0.0, 0.02, 0.01, 0.05, 0.04, 0.2, 0.15];
        let samples: Vec<Sample> = times.iter().map(|&t| sample(None, t)).collect();
        assert_eq!(released(&samples), [0.0, 0.01, 0.02, 0.04, 0.05, 0.15, 0.2]);
    }

    #[test]
    fn what_follows_on_does_not_wait() {
        let mut align = Align::default();
        for (seq, t) in [(7, 0.0), (8, 0.01), (9, 0.15)] {
            align.push(sample(Some(seq), t));
        }
        let out: Vec<f64> = core::iter::from_fn(|| align.pop(0.1, 0.1)).map(|s| s.t_s).collect();
        assert_eq!(out, [0.0, 0.01, 0.15]);
        align.push(sample(Some(11), 0.16));
        assert!(align.pop(0.1, 0.1).is_none(), "seq 10 may still come");
    }

    #[test]
    fn the_memory_of_many_that_have_waited_is_returned() {
        let mut align = Align::default();
        (0..1000).for_each(|i| align.push(sample(None, f64::from(i))));
        while align.flush().is_some() {}
        assert!(align.waiting.capacity() <= FEW_WAITING, "{}", align.waiting.capacity());
    }
}
