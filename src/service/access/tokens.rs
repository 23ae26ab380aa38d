//! Tokens: made, listed, revoked.

use data_encoding::HEXLOWER;
use uuid::Uuid;

use super::{Credential, Role};
use crate::service::clock::rfc3339;
use crate::service::{Service, ServiceError, views};
use crate::store::{AccessWrite, LAST_ID, Micros, TokenRow, Write};
use crate::wire::access::{MadeTokenView, TokenView};
use crate::wire::service::Page;
use offbd_core::vocabulary::Invalid;

/// How every token begins, so that scanners for leaked secrets find it.
pub const PREFIX: &str = "offbd_";

/// Random bytes of a secret: 256 bits, out of reach of any guessing.
pub(super) const SECRET_BYTES: usize = 32;

/// Longest name of a token, bytes; a longer one is refused.
pub const MAX_TOKEN_NAME: usize = 100;

/// A token that is wanted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NewToken {
    /// 1 to [`MAX_TOKEN_NAME`] bytes without control characters; no other token
    /// in force has it.
    pub name: String,
    pub role: Role,
    /// For a device, and for no other role.
    pub asset: Option<String>,
    /// For ever without it.
    pub expires_at: Option<Micros>,
}

/// A new token: what is stored, and the secret, which is not.
pub struct Minted {
    pub row: TokenRow,
    pub secret: String,
}

impl NewToken {
    fn check(&self, now: Micros) -> Result<(), Invalid> {
        let name = &self.name;
        if name.is_empty() || name.len() > MAX_TOKEN_NAME || name.chars().any(char::is_control) {
            let reason = format!("must be 1 to {MAX_TOKEN_NAME} bytes without control characters");
            return Err(Invalid::new("/name", reason));
        }
        match (self.role, &self.asset) {
            (Role::Device, None) => Err(Invalid::new("/asset", "is missing: a device has one")),
            (Role::Device, Some(_)) | (_, None) => Ok(()),
            (role, Some(_)) => Err(Invalid::new("/asset", format!("is for devices, not {role}"))),
        }?;
        if self.expires_at.is_some_and(|end| end <= now) {
            return Err(Invalid::new("/expires_at", "has passed"));
        }
        Ok(())
    }
}

/// Makes a token; `by` is who wants it.
///
/// # Errors
/// [`ServiceError::Invalid`] naming the element; [`ServiceError::Unavailable`]
/// if the system has no random numbers.
pub fn mint(wanted: NewToken, by: &str, now: Micros) -> Result<Minted, ServiceError> {
    wanted.check(now)?;
    let secret = format!("{PREFIX}{}", random()?);
    let row = TokenRow {
        id: Uuid::now_v7().to_string(),
        hash: Credential::token(&secret).digest(),
        name: wanted.name,
        role: wanted.role.to_string(),
        asset: wanted.asset,
        created_at: now,
        created_by: by.to_owned(),
        expires_at: wanted.expires_at,
        last_used_at: None,
        revoked_at: None,
    };
    Ok(Minted { row, secret })
}

/// A secret's random part, hexadecimal.
pub(super) fn random() -> Result<String, ServiceError> {
    let mut bytes = [0; SECRET_BYTES];
    getrandom::fill(&mut bytes)
        .map_err(|_| ServiceError::Unavailable { what: "the system has no random numbers" })?;
    Ok(HEXLOWER.encode(&bytes))
}

/// A token as it is shown.
#[must_use]
pub fn token_view(row: TokenRow) -> TokenView {
    TokenView {
        id: row.id,
        name: row.name,
        role: row.role,
        asset: row.asset,
        created_at: rfc3339(row.created_at),
        created_by: row.created_by,
        expires_at: row.expires_at.map(rfc3339),
        last_used_at: row.last_used_at.map(rfc3339),
        revoked_at: row.revoked_at.map(rfc3339),
    }
}

impl Service {
    /// Makes a token; the answer is the only place where its secret is seen.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`]; [`ServiceError::UnknownAsset`];
    /// [`ServiceError::TokenExists`].
    pub async fn create_token(
        &self,
        wanted: NewToken,
        by: &str,
    ) -> Result<MadeTokenView, ServiceError> {
        let minted = mint(wanted, by, self.inner.handles.clock.now())?;
        if let Some(asset) = &minted.row.asset {
            self.asset(asset).await?;
        }
        if self.inner.handles.store.token_named(&minted.row.name).await?.is_some() {
            return Err(ServiceError::TokenExists { name: minted.row.name });
        }
        let write = AccessWrite::CreateToken(minted.row.clone());
        self.inner.handles.write(Write::Access(write)).await?;
        Ok(MadeTokenView { token: token_view(minted.row), secret: minted.secret })
    }

    /// Tokens, the latest first, without their secrets.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] for a cursor that is none.
    pub async fn tokens(
        &self,
        cursor: Option<&str>,
        limit: u32,
    ) -> Result<Page<TokenView>, ServiceError> {
        let before = cursor.map(views::cursor::<String>).transpose()?;
        let before = before.as_deref().unwrap_or(LAST_ID);
        let rows = self.inner.handles.store.tokens(before, limit + 1).await?;
        views::page(rows, limit, |row| row.id.clone(), |row| Ok(token_view(row)))
    }

    /// # Errors
    /// [`ServiceError::UnknownToken`].
    pub async fn token(&self, id: &str) -> Result<TokenView, ServiceError> {
        let row = self.inner.handles.store.token(id).await?;
        row.map(token_view).ok_or_else(|| ServiceError::UnknownToken { id: id.to_owned() })
    }

    /// Ends a token and its logins at once; one that is revoked stays so.
    ///
    /// # Errors
    /// [`ServiceError::UnknownToken`].
    pub async fn revoke_token(&self, id: &str) -> Result<(), ServiceError> {
        self.token(id).await?;
        let at = self.inner.handles.clock.now();
        self.change_access(AccessWrite::RevokeToken { id: id.to_owned(), at }).await
    }

    /// Makes `write` durable and forgets who was known by what was before.
    pub(super) async fn change_access(&self, write: AccessWrite) -> Result<(), ServiceError> {
        let written = self.inner.handles.write(Write::Access(write)).await;
        self.inner.passes.forget();
        written
    }
}
