//! When each asset was last heard of, for the fleet at a glance. Kept in memory
//! alone: a restart forgets it, and the next batch brings it back.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::store::Micros;

/// What is known of one asset; as many as the registry has.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Presence {
    session: String,
    pub(super) seen_at: Micros,
    /// How much later than the promptest of the session the last batch came, s.
    pub(super) lag_s: f64,
    /// Arrival minus the device's clock, s, at its least.
    least_offset_s: f64,
}

#[derive(Clone, Debug, Default)]
pub(super) struct Presences {
    by_asset: Arc<Mutex<BTreeMap<String, Presence>>>,
}

impl Presences {
    fn lock(&self) -> MutexGuard<'_, BTreeMap<String, Presence>> {
        self.by_asset.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A batch of `session` came at `at`, whose last sample is of `t_s`.
    pub(super) fn note(&self, asset: &str, session: &str, at: Micros, t_s: f64) {
        let offset_s = at as f64 / 1e6 - t_s;
        let mut all = self.lock();
        let before = all.get(asset).filter(|before| before.session == session);
        let least_offset_s = before.map_or(offset_s, |before| before.least_offset_s.min(offset_s));
        let lag_s = offset_s - least_offset_s;
        let session = session.to_owned();
        let presence = Presence { session, seen_at: at, lag_s, least_offset_s };
        all.insert(asset.to_owned(), presence);
    }

    pub(super) fn of(&self, asset: &str) -> Option<Presence> {
        self.lock().get(asset).cloned()
    }

    pub(super) fn forget(&self, asset: &str) {
        self.lock().remove(asset);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lag_is_what_a_batch_comes_later_than_the_promptest() {
        let presences = Presences::default();
        let note = |at_s: f64, t_s: f64, session: &str| {
            presences.note("a", session, (at_s * 1e6) as Micros, t_s);
            presences.of("a").unwrap().lag_s
        };
        assert!(note(1000.5, 0.5, "one").abs() < 1e-6);
        assert!((note(1003.5, 1.0, "one") - 2.5).abs() < 1e-6, "three seconds for half a one");
        assert!(note(1003.6, 3.7, "one").abs() < 1e-6, "prompter than ever");
        assert!(note(2000.0, 0.0, "two").abs() < 1e-6, "another session, another clock");
        presences.forget("a");
        assert_eq!(presences.of("a"), None);
    }
}
