//! The identity provider: the claims that its tokens must have, and its public keys.
//!
//! The keys are published by the owner of the [`KeyFeed`], who decides where and how often
//! to read them. A token with an unknown key requests a refresh.

use std::sync::Arc;
use std::time::Duration;

use tokio::sync::{Notify, watch};

use super::jwt::{ExpectedClaims, Fingerprint, JwtError, KeySet, VerifiedToken, verify};
use offbd_store::Micros;

/// Longest time for which keys are used without a refresh; then all JSON Web Tokens are
/// refused.
pub const MAX_KEY_AGE: Duration = Duration::from_secs(24 * 3600);

#[derive(Clone, Debug, Default)]
struct CachedKeys {
    keys: Option<Arc<KeySet>>,
    read_at: Micros,
}

/// The identity provider whose JSON Web Tokens are accepted.
pub struct Provider {
    pub expected: ExpectedClaims,
    cached: watch::Receiver<CachedKeys>,
    refresh_requested: Arc<Notify>,
}

/// Publishes the keys of a [`Provider`].
pub struct KeyFeed {
    cached: watch::Sender<CachedKeys>,
    refresh_requested: Arc<Notify>,
}

impl KeyFeed {
    /// Publishes keys that were read at `now`.
    pub fn publish(&self, keys: KeySet, now: Micros) {
        self.cached.send_replace(CachedKeys { keys: Some(Arc::new(keys)), read_at: now });
    }

    /// Completes pending refreshes with the current keys.
    pub fn publish_unchanged(&self) {
        self.cached.send_modify(|_| {});
    }

    /// Completes when a token with an unknown key requests a refresh.
    pub async fn refresh_requested(&self) {
        self.refresh_requested.notified().await;
    }
}

impl Provider {
    /// Returns a provider without keys, and the feed to publish them.
    #[must_use]
    pub fn new(expected: ExpectedClaims) -> (Self, KeyFeed) {
        let (sender, cached) = watch::channel(CachedKeys::default());
        let refresh_requested = Arc::new(Notify::new());
        let feed = KeyFeed { cached: sender, refresh_requested: refresh_requested.clone() };
        (Self { expected, cached, refresh_requested }, feed)
    }

    /// Returns the keys unless they are older than [`MAX_KEY_AGE`].
    fn keys(&self, now: Micros) -> Option<Arc<KeySet>> {
        let cached = self.cached.borrow();
        let age = Duration::from_micros(now.abs_diff(cached.read_at));
        cached.keys.clone().filter(|_| age < MAX_KEY_AGE)
    }

    /// Whether the key is still published.
    pub(crate) fn has(&self, key: Fingerprint, now: Micros) -> bool {
        self.keys(now).is_some_and(|keys| keys.has(key))
    }

    /// Verifies `token`; refreshes the keys once if its key is unknown.
    ///
    /// # Errors
    /// [`JwtError`] if the token is invalid.
    pub(crate) async fn verify(&self, token: &str, now: Micros) -> Result<VerifiedToken, JwtError> {
        match self.verify_with_cached_keys(token, now) {
            Err(JwtError::UnknownKey | JwtError::NoKeys) => {
                self.refresh().await;
                self.verify_with_cached_keys(token, now)
            }
            result => result,
        }
    }

    fn verify_with_cached_keys(&self, token: &str, now: Micros) -> Result<VerifiedToken, JwtError> {
        let keys = self.keys(now).ok_or(JwtError::NoKeys)?;
        verify(token, &keys, &self.expected, now)
    }

    async fn refresh(&self) {
        let mut cached = self.cached.clone();
        cached.mark_unchanged();
        self.refresh_requested.notify_one();
        // Also completes when the feed is dropped.
        let _ = cached.changed().await;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_without_a_refresh_expire() {
        let claim = String::new;
        let (issuer, audience, role_claim, asset_claim) = (claim(), claim(), claim(), claim());
        let expected = ExpectedClaims { issuer, audience, role_claim, asset_claim };
        let (provider, feed) = Provider::new(expected);
        assert!(provider.keys(0).is_none());
        let x = "A".repeat(43);
        let document = format!(r#"{{"keys":[{{"kty":"OKP","crv":"Ed25519","x":"{x}"}}]}}"#);
        let age = MAX_KEY_AGE.as_micros() as Micros;
        feed.publish(KeySet::parse(document.as_bytes()).unwrap(), 7);
        feed.publish_unchanged();
        assert!(provider.keys(7 + age - 1).is_some());
        assert!(provider.keys(7 + age).is_none());
        // A clock that is set back does not extend the validity.
        assert!(provider.keys(7 - age).is_none());
    }
}
