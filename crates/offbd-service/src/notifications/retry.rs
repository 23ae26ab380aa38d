//! How messages are sent, and when a failed attempt is repeated.

use std::time::Duration;

use super::targets::TargetPolicy;
use offbd_store::Micros;

/// How notifications are sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NotificationSettings {
    /// Address of the dashboard for links, without a slash at its end.
    pub public_url: Option<String>,
    /// Where messages may be sent.
    pub targets: TargetPolicy,
    /// Time limit of one attempt.
    pub timeout: Duration,
    /// Delay after the first failed attempt; it doubles with each further one.
    pub first_retry: Duration,
    /// Age at which a message is given up.
    pub give_up_after: Duration,
}

impl Default for NotificationSettings {
    fn default() -> Self {
        Self {
            public_url: None,
            targets: TargetPolicy::default(),
            timeout: Duration::from_secs(10),
            first_retry: Duration::from_secs(5),
            give_up_after: Duration::from_secs(86_400),
        }
    }
}

/// Longest delay between two attempts, unless the target asks for a longer one.
const LONGEST_RETRY: Duration = Duration::from_secs(3600);

/// Returns the time of the next attempt after the `attempts`-th has failed at `now`: the delay
/// doubles from `first_retry` to an hour, or is what the target asked for, if that is longer.
/// Returns `None` if the message, created at `created_at`, is to be given up.
pub(super) fn next_attempt(
    settings: &NotificationSettings,
    attempts: i64,
    created_at: Micros,
    now: Micros,
    retry_after: Option<Duration>,
) -> Option<Micros> {
    let doublings = u32::try_from(attempts.clamp(1, 30) - 1).unwrap_or_default();
    let delay = settings.first_retry.saturating_mul(1 << doublings).min(LONGEST_RETRY);
    let delay = micros(delay.max(retry_after.unwrap_or_default()));
    let next = now.saturating_add(delay);
    let end = created_at.saturating_add(micros(settings.give_up_after));
    (next <= end).then_some(next)
}

/// A duration in microseconds.
pub(crate) fn micros(duration: Duration) -> Micros {
    Micros::try_from(duration.as_micros()).unwrap_or(Micros::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Micros = 1_000_000;

    /// The times of all attempts of a message that always fails, s after its creation.
    fn attempts(retry_after: Option<Duration>) -> Vec<i64> {
        let (settings, mut now, mut times) = (NotificationSettings::default(), 0, vec![0]);
        while let Some(next) = next_attempt(&settings, times.len() as i64, 0, now, retry_after) {
            now = next;
            times.push(now / SECOND);
        }
        times
    }

    #[test]
    fn delays_grow_to_an_hour_and_end_after_a_day() {
        let times = attempts(None);
        assert_eq!(times[..6], [0, 5, 15, 35, 75, 155]);
        let delays: Vec<_> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        assert!(delays.is_sorted(), "{delays:?}");
        assert_eq!(delays.last(), Some(&3600));
        let last = *times.last().unwrap();
        assert!((86_400 - 3600..=86_400).contains(&last), "{last}");
    }

    #[test]
    fn what_the_target_asks_for_counts_if_it_is_longer() {
        let times = attempts(Some(Duration::from_secs(100)));
        assert_eq!(times[..7], [0, 100, 200, 300, 400, 500, 660]);
        assert_eq!(attempts(Some(Duration::from_secs(100_000))), [0], "not within a day");
    }

    /// A message that waited for a day behind another one has one attempt.
    #[test]
    fn an_old_message_is_given_up_after_its_first_failure() {
        let settings = NotificationSettings::default();
        assert_eq!(next_attempt(&settings, 1, 0, 86_400 * SECOND, None), None);
        assert!(next_attempt(&settings, 1, 0, 86_390 * SECOND, None).is_some());
    }
}
