//! Detects a stall of ingest: the samples in flight are at their limit, so no batch is
//! accepted, and nothing is committed. Then `/readyz` reports that the service cannot
//! accept telemetry.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use tokio::sync::Semaphore;
use tokio::time::MissedTickBehavior;
use tokio_util::sync::CancellationToken;

/// Time without a commit, while the samples in flight are at their limit, that counts as a
/// stall. A commit takes 1 to 50 ms, some 3 s if a disk sync takes 1.5 s.
pub(in crate::service) const STALLED_AFTER: Duration = Duration::from_secs(10);

/// Interval between two checks.
const INTERVAL: Duration = Duration::from_secs(1);

/// Detects a period at the limit without a commit.
#[derive(Debug, Default)]
struct Stall {
    n_commits: u64,
    since: Option<Instant>,
}

impl Stall {
    /// Returns whether ingest is stalled at `now`. `is_full`: whether the samples in flight
    /// are at their limit; `n_commits`: the number of commits so far.
    fn advance(&mut self, now: Instant, is_full: bool, n_commits: u64) -> bool {
        if !is_full || n_commits != self.n_commits {
            self.since = is_full.then_some(now);
            self.n_commits = n_commits;
        }
        let since = is_full.then(|| *self.since.get_or_insert(now));
        since.is_some_and(|since| now.duration_since(since) >= STALLED_AFTER)
    }
}

/// Monitors the ingest of one service.
pub(in crate::service) struct Watchdog {
    /// One permit for each sample that may be in flight.
    pub(in crate::service) in_flight: Arc<Semaphore>,
    /// Samples in the longest batch; the limit counts as reached if there is no room for
    /// it.
    pub(in crate::service) batch_samples: usize,
    pub(in crate::service) n_commits: Arc<AtomicU64>,
    /// The result.
    pub(in crate::service) stalled: Arc<AtomicBool>,
    pub(in crate::service) closing: CancellationToken,
}

impl Watchdog {
    /// Checks every [`INTERVAL`] until the service shuts down.
    pub(in crate::service) async fn run(self) {
        let mut ticks = tokio::time::interval(INTERVAL);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut stall = Stall::default();
        loop {
            tokio::select! {
                () = self.closing.cancelled() => return,
                now = ticks.tick() => self.check(&mut stall, now.into_std()),
            }
        }
    }

    fn check(&self, stall: &mut Stall, now: Instant) {
        let is_full = self.in_flight.available_permits() < self.batch_samples;
        let stalled = stall.advance(now, is_full, self.n_commits.load(Ordering::Relaxed));
        metrics::gauge!("offbd_ingest_stalled").set(f64::from(u8::from(stalled)));
        if self.stalled.swap(stalled, Ordering::Relaxed) == stalled {
            return;
        }
        if stalled {
            let seconds = STALLED_AFTER.as_secs();
            tracing::error!(seconds, "ingest is stalled: no batch is accepted or committed");
        } else {
            tracing::info!("ingest has recovered");
        }
    }
}

#[cfg(test)]
#[expect(clippy::disallowed_methods, reason = "only the start of simulated times")]
mod tests {
    use super::*;

    /// Returns the result of each check: time in seconds, whether the limit is reached,
    /// number of commits.
    fn stalled(checks: &[(u64, bool, u64)]) -> Vec<bool> {
        let (start, mut stall) = (Instant::now(), Stall::default());
        let at = |s: u64| start + Duration::from_secs(s);
        checks.iter().map(|&(s, full, n)| stall.advance(at(s), full, n)).collect()
    }

    const LIMIT: u64 = STALLED_AFTER.as_secs();

    #[test]
    fn full_without_a_commit_is_a_stall_until_one_comes_or_there_is_room() {
        let checks = [(0, true, 7), (LIMIT - 1, true, 7), (LIMIT, true, 7), (LIMIT + 1, true, 8)];
        assert_eq!(stalled(&checks), [false, false, true, false]);
        let checks = [(0, true, 7), (LIMIT, true, 7), (LIMIT + 1, false, 7), (LIMIT + 2, true, 7)];
        assert_eq!(stalled(&checks), [false, true, false, false]);
    }

    #[test]
    fn idle_time_before_the_limit_is_reached_does_not_count() {
        let checks = [(0, false, 7), (100 * LIMIT, true, 7), (101 * LIMIT, true, 7)];
        assert_eq!(stalled(&checks), [false, false, true]);
    }

    #[test]
    fn full_with_commits_is_no_stall() {
        let checks: Vec<_> = (0..100).map(|i| (i * LIMIT / 2, true, i)).collect();
        assert!(stalled(&checks).iter().all(|stalled| !stalled));
    }
}
