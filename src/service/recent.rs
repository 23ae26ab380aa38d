//! The last moments of an open session, kept while somebody watches it.

use std::cell::Cell;
use std::collections::VecDeque;

use crate::wire::trace::{TracePoint, TraceView};
use offbd_core::engine::State;

/// Moments that are kept: 20 s of a rig at 100 Hz; the oldest go first.
const MAX_POINTS: usize = 2000;

/// Moments taken after the last look; then nobody watches any more.
const MAX_UNSEEN: u32 = 2000;

/// Costs nothing until somebody looks.
#[derive(Debug, Default)]
pub(super) struct Recent {
    points: VecDeque<TracePoint>,
    /// How many moments have been taken before the first one kept.
    n_gone: u64,
    /// Moments still to be taken for the one who looked.
    wanted: Cell<u32>,
}

impl Recent {
    /// Takes the moment that `state` gives, if somebody watches.
    pub(super) fn take(&mut self, state: impl FnOnce() -> State) {
        let Some(wanted) = self.wanted.get().checked_sub(1) else {
            self.n_gone += self.points.len() as u64;
            self.points.clear();
            return;
        };
        self.wanted.set(wanted);
        let Some(point) = TracePoint::of(&state()) else { return };
        if self.points.back().is_some_and(|last| last.t_s() >= point.t_s()) {
            return;
        }
        if self.points.len() == MAX_POINTS {
            self.points.pop_front();
            self.n_gone += 1;
        }
        self.points.push_back(point);
    }

    /// The moments after the first `seen`, and how many there have been.
    pub(super) fn since(&self, seen: u64) -> (TraceView, u64) {
        self.wanted.set(MAX_UNSEEN);
        let mut trace = TraceView::default();
        let skip = usize::try_from(seen.saturating_sub(self.n_gone)).unwrap_or(usize::MAX);
        self.points.iter().skip(skip).for_each(|point| trace.push(point));
        (trace, self.n_gone + self.points.len() as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use offbd_core::vocabulary::SimTime;

    fn at(t_s: f64) -> State {
        State { at: SimTime::new(t_s), ..State::default() }
    }

    #[test]
    fn nothing_is_kept_for_nobody() {
        let mut recent = Recent::default();
        recent.take(|| unreachable!("nobody watches"));
        assert_eq!(recent.since(0), (TraceView::default(), 0));
    }

    #[test]
    fn each_moment_is_given_once_and_the_oldest_go() {
        let mut recent = Recent::default();
        recent.since(0);
        (0..3).for_each(|i| recent.take(|| at(f64::from(i))));
        let (trace, seen) = recent.since(0);
        assert_eq!((trace.t_s, seen), (vec![0.0, 1.0, 2.0], 3));
        recent.take(|| at(2.0));
        recent.take(|| at(3.0));
        let (trace, seen) = recent.since(seen);
        assert_eq!((trace.t_s, seen), (vec![3.0], 4));
        for i in 0..MAX_POINTS {
            recent.take(|| at(4.0 + i as f64));
            recent.since(u64::MAX);
        }
        let (trace, seen) = recent.since(0);
        assert_eq!((trace.t_s.len(), trace.t_s[0], seen), (MAX_POINTS, 4.0, 4 + MAX_POINTS as u64));
    }
}
