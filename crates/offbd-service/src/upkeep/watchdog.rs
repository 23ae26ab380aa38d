//! Detects a stall of ingest: batches wait for their commit, and nothing is committed. Then
//! `/readyz` reports that the service does not acknowledge telemetry.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use tokio::sync::Semaphore;
use tokio::time::MissedTickBehavior;
use tokio_util::sync::CancellationToken;

/// Time without a commit, while samples are in flight, that counts as a stall. A commit takes 1 to 50 ms, some 3 s if a disk sync takes 1.5 s.
pub(crate) const STALLED_AFTER: Duration = Duration::from_secs(10);

/// Interval between two checks.
const INTERVAL: Duration = Duration::from_secs(1);

/// Detects a period in which batches wait without a commit.
#[derive(Debug, Default)]
struct Stall {
    n_commits: u64,
    since: Option<Instant>,
}

impl Stall {
    /// Returns whether ingest is stalled at `now`. `is_waiting`: whether samples are in flight;
    /// `n_commits`: the number of commits so far.
    fn advance(&mut self, now: Instant, is_waiting: bool, n_commits: u64) -> bool {
        if !is_waiting || n_commits != self.n_commits {
            self.since = is_waiting.then_some(now);
            self.n_commits = n_commits;
        }
        let since = is_waiting.then(|| *self.since.get_or_insert(now));
        since.is_some_and(|since| now.duration_since(since) >= STALLED_AFTER)
    }
}

/// Monitors the ingest of one service.
pub(crate) struct Watchdog {
    /// One permit for each sample that may be in flight.
    pub(crate) in_flight: Arc<Semaphore>,
    /// The number of permits if none is taken.
    pub(crate) max_in_flight: usize,
    pub(crate) n_commits: Arc<AtomicU64>,
    /// The result.
    pub(crate) stalled: Arc<AtomicBool>,
    pub(crate) closing: CancellationToken,
}

impl Watchdog {
    /// Checks every [`INTERVAL`] until the service shuts down.
    pub(crate) async fn run(self) {
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
        let is_waiting = self.in_flight.available_permits() < self.max_in_flight;
        let stalled = stall.advance(now, is_waiting, self.n_commits.load(Ordering::Relaxed));
        metrics::gauge!("offbd_ingest_stalled").set(f64::from(u8::from(stalled)));
        if self.stalled.swap(stalled, Ordering::Relaxed) == stalled {
            return;
        }
        if stalled {
            let seconds = STALLED_AFTER.as_secs();
            tracing::error!(seconds, "ingest is stalled: batches wait and none is committed");
        } else {
            tracing::info!("ingest has recovered");
        }
    }
}

#[cfg(test)]
#[expect(clippy::disallowed_methods, reason = "only the start of simulated times")]
mod tests {
    use super::*;

    /// Returns the result of each check: time in seconds, whether batches wait, number of
    /// commits.
    fn stalled(checks: &[(u64, bool, u64)]) -> Vec<bool> {
        let (start, mut stall) = (Instant::now(), Stall::default());
        let at = |s: u64| start + Duration::from_secs(s);
        checks.iter().map(|&(s, waiting, n)| stall.advance(at(s), waiting, n)).collect()
    }

    const LIMIT: u64 = STALLED_AFTER.as_secs();

    #[test]
    fn batches_without_a_commit_are_a_stall_until_one_comes_or_none_waits() {
        let checks = [(0, true, 7), (LIMIT - 1, true, 7), (LIMIT, true, 7), (LIMIT + 1, true, 8)];
        assert_eq!(stalled(&checks), [false, false, true, false]);
        let checks = [(0, true, 7), (LIMIT, true, 7), (LIMIT + 1, false, 7), (LIMIT + 2, true, 7)];
        assert_eq!(stalled(&checks), [false, true, false, false]);
    }

    #[test]
    fn idle_time_before_a_batch_does_not_count() {
        let checks = [(0, false, 7), (100 * LIMIT, true, 7), (101 * LIMIT, true, 7)];
        assert_eq!(stalled(&checks), [false, false, true]);
    }

    #[test]
    fn waiting_with_commits_is_not_a_stall() {
        let checks: Vec<_> = (0..100).map(|i| (i * LIMIT / 2, true, i)).collect();
        assert!(stalled(&checks).iter().all(|stalled| !stalled));
    }
}
