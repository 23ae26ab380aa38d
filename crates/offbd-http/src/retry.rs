//! When a client is to come again that was refused because a limit is reached. If all came after
//! a second, however many they are, a service that cannot keep up would do nothing but refuse them.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use offbd_service::RETRY_AFTER_S;

/// Refused requests that come again per second. Chosen: to refuse them takes a small part of a
/// core.
const RETRIES_PER_S: u64 = 500;

/// Longest time after which a client is to come again. Chosen.
const LONGEST_RETRY: Duration = Duration::from_secs(30);

const SECOND_US: u64 = 1_000_000;

/// Gives refused requests their times.
#[derive(Debug, Default)]
struct RetryTimes {
    /// The time of the last one, µs.
    last_us: AtomicU64,
}

impl RetryTimes {
    /// Returns after how many seconds a request is to come again that is refused at `now_us`.
    fn after_s(&self, now_us: u64) -> u32 {
        let first = now_us + RETRY_AFTER_S * SECOND_US;
        let longest = now_us + LONGEST_RETRY.as_micros() as u64;
        let next = |last: u64| Some((last + SECOND_US / RETRIES_PER_S).clamp(first, longest));
        let before = self.last_us.fetch_update(Ordering::Relaxed, Ordering::Relaxed, next);
        let at = before.ok().and_then(next).unwrap_or(first);
        u32::try_from((at - now_us) / SECOND_US).unwrap_or(u32::MAX)
    }
}

/// Returns after how many seconds a client is to come again that is refused now.
#[expect(clippy::disallowed_methods, reason = "no verdict depends on it")]
pub(super) fn retry_after_s() -> u32 {
    static TIMES: RetryTimes = RetryTimes { last_us: AtomicU64::new(0) };
    static BEGIN: OnceLock<Instant> = OnceLock::new();
    let now = BEGIN.get_or_init(Instant::now).elapsed();
    TIMES.after_s(u64::try_from(now.as_micros()).unwrap_or(u64::MAX / 2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_come_again_after_a_second_and_many_one_after_the_other() {
        let times = RetryTimes::default();
        let now = 7 * SECOND_US;
        let after: Vec<_> = (0..20_000).map(|_| times.after_s(now)).collect();
        assert!(after[..500].iter().all(|&s| s == 1));
        assert_eq!((after[501], after[5000], after[19_999]), (2, 11, 30));
        // Once they have come, there is nothing to wait for.
        assert_eq!(times.after_s(now + 40 * SECOND_US), 1);
    }
}
