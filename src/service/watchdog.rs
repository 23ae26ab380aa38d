//! Notices that ingest has stalled: the samples in flight are at their limit, so
//! nothing more is taken, and nothing is committed either. Whatever holds them,
//! the service cannot take telemetry then, and `/readyz` must say so.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use tokio::sync::Semaphore;
use tokio::time::MissedTickBehavior;
use tokio_util::sync::CancellationToken;

/// How long nothing may be committed while the samples in flight are at their limit.
/// A commit takes 1 to 50 ms, with syncs of 1.5 s some 3 s.
pub(super) const STALLED_AFTER: Duration = Duration::from_secs(10);

/// How often it is looked.
const EVERY: Duration = Duration::from_secs(1);

/// Since when nothing has been committed although the limit was reached.
#[derive(Debug, Default)]
struct Stall {
    n_commits: u64,
    since: Option<Instant>,
}

impl Stall {
    /// Whether ingest has stalled by `now`; `is_full` says whether the samples in flight
    /// are at their limit, `n_commits` counts the commits.
    fn advance(&mut self, now: Instant, is_full: bool, n_commits: u64) -> bool {
        if !is_full || n_commits != self.n_commits {
            self.since = is_full.then_some(now);
            self.n_commits = n_commits;
        }
        let since = is_full.then(|| *self.since.get_or_insert(now));
        since.is_some_and(|since| now.duration_since(since) >= STALLED_AFTER)
    }
}

/// Looks at the ingest of one service.
pub(super) struct Watchdog {
    /// A permit for each sample that may be in flight.
    pub(super) in_flight: Arc<Semaphore>,
    /// Samples in the longest batch: without room for it, the limit is reached.
    pub(super) batch_samples: usize,
    pub(super) n_commits: Arc<AtomicU64>,
    /// What is found.
    pub(super) stalled: Arc<AtomicBool>,
    pub(super) closing: CancellationToken,
}

impl Watchdog {
    /// Looks every [`EVERY`] until the service closes.
    pub(super) async fn run(self) {
        let mut ticks = tokio::time::interval(EVERY);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut stall = Stall::default();
        loop {
            tokio::select! {
                () = self.closing.cancelled() => return,
                now = ticks.tick() => self.look(&mut stall, now.into_std()),
            }
        }
    }

    fn look(&self, stall: &mut Stall, now: Instant) {
        let is_full = self.in_flight.available_permits() < self.batch_samples;
        let stalled = stall.advance(now, is_full, self.n_commits.load(Ordering::Relaxed));
        metrics::gauge!("offbd_ingest_stalled").set(f64::from(u8::from(stalled)));
        if self.stalled.swap(stalled, Ordering::Relaxed) == stalled {
            return;
        }
        if stalled {
            let seconds = STALLED_AFTER.as_secs();
            tracing::error!(seconds, "ingest has stalled: nothing is committed, nothing taken");
        } else {
            tracing::info!("ingest goes on");
        }
    }
}

#[cfg(test)]
#[expect(clippy::disallowed_methods, reason = "only a beginning to count from")]
mod tests {
    use super::*;

    /// What is said at each of `looks`: after how many seconds, whether the limit is
    /// reached, how many commits there were.
    fn said(looks: &[(u64, bool, u64)]) -> Vec<bool> {
        let (begun, mut stall) = (Instant::now(), Stall::default());
        let at = |s: u64| begun + Duration::from_secs(s);
        looks.iter().map(|&(s, full, n)| stall.advance(at(s), full, n)).collect()
    }

    const LIMIT: u64 = STALLED_AFTER.as_secs();

    #[test]
    fn full_without_a_commit_is_a_stall_until_one_comes_or_there_is_room() {
        let looks = [(0, true, 7), (LIMIT - 1, true, 7), (LIMIT, true, 7), (LIMIT + 1, true, 8)];
        assert_eq!(said(&looks), [false, false, true, false]);
        let looks = [(0, true, 7), (LIMIT, true, 7), (LIMIT + 1, false, 7), (LIMIT + 2, true, 7)];
        assert_eq!(said(&looks), [false, true, false, false]);
    }

    #[test]
    fn a_long_rest_before_the_limit_is_reached_does_not_count() {
        let looks = [(0, false, 7), (100 * LIMIT, true, 7), (101 * LIMIT, true, 7)];
        assert_eq!(said(&looks), [false, false, true]);
    }

    #[test]
    fn full_with_commits_is_no_stall() {
        let looks: Vec<_> = (0..100).map(|i| (i * LIMIT / 2, true, i)).collect();
        assert!(said(&looks).iter().all(|stalled| !stalled));
    }
}
