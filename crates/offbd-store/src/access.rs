//! Tables of tokens, logins and the audit log.

use super::execute::execute;
use super::from_row::from_row;
use sqlx::AnyConnection;

use super::{Micros, Store, StoreError};

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TokenRow {
    pub id: String,
    /// SHA-256 of the secret, hexadecimal.
    pub hash: String,
    pub name: String,
    pub role: String,
    /// The one asset that a device may use; `None` for other roles.
    pub asset: Option<String>,
    pub created_at: Micros,
    pub created_by: String,
    pub expires_at: Option<Micros>,
    pub last_used_at: Option<Micros>,
    pub revoked_at: Option<Micros>,
}

from_row!(TokenRow {
    id,
    hash,
    name,
    role,
    asset,
    created_at,
    created_by,
    expires_at,
    last_used_at,
    revoked_at
});

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AuditRow {
    pub id: String,
    pub at: Micros,
    /// Name of the token that was used.
    pub actor: String,
    /// Id of that token.
    pub token: Option<String>,
    pub act: String,
    pub target: String,
    pub address: Option<String>,
}

from_row!(AuditRow { id, at, actor, token, act, target, address });

/// A change of tokens or logins, or an entry of the audit log.
#[derive(Clone, Debug)]
pub enum AccessWrite {
    /// Creates a token. It is a conflict if a token that is not revoked has its name.
    CreateToken(TokenRow),
    RevokeToken {
        id: String,
        at: Micros,
    },
    /// Revokes the tokens of the devices of an asset.
    RevokeDevices {
        asset: String,
        at: Micros,
    },
    TokenUsed {
        id: String,
        at: Micros,
    },
    /// Creates a login. Expired logins are deleted, and the oldest ones of a token with
    /// more than [`MAX_LOGINS`].
    Login {
        hash: String,
        token: String,
        at: Micros,
        expires_at: Micros,
    },
    Logout {
        hash: String,
    },
    Audit(AuditRow),
}

/// A string that sorts after every id in any collation: ids consist of hexadecimal digits
/// and dashes.
pub const LAST_ID: &str = "z";

/// Logins of one token at a time; one more ends the oldest.
pub const MAX_LOGINS: i64 = 100;

impl AccessWrite {
    pub(super) async fn apply(&self, db: &mut AnyConnection) -> Result<(), StoreError> {
        match self {
            Self::CreateToken(row) => create_token(db, row).await,
            Self::RevokeToken { id, at } => {
                let sql = "UPDATE token SET revoked_at = $2 WHERE id = $1 AND revoked_at IS NULL";
                stamp(db, sql, id, *at).await
            }
            Self::RevokeDevices { asset, at } => {
                let sql =
                    "UPDATE token SET revoked_at = $2 WHERE asset = $1 AND revoked_at IS NULL";
                stamp(db, sql, asset, *at).await
            }
            Self::TokenUsed { id, at } => {
                stamp(db, "UPDATE token SET last_used_at = $2 WHERE id = $1", id, *at).await
            }
            Self::Login { hash, token, at, expires_at } => {
                execute!(&mut *db, "DELETE FROM login WHERE expires_at <= $1"; at)?;
                make_room(db, token).await?;
                login(db, hash, token, *expires_at).await
            }
            Self::Logout { hash } => {
                execute!(db, "DELETE FROM login WHERE hash = $1"; hash)
            }
            Self::Audit(row) => audit(db, row).await,
        }
    }
}

async fn stamp(
    db: &mut AnyConnection,
    sql: &'static str,
    key: &str,
    at: Micros,
) -> Result<(), StoreError> {
    execute!(db, sql; key, at)
}

async fn create_token(db: &mut AnyConnection, row: &TokenRow) -> Result<(), StoreError> {
    execute!(
        db, "INSERT INTO token (id, hash, name, role, asset, created_at, created_by, expires_at)
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8)";
        &row.id, &row.hash, &row.name, &row.role, &row.asset, row.created_at, &row.created_by,
        row.expires_at
    )
}

/// Deletes the oldest logins of `token`, so that there is room for one more.
async fn make_room(db: &mut AnyConnection, token: &str) -> Result<(), StoreError> {
    execute!(
        db, "DELETE FROM login WHERE token = $1 AND hash NOT IN
         (SELECT hash FROM login WHERE token = $1 ORDER BY expires_at DESC LIMIT $2)";
        token, MAX_LOGINS - 1
    )
}

async fn login(
    db: &mut AnyConnection,
    hash: &str,
    token: &str,
    expires_at: Micros,
) -> Result<(), StoreError> {
    execute!(
        db, "INSERT INTO login (hash, token, expires_at) VALUES ($1, $2, $3)";
        hash, token, expires_at
    )
}

async fn audit(db: &mut AnyConnection, row: &AuditRow) -> Result<(), StoreError> {
    execute!(
        db, "INSERT INTO audit (id, at, actor, token, act, target, address)
         VALUES ($1, $2, $3, $4, $5, $6, $7)";
        &row.id, row.at, &row.actor, &row.token, &row.act, &row.target, &row.address
    )
}

impl Store {
    /// The token whose secret has this hash, also if it is revoked or expired.
    ///
    /// # Errors
    /// [`StoreError`] if the database fails; so do all queries here.
    pub async fn token_by_hash(&self, hash: &str) -> Result<Option<TokenRow>, StoreError> {
        Ok(sqlx::query_as("SELECT * FROM token WHERE hash = $1")
            .bind(hash)
            .fetch_optional(&self.pool)
            .await?)
    }

    /// The token of the login whose cookie has this hash. If the login expires before the
    /// token, `expires_at` is that of the login.
    pub async fn token_by_login(
        &self,
        hash: &str,
        now: Micros,
    ) -> Result<Option<TokenRow>, StoreError> {
        Ok(sqlx::query_as(
            "SELECT t.id, t.hash, t.name, t.role, t.asset, t.created_at, t.created_by,
             CASE WHEN t.expires_at < l.expires_at THEN t.expires_at ELSE l.expires_at END
             AS expires_at, t.last_used_at, t.revoked_at
             FROM login l JOIN token t ON t.id = l.token
             WHERE l.hash = $1 AND l.expires_at > $2",
        )
        .bind(hash)
        .bind(now)
        .fetch_optional(&self.pool)
        .await?)
    }

    /// The token `id`, also if it is revoked.
    pub async fn token(&self, id: &str) -> Result<Option<TokenRow>, StoreError> {
        Ok(sqlx::query_as("SELECT * FROM token WHERE id = $1")
            .bind(id)
            .fetch_optional(&self.pool)
            .await?)
    }

    /// The token of this name that is not revoked.
    pub async fn token_named(&self, name: &str) -> Result<Option<TokenRow>, StoreError> {
        Ok(sqlx::query_as("SELECT * FROM token WHERE name = $1 AND revoked_at IS NULL")
            .bind(name)
            .fetch_optional(&self.pool)
            .await?)
    }

    /// Tokens with an id below `before`, the latest first.
    pub async fn tokens(&self, before: &str, limit: u32) -> Result<Vec<TokenRow>, StoreError> {
        Ok(sqlx::query_as("SELECT * FROM token WHERE id < $1 ORDER BY id DESC LIMIT $2")
            .bind(before)
            .bind(i64::from(limit))
            .fetch_all(&self.pool)
            .await?)
    }

    /// The number of tokens that are neither revoked nor expired.
    pub async fn n_tokens(&self, now: Micros) -> Result<i64, StoreError> {
        Ok(sqlx::query_scalar(
            "SELECT COUNT(*) FROM token
             WHERE revoked_at IS NULL AND (expires_at IS NULL OR expires_at > $1)",
        )
        .bind(now)
        .fetch_one(&self.pool)
        .await?)
    }

    /// Entries of the audit log with an id below `before`, the latest first.
    pub async fn audit(&self, before: &str, limit: u32) -> Result<Vec<AuditRow>, StoreError> {
        Ok(sqlx::query_as("SELECT * FROM audit WHERE id < $1 ORDER BY id DESC LIMIT $2")
            .bind(before)
            .bind(i64::from(limit))
            .fetch_all(&self.pool)
            .await?)
    }
}
