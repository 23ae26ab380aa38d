//! Holds automatic calibrations back while samples are queued: before they begin, and between
//! their steps.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;

/// Fraction of the limit of samples in flight above which samples count as queued. Chosen: by
/// default 2000 samples, which the fastest service stores in some 3 ms.
const QUEUED_FRACTION: usize = 250;

/// Interval between two looks.
const INTERVAL: Duration = Duration::from_millis(100);

/// Looks in a row that must find no queue. Chosen: together longer than a commit during which
/// the log is copied, 10 to 40 ms.
const QUIET_LOOKS: u32 = 3;

/// Looks for which a calibration is held back altogether: ten minutes. Chosen: a service with a
/// queue for so long always has one. From then on calibrations run beside it, with the lowest
/// priority, until one begins in a moment without a queue.
const MAX_HELD: u32 = 6000;

/// Tells whether samples are queued, and holds calibrations back meanwhile. Cheap to clone.
#[derive(Clone)]
pub(super) struct Quiet {
    /// One permit for each sample that may be in flight.
    in_flight: Arc<Semaphore>,
    /// Permits of which fewer mean that samples are queued.
    least_free: usize,
    held: Held,
}

/// The number of looks that have held calibrations back since one began without a queue.
#[derive(Clone, Debug, Default)]
struct Held(Arc<AtomicU32>);

impl Held {
    /// Takes what a look has found; returns whether a calibration may go on. `n_quiet`: looks in
    /// a row before it that found no queue.
    fn look(&self, is_queued: bool, n_quiet: &mut u32) -> bool {
        *n_quiet = if is_queued { 0 } else { *n_quiet + 1 };
        if *n_quiet >= QUIET_LOOKS {
            return true;
        }
        is_queued && self.0.fetch_add(1, Ordering::Relaxed) >= MAX_HELD
    }
}

impl Quiet {
    /// `limit`: the number of permits if none is taken.
    pub(super) fn new(in_flight: Arc<Semaphore>, limit: usize) -> Self {
        let least_free = limit - limit / QUEUED_FRACTION;
        Self { in_flight, least_free, held: Held::default() }
    }

    fn is_queued(&self) -> bool {
        self.in_flight.available_permits() < self.least_free
    }

    /// Waits before a calibration until samples are not queued. Cancel safe.
    pub(super) async fn wait(&self) {
        let mut n_quiet = 0;
        while !self.held.look(self.is_queued(), &mut n_quiet) {
            tokio::time::sleep(INTERVAL).await;
        }
        if n_quiet > 0 {
            self.held.0.store(0, Ordering::Relaxed);
        }
    }

    /// Blocks between two steps of a calibration while samples are queued, or until it is
    /// `cancelled`.
    pub(super) fn pause(&self, cancelled: &CancellationToken) {
        let mut n_quiet = 0;
        let is_free = !self.is_queued();
        while !is_free
            && !cancelled.is_cancelled()
            && !self.held.look(self.is_queued(), &mut n_quiet)
        {
            std::thread::sleep(INTERVAL);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns whether a calibration may go on after each look, by whether samples were queued.
    fn looks(held: &Held, looks: &[bool]) -> Vec<bool> {
        let mut n_quiet = 0;
        looks.iter().map(|&is_queued| held.look(is_queued, &mut n_quiet)).collect()
    }

    #[test]
    fn a_calibration_begins_after_some_looks_without_a_queue() {
        let begun = looks(&Held::default(), &[false, false, false]);
        assert_eq!(begun, [false, false, true]);
        let begun = looks(&Held::default(), &[false, false, true, false, false, false]);
        assert_eq!(begun, [false, false, false, false, false, true]);
    }

    #[test]
    fn calibrations_are_not_held_back_for_ever() {
        let held = Held::default();
        let n_held = |looks: &mut dyn Iterator<Item = bool>| {
            let mut n_quiet = 0;
            looks.take_while(|&is_queued| !held.look(is_queued, &mut n_quiet)).count()
        };
        let half = usize::try_from(MAX_HELD / 2).unwrap();
        assert_eq!(n_held(&mut std::iter::repeat_n(true, half)), half);
        // What has no queue now and then is held back no longer.
        let flicker = (0..).map(|i| i % 2 == 0);
        assert_eq!(n_held(&mut flicker.take(10 * half)), 2 * half);
        assert_eq!(n_held(&mut std::iter::repeat_n(true, half)), 0, "nor are the next ones");
    }

    #[tokio::test]
    async fn a_calibration_that_begins_without_a_queue_is_held_back_again() {
        let in_flight = Arc::new(Semaphore::new(1000));
        let quiet = Quiet::new(in_flight.clone(), 1000);
        quiet.held.0.store(MAX_HELD, Ordering::Relaxed);
        let queued = in_flight.clone().acquire_many_owned(5).await.unwrap();
        quiet.wait().await;
        assert_eq!(quiet.held.0.load(Ordering::Relaxed), MAX_HELD + 1);
        drop(queued);
        quiet.wait().await;
        assert_eq!(quiet.held.0.load(Ordering::Relaxed), 0);
    }

    #[test]
    fn a_cancelled_calibration_is_not_held_back() {
        let quiet = Quiet::new(Arc::new(Semaphore::new(0)), 1000);
        let cancelled = CancellationToken::new();
        cancelled.cancel();
        quiet.pause(&cancelled);
        assert_eq!(quiet.held.0.load(Ordering::Relaxed), 0);
    }
}
