//! When an asset whose batch was not stored is tried again, and why it waits.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use serde::Serialize;
use tokio::time::Instant;

use super::answer::Failure;
use super::spool::MAX_NAMED;
use offbd_net::Reasons;

/// Delay after the first failure of an asset; it doubles with each further one.
const FIRST_DELAY: Duration = Duration::from_millis(200);
/// Longest delay between two attempts of an asset.
pub(super) const LONGEST_DELAY: Duration = Duration::from_secs(30);

/// Most assets whose batches are under way at the same time; the others wait until one ends.
/// Chosen: each holds a connection and a batch of up to 4 MiB.
pub(super) const MAX_AT_ONCE: usize = 16;
/// Most of these whose last attempt failed. Chosen: however many do not get an answer, there is
/// room for those that do.
const MAX_FAILING_AT_ONCE: usize = 8;

/// What can be sent.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Due {
    pub assets: Vec<String>,
    /// How long it is until a delay ends, at most [`LONGEST_DELAY`].
    pub next: Duration,
}

/// The assets whose last attempt failed.
#[derive(Debug, Default)]
pub struct Delays {
    assets: Mutex<BTreeMap<String, Delay>>,
}

#[derive(Debug, Default)]
struct Delay {
    /// None before the first failure.
    until: Option<Instant>,
    length: Duration,
    logged: Reasons,
    reason: String,
    answer: String,
}

/// An asset that waits because its last attempt failed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(super) struct DelayView {
    pub asset: String,
    pub reason: String,
    /// The start of the response; empty without a response.
    pub answer: String,
}

impl Delays {
    /// Returns which of `assets`, of which those `under_way` are not to be tried now, may be tried
    /// so that at most [`MAX_AT_ONCE`] are under way, and forgets all others.
    pub(super) fn due(&self, mut assets: Vec<String>, under_way: &BTreeSet<String>) -> Due {
        let (mut delays, now) = (self.assets(), now());
        delays.retain(|asset, _| assets.contains(asset) || under_way.contains(asset));
        assets.retain(|asset| !under_way.contains(asset));
        let until = |asset: &String| delays.get(asset).and_then(|delay| delay.until);
        let next = assets.iter().filter_map(until).filter(|until| *until > now).min();
        let mut room = MAX_AT_ONCE.saturating_sub(under_way.len());
        let n_failing = under_way.iter().filter(|asset| until(asset).is_some()).count();
        let mut room_of_failing = MAX_FAILING_AT_ONCE.saturating_sub(n_failing);
        assets.retain(|asset| {
            let until = until(asset);
            let may = until.is_none_or(|until| until <= now && room_of_failing > 0) && room > 0;
            room -= usize::from(may);
            room_of_failing -= usize::from(may && until.is_some());
            may
        });
        let next = next.map_or(LONGEST_DELAY, |next| next.saturating_duration_since(now));
        Due { assets, next }
    }

    /// Notes a failure; returns whether it is to be logged.
    pub(super) fn failed(&self, asset: &str, failure: &Failure) -> bool {
        let mut delays = self.assets();
        let delay = delays.entry(asset.to_owned()).or_default();
        delay.length = (delay.length * 2).clamp(FIRST_DELAY, LONGEST_DELAY);
        let length = failure.wait.unwrap_or_default().clamp(delay.length, LONGEST_DELAY);
        delay.until = Some(now() + length);
        failure.cause.clone_into(&mut delay.reason);
        failure.answer.clone_into(&mut delay.answer);
        delay.logged.is_new(&failure.cause)
    }

    pub(super) fn succeeded(&self, asset: &str) {
        self.assets().remove(asset);
    }

    /// Returns the assets that wait, at most [`MAX_NAMED`].
    pub(super) fn views(&self) -> Vec<DelayView> {
        let delays = self.assets();
        let views = delays.iter().map(|(asset, delay)| DelayView {
            asset: asset.clone(),
            reason: delay.reason.clone(),
            answer: delay.answer.clone(),
        });
        views.take(MAX_NAMED).collect()
    }

    fn assets(&self) -> MutexGuard<'_, BTreeMap<String, Delay>> {
        self.assets.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[expect(clippy::disallowed_methods, reason = "delays between attempts")]
fn now() -> Instant {
    Instant::now()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(names: std::ops::Range<usize>) -> Vec<String> {
        names.map(|n| format!("a{n:02}")).collect()
    }

    #[test]
    fn assets_without_an_answer_leave_room_for_the_others() {
        let (delays, all, idle) = (Delays::default(), named(0..40), BTreeSet::new());
        let first = delays.due(all.clone(), &idle);
        assert_eq!(first, Due { assets: named(0..MAX_AT_ONCE), next: LONGEST_DELAY });
        let failed = Failure { wait: Some(LONGEST_DELAY), ..Failure::new("no answer") };
        for asset in &first.assets {
            assert!(delays.failed(asset, &failed));
        }
        let second = delays.due(all.clone(), &idle);
        assert_eq!(second.assets, named(16..32));
        assert!(!second.next.is_zero() && second.next <= LONGEST_DELAY);
        for delay in delays.assets().values_mut() {
            delay.until = Some(now());
        }
        // Now all may be tried, the oldest first.
        let third = delays.due(all.clone(), &idle);
        assert_eq!(third.assets, [named(0..8), named(16..24)].concat());
        // Those that go on without an answer take no more than their part.
        let under_way = third.assets[..12].iter().cloned().collect();
        assert_eq!(delays.due(all, &under_way).assets, named(20..24));
    }
}
