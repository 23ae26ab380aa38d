//! When telemetry of each asset last arrived, for the fleet overview. Kept only in memory:
//! lost by a restart, and set again by the next batch.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use offbd_core::engine::{Rejection, UNTESTED_FROM, Unjudged};
use offbd_store::Micros;

/// How much slower than the service's a device's clock may go. Chosen: the crystals of cheap boards
/// are specified to 100 ppm at most. Without it the lag of such a device would grow by 0.2 to
/// 0.4 s in each hour of a session.
const CLOCK_DRIFT: f64 = 1e-4;

/// The last telemetry of one asset.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Presence {
    session: String,
    pub(crate) seen_at: Micros,
    /// Lag of the last batch with a sample behind the fastest one of the session, s; `None` if
    /// there was none.
    pub(crate) lag_s: Option<f64>,
    /// The unjudged samples, if the rig counts as not tested.
    pub(crate) unjudged: Option<Unjudged>,
    /// Rows that were not samples, while no session was open.
    n_malformed: u64,
    /// Smallest difference of arrival time and device clock in the session, s; it grows with time
    /// as that of a clock which is slow.
    least_offset_s: f64,
}

impl Presence {
    /// The smallest offset at the time `at`.
    fn least_offset_s(&self, at: Micros) -> f64 {
        let elapsed_s = at.saturating_sub(self.seen_at).max(0) as f64 / 1e6;
        CLOCK_DRIFT.mul_add(elapsed_s, self.least_offset_s)
    }
}

/// The presence of every asset that has sent telemetry.
#[derive(Clone, Debug, Default)]
pub(crate) struct Presences {
    by_asset: Arc<Mutex<BTreeMap<String, Presence>>>,
}

impl Presences {
    fn lock(&self) -> MutexGuard<'_, BTreeMap<String, Presence>> {
        self.by_asset.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Records that a batch of `session`, whose last sample has the time `t_s`, arrived at
    /// `at`; `unjudged` are the unjudged samples after it, if they are many. Returns the lag of
    /// the batch and the smallest offset, s.
    pub(crate) fn record(
        &self,
        asset: &str,
        session: &str,
        at: Micros,
        t_s: f64,
        unjudged: Option<Unjudged>,
    ) -> (f64, f64) {
        let offset_s = at as f64 / 1e6 - t_s;
        let mut all = self.lock();
        let before = all.get(asset).filter(|before| before.session == session);
        let least_offset_s =
            before.map_or(offset_s, |before| before.least_offset_s(at).min(offset_s));
        let lag_s = offset_s - least_offset_s;
        let presence = Presence {
            session: session.to_owned(),
            seen_at: at,
            lag_s: Some(lag_s),
            unjudged,
            n_malformed: 0,
            least_offset_s,
        };
        all.insert(asset.to_owned(), presence);
        (lag_s, least_offset_s)
    }

    /// Records that a batch without a sample arrived at `at`: only `n` rows that are none.
    /// `unjudged` are the unjudged samples of the open session after it, if they are many;
    /// `None` if no session is open.
    pub(crate) fn record_malformed(
        &self,
        asset: &str,
        at: Micros,
        n: usize,
        unjudged: Option<Option<Unjudged>>,
    ) {
        let mut all = self.lock();
        let presence = all.entry(asset.to_owned()).or_insert_with(|| Presence {
            session: String::new(),
            seen_at: at,
            lag_s: None,
            unjudged: None,
            n_malformed: 0,
            least_offset_s: f64::INFINITY,
        });
        presence.least_offset_s = presence.least_offset_s(at);
        presence.seen_at = at;
        presence.unjudged = unjudged.unwrap_or_else(|| {
            presence.n_malformed += n as u64;
            let (n, why) = (presence.n_malformed, Rejection::Malformed);
            (n >= UNTESTED_FROM).then_some(Unjudged { n, why })
        });
    }

    /// Number of assets whose last samples were not judged.
    pub(crate) fn n_untested(&self) -> usize {
        self.lock().values().filter(|presence| presence.unjudged.is_some()).count()
    }

    /// Records that `asset` has no open session, so that nothing is to be judged.
    pub(crate) fn end_session(&self, asset: &str) {
        if let Some(presence) = self.lock().get_mut(asset) {
            (presence.unjudged, presence.n_malformed) = (None, 0);
        }
    }

    pub(crate) fn of(&self, asset: &str) -> Option<Presence> {
        self.lock().get(asset).cloned()
    }

    pub(crate) fn remove(&self, asset: &str) {
        self.lock().remove(asset);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lag_is_measured_against_the_fastest_batch_of_the_session() {
        let presences = Presences::default();
        let lag_s = |at_s: f64, t_s: f64, session: &str| {
            presences.record("a", session, (at_s * 1e6) as Micros, t_s, None);
            presences.of("a").unwrap().lag_s.unwrap()
        };
        assert!(lag_s(1000.5, 0.5, "one").abs() < 1e-6);
        assert!((lag_s(1003.5, 1.0, "one") - 2.5).abs() < 1e-3, "3 s for 0.5 s of samples");
        assert!(lag_s(1003.6, 3.7, "one").abs() < 1e-6, "the fastest so far");
        assert!(lag_s(2000.0, 0.0, "two").abs() < 1e-6, "another session, another clock");
        presences.remove("a");
        assert_eq!(presences.of("a"), None);
    }

    #[test]
    fn a_slow_clock_does_not_show_as_lag() {
        let presences = Presences::default();
        let lag_s = |at_s: f64, t_s: f64| {
            presences.record("a", "one", (at_s * 1e6) as Micros, t_s, None);
            presences.of("a").unwrap().lag_s.unwrap()
        };
        // A day of a clock that is slow by 50 ppm, each batch a second long.
        let slow = |at_s: f64| at_s * (1.0 - 50e-6);
        let worst = (0..86_400).map(|s| lag_s(f64::from(s), slow(f64::from(s))));
        assert!(worst.fold(0.0, f64::max) < 1e-3);
        // Batches that are late stay late.
        let late = (86_400..90_000).map(|s| lag_s(f64::from(s), slow(f64::from(s) - 60.0)));
        assert!(late.fold(f64::INFINITY, f64::min) > 59.0);
    }
}
