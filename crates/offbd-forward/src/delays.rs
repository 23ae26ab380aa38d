//! When an asset whose batch was not stored is tried again, and why it waits.

use std::collections::BTreeMap;
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
    /// Returns up to `limit` of `assets` that may be tried, and forgets all others.
    pub(super) fn due(&self, assets: Vec<String>, limit: usize) -> Vec<String> {
        let (mut delays, now) = (self.assets(), now());
        delays.retain(|asset, _| assets.contains(asset));
        let is_due = |asset: &String| {
            delays.get(asset).and_then(|delay| delay.until).is_none_or(|until| until <= now)
        };
        assets.into_iter().filter(is_due).take(limit).collect()
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

    /// Returns how long it is until the next asset is due, at most [`LONGEST_DELAY`].
    pub(super) fn rest(&self) -> Duration {
        let next = self.assets().values().filter_map(|delay| delay.until).min();
        next.map_or(LONGEST_DELAY, |at| at.saturating_duration_since(now()))
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
