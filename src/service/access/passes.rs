//! Whether what a caller shows is in force: looked up in the store, and known
//! for a little while.
//!
//! A secret is looked up by its SHA-256, never compared: what the time of an
//! answer tells is about the hash, which nobody can steer towards another's.

use data_encoding::HEXLOWER;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use sha2::{Digest, Sha256};
use tokio::sync::watch;

use super::tokens::{PREFIX, random};
use super::{Caller, Pass, jwt};
use crate::service::{Service, ServiceError};
use crate::store::{AccessWrite, Micros, TokenRow, Write};

/// For how long a token is taken as it was found. What another process does to
/// it, such as `offbd token revoke`, is noticed after that.
pub const LOOK_AGAIN: Duration = Duration::from_secs(5);

/// Tokens known at a time; when there are more, all are looked up anew.
const MAX_KNOWN: usize = 50_000;

/// How exactly the last use of a token is kept.
const USE_EVERY: Duration = Duration::from_secs(3600);

/// How long a login lasts.
const LOGIN: Duration = Duration::from_secs(7 * 24 * 3600);

const fn micros(time: Duration) -> Micros {
    // The times above are far from the end of the range.
    time.as_micros() as Micros
}

/// What a caller shows, as its SHA-256.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Credential {
    Token([u8; 32]),
    /// The cookie of a login.
    Login([u8; 32]),
    /// A token of the identity provider.
    Jwt([u8; 32]),
}

impl Credential {
    /// What is shown as a bearer's: the service's own tokens are told by their
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

    pub(super) fn digest(&self) -> String {
        let (Self::Token(digest) | Self::Login(digest) | Self::Jwt(digest)) = self;
        HEXLOWER.encode(digest)
    }
}

struct Known {
    pass: Arc<Pass>,
    looked_at: Micros,
}

impl Known {
    fn holds(&self, now: Micros) -> bool {
        let fresh = (self.looked_at..self.looked_at + micros(LOOK_AGAIN)).contains(&now);
        fresh && self.pass.expires_at.is_none_or(|end| now < end)
    }
}

/// What was found lately.
pub(in crate::service) struct Passes {
    known: Mutex<HashMap<Credential, Known>>,
    /// Counts the changes of tokens made by this process.
    changes: watch::Sender<u64>,
}

impl Default for Passes {
    fn default() -> Self {
        Self { known: Mutex::default(), changes: watch::channel(0).0 }
    }
}

impl Passes {
    fn recall(&self, credential: &Credential, now: Micros) -> Option<Arc<Pass>> {
        let known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        known.get(credential).filter(|known| known.holds(now)).map(|known| known.pass.clone())
    }

    /// Keeps what was found, unless tokens have changed since `change`.
    fn keep(&self, pass: &Arc<Pass>, change: u64, now: Micros) {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if *self.changes.borrow() != change {
            return;
        }
        if known.len() >= MAX_KNOWN {
            known.clear();
        }
        known.insert(pass.credential, Known { pass: pass.clone(), looked_at: now });
    }

    pub(in crate::service) fn forget(&self) {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        known.clear();
        self.changes.send_modify(|change| *change += 1);
    }
}

fn pass(row: TokenRow, credential: Credential, now: Micros) -> Result<Option<Pass>, ServiceError> {
    if row.revoked_at.is_some() || row.expires_at.is_some_and(|end| end <= now) {
        return Ok(None);
    }
    Ok(Some(Pass {
        role: row.role.parse().map_err(ServiceError::corrupt)?,
        id: row.id,
        name: row.name,
        asset: row.asset,
        expires_at: row.expires_at,
        credential,
        signed_by: None,
    }))
}

impl Service {
    /// Whom `credential` belongs to, if that is known without asking the store.
    #[must_use]
    pub fn recall(&self, credential: &Credential) -> Option<Arc<Pass>> {
        self.inner.passes.recall(credential, self.inner.handles.clock.now())
    }

    /// Whom `credential` belongs to; nobody if it is none, revoked or expired. A
    /// JSON Web Token that is not known yet is for [`Service::verify`].
    ///
    /// # Errors
    /// [`ServiceError::Store`] if that cannot be found out.
    pub async fn authenticate(
        &self,
        credential: &Credential,
    ) -> Result<Option<Arc<Pass>>, ServiceError> {
        let inner = &self.inner;
        let now = inner.handles.clock.now();
        if let Some(pass) = inner.passes.recall(credential, now) {
            return Ok(Some(pass));
        }
        let change = *inner.passes.changes.borrow();
        let row = match credential {
            Credential::Token(_) => inner.handles.store.token_by_hash(&credential.digest()).await?,
            Credential::Login(_) => {
                inner.handles.store.token_by_login(&credential.digest(), now).await?
            }
            Credential::Jwt(_) => None,
        };
        let Some(row) = row else { return Ok(None) };
        let used_at = row.last_used_at;
        let Some(pass) = pass(row, *credential, now)?.map(Arc::new) else { return Ok(None) };
        inner.passes.keep(&pass, change, now);
        if used_at.is_none_or(|at| now - at >= micros(USE_EVERY)) {
            self.note_use(&pass.id, now);
        }
        Ok(Some(pass))
    }

    /// Whom a JSON Web Token names; nobody if it is not in force, or none is taken.
    pub async fn verify(&self, token: &str) -> Option<Arc<Pass>> {
        let provider = self.inner.provider.as_ref()?;
        let now = self.inner.handles.clock.now();
        let verified = provider.verify(token, now).await;
        let refused = |reason| tracing::info!(%reason, "a JSON Web Token is refused");
        let jwt::Verified { subject, role, asset, expires_at, key } =
            verified.map_err(refused).ok()?;
        let pass = Arc::new(Pass {
            // An issuer has no space, and the service's own ids are no URLs.
            id: format!("{} {subject}", provider.expected.issuer),
            name: subject,
            role,
            asset,
            expires_at: Some(expires_at),
            credential: Credential::Jwt(Sha256::digest(token).into()),
            signed_by: Some(key),
        });
        let change = *self.inner.passes.changes.borrow();
        self.inner.passes.keep(&pass, change, now);
        Some(pass)
    }

    /// Whether a token is known to be no longer in force. A store that cannot say
    /// takes nothing away from whom it knew.
    async fn has_lapsed(&self, pass: &Pass) -> bool {
        let Some(key) = pass.signed_by else {
            return matches!(self.authenticate(&pass.credential).await, Ok(None));
        };
        let now = self.inner.handles.clock.now();
        let published = self.inner.provider.as_ref().is_some_and(|p| p.has(key, now));
        !published || pass.expires_at.is_some_and(|end| now >= end)
    }

    /// Notes that a token is used; nobody waits for it.
    fn note_use(&self, id: &str, at: Micros) {
        let (handles, id) = (self.inner.handles.clone(), id.to_owned());
        tokio::spawn(async move {
            let written = handles.write(Write::Access(AccessWrite::TokenUsed { id, at })).await;
            if let Err(error) = written {
                tracing::warn!(%error, "the use of a token was not noted");
            }
        });
    }

    /// Ends when the caller's token is revoked or expires, or the key that signed
    /// it is withdrawn; never for anyone.
    pub async fn lapse(&self, caller: &Caller) {
        let Some(pass) = caller.pass() else { return std::future::pending().await };
        let mut changes = self.inner.passes.changes.subscribe();
        while !self.has_lapsed(pass).await {
            tokio::select! {
                _ = changes.changed() => {}
                () = tokio::time::sleep(LOOK_AGAIN) => {}
            }
        }
    }

    /// Logs a browser in for the token behind `pass`; returns the cookie's
    /// secret and for how long it is good.
    ///
    /// # Errors
    /// [`ServiceError::Unavailable`] if the store does not take it.
    pub async fn log_in(&self, pass: &Pass) -> Result<(String, Duration), ServiceError> {
        let cookie = random()?;
        let at = self.inner.handles.clock.now();
        let write = AccessWrite::Login {
            hash: Credential::login(&cookie).digest(),
            token: pass.id.clone(),
            at,
            expires_at: at + micros(LOGIN),
        };
        self.inner.handles.write(Write::Access(write)).await?;
        Ok((cookie, LOGIN))
    }

    /// Ends a login; a token shown in a header has none.
    ///
    /// # Errors
    /// [`ServiceError::Unavailable`] if the store does not take it.
    pub async fn log_out(&self, pass: &Pass) -> Result<(), ServiceError> {
        if let Credential::Login(_) = pass.credential {
            self.change_access(AccessWrite::Logout { hash: pass.credential.digest() }).await?;
        }
        Ok(())
    }
}
