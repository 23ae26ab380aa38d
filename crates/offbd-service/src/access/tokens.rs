//! Creating tokens.

use data_encoding::HEXLOWER;
use uuid::Uuid;

use super::{Credential, PREFIX, Role};
use crate::clock::rfc3339;
use crate::{ServiceError, views};
use offbd_core::vocabulary::Invalid;
use offbd_store::{Micros, TokenRow};
use offbd_wire::access::TokenView;

/// Random bytes of a secret: 256 bits.
pub(super) const SECRET_BYTES: usize = 32;

/// Longest name of a token, bytes.
pub const MAX_TOKEN_NAME: usize = 100;

/// The parameters of a new token.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NewToken {
    /// 1 to [`MAX_TOKEN_NAME`] bytes without control characters; unique among the tokens
    /// in force.
    pub name: String,
    pub role: Role,
    /// Required for the role device, not permitted for others.
    pub asset: Option<String>,
    /// `None` if the token does not expire.
    pub expires_at: Option<Micros>,
}

/// A new token: the row to store, and the secret, which is not stored.
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
            (Role::Device, None) => Err(Invalid::new("/asset", "missing: required for a device")),
            (Role::Device, Some(_)) | (_, None) => Ok(()),
            (role, Some(_)) => {
                Err(Invalid::new("/asset", format!("not permitted for the role {role}")))
            }
        }?;
        if self.expires_at.is_some_and(|end| end <= now) {
            return Err(Invalid::new("/expires_at", "is in the past"));
        }
        Ok(())
    }
}

/// Creates a token; `by` is the name of its creator.
///
/// # Errors
/// [`ServiceError::Invalid`] with the invalid element; [`ServiceError::Unavailable`] if the
/// system provides no random numbers.
pub fn mint(token: NewToken, by: &str, now: Micros) -> Result<Minted, ServiceError> {
    token.check(now)?;
    let secret = format!("{PREFIX}{}", random()?);
    let row = TokenRow {
        id: Uuid::now_v7().to_string(),
        hash: Credential::token(&secret).digest(),
        name: token.name,
        role: token.role.to_string(),
        asset: token.asset,
        created_at: now,
        created_by: by.to_owned(),
        expires_at: token.expires_at,
        last_used_at: None,
        revoked_at: None,
    };
    Ok(Minted { row, secret })
}

/// Returns the random part of a secret, in hexadecimal.
pub(crate) fn random() -> Result<String, ServiceError> {
    let mut bytes = [0; SECRET_BYTES];
    getrandom::fill(&mut bytes)
        .map_err(|_| ServiceError::Unavailable { what: "the system provides no random numbers" })?;
    Ok(HEXLOWER.encode(&bytes))
}

/// Returns the view of a token, without its secret.
///
/// # Errors
/// [`ServiceError::Corrupt`] if its role is unknown to this version.
pub fn token_view(row: TokenRow) -> Result<TokenView, ServiceError> {
    Ok(TokenView {
        id: row.id,
        name: row.name,
        role: views::word(&row.role)?,
        asset: row.asset,
        created_at: rfc3339(row.created_at),
        created_by: row.created_by,
        expires_at: row.expires_at.map(rfc3339),
        last_used_at: row.last_used_at.map(rfc3339),
        revoked_at: row.revoked_at.map(rfc3339),
    })
}
