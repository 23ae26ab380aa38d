//! The identity provider: what its tokens must say, and its keys as they were
//! read last.
//!
//! Who reads them, from where and how often, is not known here: a [`KeyFeed`]
//! brings them, and looks again when a token names a key that is not there.

use std::sync::Arc;
use std::time::Duration;

use tokio::sync::{Notify, watch};

use super::jwt::{Expected, Fingerprint, KeySet, Refusal, Verified, verify};
use crate::store::Micros;

/// For how long keys are used without having been read again; then nobody comes
/// in by them.
pub const MAX_KEY_AGE: Duration = Duration::from_secs(24 * 3600);

#[derive(Clone, Debug, Default)]
struct Held {
    keys: Option<Arc<KeySet>>,
    read_at: Micros,
}

/// Whose tokens are taken beside the service's own.
pub struct Provider {
    pub expected: Expected,
    held: watch::Receiver<Held>,
    wanted: Arc<Notify>,
}

/// Brings the keys of a [`Provider`].
pub struct KeyFeed {
    held: watch::Sender<Held>,
    wanted: Arc<Notify>,
}

impl KeyFeed {
    /// What was read at `now`.
    pub fn bring(&self, keys: KeySet, now: Micros) {
        self.held.send_replace(Held { keys: Some(Arc::new(keys)), read_at: now });
    }

    /// Lets go on who waits, with the keys that there are.
    pub fn bring_nothing(&self) {
        self.held.send_modify(|_| {});
    }

    /// Ends when a token names a key that is not there.
    pub async fn wanted(&self) {
        self.wanted.notified().await;
    }
}

impl Provider {
    /// A provider without keys, and what brings them.
    #[must_use]
    pub fn new(expected: Expected) -> (Self, KeyFeed) {
        let (sender, held) = watch::channel(Held::default());
        let wanted = Arc::new(Notify::new());
        let feed = KeyFeed { held: sender, wanted: wanted.clone() };
        (Self { expected, held, wanted }, feed)
    }

    /// Keys that are not too old.
    fn keys(&self, now: Micros) -> Option<Arc<KeySet>> {
        let held = self.held.borrow();
        let age = Duration::from_micros(now.abs_diff(held.read_at));
        held.keys.clone().filter(|_| age < MAX_KEY_AGE)
    }

    /// Whether the key is still published.
    pub(super) fn has(&self, key: Fingerprint, now: Micros) -> bool {
        self.keys(now).is_some_and(|keys| keys.has(key))
    }

    /// Whom `token` names; the keys are looked at again for one that is not there.
    pub(super) async fn verify(&self, token: &str, now: Micros) -> Result<Verified, Refusal> {
        match self.verify_at_once(token, now) {
            Err(Refusal::UnknownKey | Refusal::NoKeys) => {
                self.look_again().await;
                self.verify_at_once(token, now)
            }
            told => told,
        }
    }

    fn verify_at_once(&self, token: &str, now: Micros) -> Result<Verified, Refusal> {
        let keys = self.keys(now).ok_or(Refusal::NoKeys)?;
        verify(token, &keys, &self.expected, now)
    }

    async fn look_again(&self) {
        let mut held = self.held.clone();
        held.mark_unchanged();
        self.wanted.notify_one();
        // Ends also when the feed does.
        let _ = held.changed().await;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_that_nobody_renews_have_an_end() {
        let claim = String::new;
        let (issuer, audience, role_claim, asset_claim) = (claim(), claim(), claim(), claim());
        let expected = Expected { issuer, audience, role_claim, asset_claim };
        let (provider, feed) = Provider::new(expected);
        assert!(provider.keys(0).is_none());
        let x = "A".repeat(43);
        let document = format!(r#"{{"keys":[{{"kty":"OKP","crv":"Ed25519","x":"{x}"}}]}}"#);
        let age = MAX_KEY_AGE.as_micros() as Micros;
        feed.bring(KeySet::parse(document.as_bytes()).unwrap(), 7);
        feed.bring_nothing();
        assert!(provider.keys(7 + age - 1).is_some());
        assert!(provider.keys(7 + age).is_none());
        // A clock that was put back makes nothing younger.
        assert!(provider.keys(7 - age).is_none());
    }
}
