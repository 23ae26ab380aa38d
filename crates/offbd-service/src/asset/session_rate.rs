//! The rate at which the sessions of an asset may begin. A device whose session names or
//! whose clock change all the time must not fill the store with sessions.

use offbd_store::Micros;

/// Sessions that may begin at once. Chosen: a script that imports a folder of recordings.
const BURST: f64 = 100.0;

/// Sessions per second that may begin after that. Chosen.
const PER_S: f64 = 1.0;

/// A token bucket over the time of the service.
#[derive(Clone, Copy, Debug)]
pub(super) struct SessionRate {
    left: f64,
    at: Option<Micros>,
}

impl Default for SessionRate {
    fn default() -> Self {
        Self { left: BURST, at: None }
    }
}

impl SessionRate {
    /// Whether a session may begin at `at`.
    pub(super) fn allows(&self, at: Micros) -> bool {
        self.left_at(at) >= 1.0
    }

    /// Counts a session that begins at `at`.
    pub(super) fn count(&mut self, at: Micros) {
        self.left = (self.left_at(at) - 1.0).max(0.0);
        self.at = Some(at);
    }

    fn left_at(&self, at: Micros) -> f64 {
        match self.at {
            // Nobody knows how much time has passed: nothing waits for it.
            Some(before) if at < before => BURST,
            Some(before) => (self.left + (at - before) as f64 / 1e6 * PER_S).min(BURST),
            None => self.left,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_burst_is_allowed_and_then_one_session_a_second() {
        let mut rate = SessionRate::default();
        let mut begin = |at_s: f64| {
            let at = (at_s * 1e6) as Micros;
            let allowed = rate.allows(at);
            if allowed {
                rate.count(at);
            }
            allowed
        };
        assert_eq!((0..150).filter(|_| begin(1e9)).count(), 100);
        assert_eq!([0.5, 1.0, 1.5, 2.0].map(|s| begin(1e9 + s)), [false, true, false, true]);
        assert!(begin(9e8), "a clock that was set back stops no device");
        assert_eq!((0..150).filter(|_| begin(2e9)).count(), 100);
    }
}
