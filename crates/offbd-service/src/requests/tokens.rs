//! Creating, listing and revoking tokens.

use crate::access::{NewToken, mint, token_view};
use crate::{Service, ServiceError, views};
use offbd_store::{AccessWrite, LAST_ID, Write};
use offbd_wire::access::{MadeTokenView, TokenView};
use offbd_wire::service::Page;

impl Service {
    /// Creates a token. The result is the only place with its secret.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`]; [`ServiceError::UnknownAsset`];
    /// [`ServiceError::TokenExists`].
    pub async fn create_token(
        &self,
        token: NewToken,
        by: &str,
    ) -> Result<MadeTokenView, ServiceError> {
        let minted = mint(token, by, self.inner.handles.clock.now())?;
        if let Some(asset) = &minted.row.asset {
            self.check_known(asset).await?;
        }
        if self.inner.handles.store.token_named(&minted.row.name).await?.is_some() {
            return Err(ServiceError::TokenExists { name: minted.row.name });
        }
        let write = AccessWrite::CreateToken(minted.row.clone());
        self.inner.handles.write_unpartitioned(Write::Access(write)).await?;
        Ok(MadeTokenView { token: token_view(minted.row)?, secret: minted.secret })
    }

    /// Returns a page of tokens, newest first, without their secrets.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] for an invalid cursor.
    pub async fn tokens(
        &self,
        cursor: Option<&str>,
        limit: u32,
    ) -> Result<Page<TokenView>, ServiceError> {
        let before = cursor.map(views::cursor::<String>).transpose()?;
        let before = before.as_deref().unwrap_or(LAST_ID);
        let rows = self.inner.handles.store.tokens(before, limit + 1).await?;
        views::page(rows, limit, |row| row.id.clone(), token_view)
    }

    /// Returns a token, without its secret.
    ///
    /// # Errors
    /// [`ServiceError::UnknownToken`].
    pub async fn token(&self, id: &str) -> Result<TokenView, ServiceError> {
        let row = self.inner.handles.store.token(id).await?;
        token_view(row.ok_or_else(|| ServiceError::UnknownToken { id: id.to_owned() })?)
    }

    /// Revokes a token and its logins immediately; has no effect on a revoked token.
    ///
    /// # Errors
    /// [`ServiceError::UnknownToken`].
    pub async fn revoke_token(&self, id: &str) -> Result<(), ServiceError> {
        self.token(id).await?;
        let at = self.inner.handles.clock.now();
        self.change_access(AccessWrite::RevokeToken { id: id.to_owned(), at }).await
    }

    /// Makes a change of tokens or logins durable and clears the cache of principals.
    pub(crate) async fn change_access(&self, write: AccessWrite) -> Result<(), ServiceError> {
        let written = self.inner.handles.write_unpartitioned(Write::Access(write)).await;
        self.inner.principals.clear();
        written
    }
}
