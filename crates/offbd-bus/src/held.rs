//! Batches that cannot be settled at present and are tried again, while the broker keeps them.
//!
//! The batches of an asset are tried again one after the other, in order of arrival, and those
//! that arrive meanwhile wait behind them. Other assets are not concerned.

use std::collections::BTreeMap;
use std::time::Duration;

use super::RETRY_INTERVAL;

/// Pause before a batch is tried again for the first time; each later one is twice as long, up
/// to [`RETRY_INTERVAL`]. Chosen: a planned move of a partition takes 0.1 to 0.4 s.
const FIRST_PAUSE: Duration = Duration::from_millis(100);

/// Batches of assets that wait, each with its number in order of arrival.
pub(super) struct Held<T> {
    lines: BTreeMap<String, Line<T>>,
}

/// The batches of one asset. Either one of them is being tried, or a pause passes.
struct Line<T> {
    waiting: BTreeMap<u64, T>,
    trying: Option<u64>,
    pause: Duration,
}

impl<T> Default for Held<T> {
    fn default() -> Self {
        Self { lines: BTreeMap::new() }
    }
}

impl<T> Held<T> {
    /// Lets a new batch wait behind those of its asset; returns it if there are none.
    pub(super) fn join(&mut self, asset: &str, number: u64, batch: T) -> Option<T> {
        match self.lines.get_mut(asset) {
            Some(line) => {
                line.waiting.insert(number, batch);
                None
            }
            None => Some(batch),
        }
    }

    /// Keeps a batch that could not be settled. Returns the pause after which the first one of
    /// its asset is due, unless that is known already.
    pub(super) fn keep(&mut self, asset: &str, number: u64, batch: T) -> Option<Duration> {
        if let Some(line) = self.lines.get_mut(asset) {
            line.waiting.insert(number, batch);
            if line.trying != Some(number) {
                return None;
            }
            line.trying = None;
            line.pause = RETRY_INTERVAL.min(2 * line.pause);
            return Some(line.pause);
        }
        let waiting = BTreeMap::from([(number, batch)]);
        self.lines.insert(asset.to_owned(), Line { waiting, trying: None, pause: FIRST_PAUSE });
        Some(FIRST_PAUSE)
    }

    /// Returns the first batch of an asset, to be tried, after the pause.
    pub(super) fn due(&mut self, asset: &str) -> Option<(u64, T)> {
        let line = self.lines.get_mut(asset)?;
        let first = line.waiting.pop_first();
        line.trying = first.as_ref().map(|(number, _)| *number);
        first
    }

    /// Notes that a batch is settled. Returns the next one of its asset, to be tried at once.
    pub(super) fn settle(&mut self, asset: &str, number: u64) -> Option<(u64, T)> {
        let line = self.lines.get_mut(asset)?;
        if line.trying != Some(number) {
            return None;
        }
        line.pause = FIRST_PAUSE;
        let next = self.due(asset);
        if next.is_none() {
            self.lines.remove(asset);
        }
        next
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn batches_of_an_asset_are_tried_again_in_order_and_one_at_a_time() {
        let mut held = Held::default();
        assert_eq!(held.join("a", 0, "a0"), Some("a0"), "nothing waits");
        // Three were under way at the same time; the last one fails first.
        assert_eq!(held.keep("a", 2, "a2"), Some(FIRST_PAUSE));
        assert_eq!(held.keep("a", 0, "a0"), None);
        assert_eq!(held.settle("a", 1), None, "one of those under way is settled");
        assert_eq!(held.join("b", 4, "b4"), Some("b4"), "another asset goes on");
        assert_eq!(held.join("a", 5, "a5"), None);
        assert_eq!(held.due("a"), Some((0, "a0")));
        assert_eq!(held.keep("a", 0, "a0"), Some(2 * FIRST_PAUSE));
        assert_eq!(held.due("a"), Some((0, "a0")));
        assert_eq!(held.settle("a", 0), Some((2, "a2")));
        assert_eq!(held.keep("a", 2, "a2"), Some(2 * FIRST_PAUSE));
        assert_eq!(held.due("a"), Some((2, "a2")));
        assert_eq!(held.settle("a", 2), Some((5, "a5")));
        assert_eq!(held.settle("a", 5), None);
        assert_eq!(held.join("a", 6, "a6"), Some("a6"), "all are settled");
    }

    #[test]
    fn the_pause_has_a_limit() {
        let mut held = Held::default();
        let mut pause = held.keep("a", 0, ());
        for _ in 0..10 {
            held.due("a");
            pause = held.keep("a", 0, ());
        }
        assert_eq!(pause, Some(RETRY_INTERVAL));
    }
}
