//! The most recent trace points of an open session, kept while a client watches it.

use std::cell::Cell;
use std::collections::VecDeque;

use offbd_core::engine::State;
use offbd_wire::trace::{TracePoint, TraceView};

/// Limit of points: 20 s, since evidence is renewed 20 times a second; the oldest are
/// dropped.
const MAX_POINTS: usize = 400;

/// Samples after the last read, 20 s at 100 Hz; then collecting stops.
const MAX_UNREAD: u32 = 2000;

/// The most recent points of a trace. Nothing is collected before the first read.
#[derive(Debug, Default)]
pub(crate) struct RecentTrace {
    points: VecDeque<TracePoint>,
    /// Points that were dropped before the first one kept.
    n_dropped: u64,
    /// Samples still to evaluate for the trace before collecting stops.
    n_remaining: Cell<u32>,
}

impl RecentTrace {
    /// Adds the point of `state` if a client watches.
    pub(crate) fn push(&mut self, state: impl FnOnce() -> State) {
        let Some(n_remaining) = self.n_remaining.get().checked_sub(1) else {
            self.n_dropped += self.points.len() as u64;
            self.points = VecDeque::new();
            return;
        };
        self.n_remaining.set(n_remaining);
        let Some(point) = TracePoint::of(&state()) else { return };
        if self.points.back().is_some_and(|last| last.t_s() >= point.t_s()) {
            return;
        }
        if self.points.len() == MAX_POINTS {
            self.points.pop_front();
            self.n_dropped += 1;
        }
        self.points.push_back(point);
    }

    /// Returns the points after the first `seen`, and the total number of points so far.
    pub(crate) fn since(&self, seen: u64) -> (TraceView, u64) {
        self.n_remaining.set(MAX_UNREAD);
        let mut trace = TraceView::default();
        let skip = usize::try_from(seen.saturating_sub(self.n_dropped)).unwrap_or(usize::MAX);
        self.points.iter().skip(skip).for_each(|point| trace.push(point));
        (trace, self.n_dropped + self.points.len() as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use offbd_core::diagnosis::Evidence;
    use offbd_core::vocabulary::SimTime;

    fn at(t_s: f64) -> State {
        let at = SimTime::new(t_s);
        let evidence = Evidence { at, ..Evidence::default() };
        State { at, evidence, ..State::default() }
    }

    #[test]
    fn nothing_is_collected_before_the_first_read() {
        let mut recent = RecentTrace::default();
        recent.push(|| unreachable!("no client watches"));
        assert_eq!(recent.since(0), (TraceView::default(), 0));
    }

    #[test]
    fn each_point_is_returned_once_and_the_oldest_are_dropped() {
        let mut recent = RecentTrace::default();
        recent.since(0);
        (0..3).for_each(|i| recent.push(|| at(f64::from(i))));
        let (trace, seen) = recent.since(0);
        assert_eq!((trace.t_s, seen), (vec![0.0, 1.0, 2.0], 3));
        recent.push(|| at(2.0));
        recent.push(|| at(3.0));
        let (trace, seen) = recent.since(seen);
        assert_eq!((trace.t_s, seen), (vec![3.0], 4));
        for i in 0..MAX_POINTS {
            recent.push(|| at(4.0 + i as f64));
            recent.since(u64::MAX);
        }
        let (trace, seen) = recent.since(0);
        assert_eq!((trace.t_s.len(), trace.t_s[0], seen), (MAX_POINTS, 4.0, 4 + MAX_POINTS as u64));
    }
}
