//! Authentication and logins.

use std::sync::Arc;
use std::time::Duration;

use sha2::{Digest, Sha256};

use crate::access::principals::{
    LAST_USE_INTERVAL, LOGIN_DURATION, PRINCIPAL_CACHE_TIME, micros, principal,
};
use crate::access::{Caller, Credential, Principal, jwt, random};
use crate::{Service, ServiceError};
use offbd_store::{AccessWrite, Micros, Write};

impl Service {
    /// Returns the principal of `credential` if it is cached.
    #[must_use]
    pub fn cached_principal(&self, credential: &Credential) -> Option<Arc<Principal>> {
        self.inner.principals.get(credential, self.inner.handles.clock.now())
    }

    /// Returns the principal of `credential`; `None` if it is unknown, revoked or expired.
    /// A JSON Web Token that is not cached must be passed to [`Service::verify`].
    ///
    /// # Errors
    /// [`ServiceError::Store`] if the store cannot be read.
    pub async fn authenticate(
        &self,
        credential: &Credential,
    ) -> Result<Option<Arc<Principal>>, ServiceError> {
        let inner = &self.inner;
        let now = inner.handles.clock.now();
        if let Some(principal) = inner.principals.get(credential, now) {
            return Ok(Some(principal));
        }
        let change = *inner.principals.changes.borrow();
        let row = match credential {
            Credential::Token(_) => inner.handles.store.token_by_hash(&credential.digest()).await?,
            Credential::Login(_) => {
                inner.handles.store.token_by_login(&credential.digest(), now).await?
            }
            Credential::Jwt(_) => None,
        };
        let Some(row) = row else { return Ok(None) };
        let used_at = row.last_used_at;
        let Some(principal) = principal(row, *credential, now)?.map(Arc::new) else {
            return Ok(None);
        };
        inner.principals.insert(&principal, change, now);
        if used_at.is_none_or(|at| now - at >= micros(LAST_USE_INTERVAL)) {
            self.record_use(&principal.id, now);
        }
        Ok(Some(principal))
    }

    /// Returns the principal of a JSON Web Token; `None` if it is invalid, or if no identity
    /// provider is configured.
    pub async fn verify(&self, token: &str) -> Option<Arc<Principal>> {
        let provider = self.inner.provider.as_ref()?;
        let now = self.inner.handles.clock.now();
        let verified = provider.verify(token, now).await;
        let refused = |reason| tracing::info!(%reason, "JSON Web Token refused");
        let jwt::VerifiedToken { subject, role, asset, expires_at, key } =
            verified.map_err(refused).ok()?;
        let principal = Arc::new(Principal {
            // Unambiguous: an issuer contains no space, and ids of own tokens are not URLs.
            id: format!("{} {subject}", provider.expected.issuer),
            name: subject,
            role,
            asset,
            expires_at: Some(expires_at),
            credential: Credential::Jwt(Sha256::digest(token).into()),
            signed_by: Some(key),
        });
        let change = *self.inner.principals.changes.borrow();
        self.inner.principals.insert(&principal, change, now);
        Some(principal)
    }

    /// Whether a token is revoked or expired. If the store cannot be read, the token remains
    /// valid.
    async fn is_revoked_or_expired(&self, principal: &Principal) -> bool {
        let Some(key) = principal.signed_by else {
            return matches!(self.authenticate(&principal.credential).await, Ok(None));
        };
        let now = self.inner.handles.clock.now();
        let published = self.inner.provider.as_ref().is_some_and(|p| p.has(key, now));
        !published || principal.expires_at.is_some_and(|end| now >= end)
    }

    /// Records the use of a token in the background.
    fn record_use(&self, id: &str, at: Micros) {
        let (handles, id) = (self.inner.handles.clone(), id.to_owned());
        tokio::spawn(async move {
            let written =
                handles.write_unpartitioned(Write::Access(AccessWrite::TokenUsed { id, at })).await;
            if let Err(error) = written {
                tracing::warn!(%error, "cannot record the use of a token");
            }
        });
    }

    /// Completes when the caller's token is revoked or expires, or the key that signed it
    /// is withdrawn. Never completes for [`Caller::Anonymous`].
    pub async fn wait_for_revocation(&self, caller: &Caller) {
        let Some(principal) = caller.principal() else { return std::future::pending().await };
        let mut changes = self.inner.principals.changes.subscribe();
        while !self.is_revoked_or_expired(principal).await {
            tokio::select! {
                _ = changes.changed() => {}
                () = tokio::time::sleep(PRINCIPAL_CACHE_TIME) => {}
            }
        }
    }

    /// Creates a login for the token of `principal`; returns the secret of the cookie and
    /// its lifetime.
    ///
    /// # Errors
    /// [`ServiceError::Unavailable`] or [`ServiceError::NotStored`] if it cannot be stored.
    pub async fn log_in(&self, principal: &Principal) -> Result<(String, Duration), ServiceError> {
        let cookie = random()?;
        let at = self.inner.handles.clock.now();
        let write = AccessWrite::Login {
            hash: Credential::login(&cookie).digest(),
            token: principal.id.clone(),
            at,
            expires_at: at + micros(LOGIN_DURATION),
        };
        self.inner.handles.write_unpartitioned(Write::Access(write)).await?;
        Ok((cookie, LOGIN_DURATION))
    }

    /// Ends the login of `principal`; has no effect if it was authenticated by a header.
    ///
    /// # Errors
    /// [`ServiceError::Unavailable`] or [`ServiceError::NotStored`] if it cannot be stored.
    pub async fn log_out(&self, principal: &Principal) -> Result<(), ServiceError> {
        if let Credential::Login(_) = principal.credential {
            self.change_access(AccessWrite::Logout { hash: principal.credential.digest() }).await?;
        }
        Ok(())
    }
}
