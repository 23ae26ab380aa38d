//! Credentials, and a short-lived cache of their principals.
//!
//! A secret is looked up by its SHA-256 and never compared, so that response times reveal
//! nothing about stored secrets: an attacker cannot choose the hash.

use data_encoding::HEXLOWER;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use sha2::{Digest, Sha256};
use tokio::sync::watch;

use super::{PREFIX, Principal};
use crate::ServiceError;
use offbd_store::{Micros, TokenRow};

/// How long a principal is cached. A change by another process, such as
/// `offbd token revoke`, takes effect after this time at the latest.
pub const PRINCIPAL_CACHE_TIME: Duration = Duration::from_secs(5);

/// Limit of cached principals; when it is reached the cache is cleared.
const MAX_CACHED: usize = 50_000;

/// Interval between two updates of a token's last use.
pub(crate) const LAST_USE_INTERVAL: Duration = Duration::from_secs(3600);

/// Lifetime of a login.
pub(crate) const LOGIN_DURATION: Duration = Duration::from_secs(7 * 24 * 3600);

pub(crate) const fn micros(time: Duration) -> Micros {
    // The times above are far from the end of the range.
    time.as_micros() as Micros
}

/// A credential of a caller, as its SHA-256.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Credential {
    /// A token of this service.
    Token([u8; 32]),
    /// A login cookie.
    Login([u8; 32]),
    /// A JSON Web Token of the identity provider.
    Jwt([u8; 32]),
}

impl Credential {
    /// Returns the credential of a bearer token; one of this service is recognized by its
    /// prefix.
    #[must_use]
    pub fn bearer(secret: &str) -> Self {
        if secret.starts_with(PREFIX) {
            Self::token(secret)
        } else {
            Self::Jwt(Sha256::digest(secret).into())
        }
    }

    #[must_use]
    pub fn token(secret: &str) -> Self {
        Self::Token(Sha256::digest(secret).into())
    }

    #[must_use]
    pub fn login(cookie: &str) -> Self {
        Self::Login(Sha256::digest(cookie).into())
    }

    pub(crate) fn digest(&self) -> String {
        let (Self::Token(digest) | Self::Login(digest) | Self::Jwt(digest)) = self;
        HEXLOWER.encode(digest)
    }
}

struct CachedPrincipal {
    principal: Arc<Principal>,
    cached_at: Micros,
}

impl CachedPrincipal {
    fn is_valid(&self, now: Micros) -> bool {
        let fresh = (self.cached_at..self.cached_at + micros(PRINCIPAL_CACHE_TIME)).contains(&now);
        fresh && self.principal.expires_at.is_none_or(|end| now < end)
    }
}

/// The cache of principals.
pub(crate) struct PrincipalCache {
    known: Mutex<HashMap<Credential, CachedPrincipal>>,
    /// Number of changes of tokens by this process.
    pub(crate) changes: watch::Sender<u64>,
}

impl Default for PrincipalCache {
    fn default() -> Self {
        Self { known: Mutex::default(), changes: watch::channel(0).0 }
    }
}

impl PrincipalCache {
    pub(crate) fn get(&self, credential: &Credential, now: Micros) -> Option<Arc<Principal>> {
        let known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        known
            .get(credential)
            .filter(|known| known.is_valid(now))
            .map(|known| known.principal.clone())
    }

    /// Caches a principal unless tokens have changed since `change`.
    pub(crate) fn insert(&self, principal: &Arc<Principal>, change: u64, now: Micros) {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if *self.changes.borrow() != change {
            return;
        }
        if known.len() >= MAX_CACHED {
            known.clear();
        }
        known.insert(
            principal.credential,
            CachedPrincipal { principal: principal.clone(), cached_at: now },
        );
    }

    pub(crate) fn clear(&self) {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        known.clear();
        self.changes.send_modify(|change| *change += 1);
    }
}

/// Returns the principal of a stored token; `None` if it is revoked or expired.
pub(crate) fn principal(
    row: TokenRow,
    credential: Credential,
    now: Micros,
) -> Result<Option<Principal>, ServiceError> {
    if row.revoked_at.is_some() || row.expires_at.is_some_and(|end| end <= now) {
        return Ok(None);
    }
    Ok(Some(Principal {
        role: row.role.parse().map_err(ServiceError::corrupt)?,
        id: row.id,
        name: row.name,
        asset: row.asset,
        expires_at: row.expires_at,
        credential,
        signed_by: None,
    }))
}
