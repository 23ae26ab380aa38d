//! Tokens, logins and audit entries, as the API returns them.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::words::{AuthenticationWord, Role};

/// A token, without its secret.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct TokenView {
    pub id: String,
    /// Name, recorded in the audit log with every action.
    pub name: String,
    pub role: Role,
    /// The asset to which a device's token is restricted; null for other roles.
    pub asset: Option<String>,
    /// Time of creation, RFC 3339.
    pub created_at: String,
    /// Who created it, named like the `actor` of an audit entry.
    pub created_by: String,
    /// Time of expiry, RFC 3339; null if the token does not expire.
    pub expires_at: Option<String>,
    /// Time of the last use, RFC 3339, accurate to the hour; null if never used.
    pub last_used_at: Option<String>,
    /// Time of revocation, RFC 3339; null if not revoked.
    pub revoked_at: Option<String>,
}

/// A token to create.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewTokenView {
    /// Name, 1 to 100 bytes, different from those of all other valid tokens.
    #[schema(min_length = 1, max_length = 100)]
    pub name: String,
    pub role: Role,
    /// The asset of a device: required for the role `device`, not allowed for others.
    pub asset: Option<String>,
    /// Time of expiry, RFC 3339; if absent or null, the token does not expire.
    #[schema(format = DateTime)]
    pub expires_at: Option<String>,
}

/// A new token with its secret, which is returned only once.
#[derive(Clone, Serialize, Deserialize, ToSchema)]
pub struct MadeTokenView {
    #[serde(flatten)]
    pub token: TokenView,
    /// The secret to send as `Authorization: Bearer …`.
    pub secret: String,
}

/// An audit entry: one action by one caller.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct AuditView {
    pub id: String,
    /// Time of the action, RFC 3339.
    pub at: String,
    /// Name of the token, or the subject of a JSON Web Token. If the service requires no token, the
    /// name that the request gave in `by`, else `anyone`; `command line` for the command line.
    pub actor: String,
    /// Id of the token, or issuer and subject of a JSON Web Token; null without a token.
    pub token_id: Option<String>,
    /// The operation's `operationId` in this description.
    pub act: String,
    /// What the operation was applied to: the path of the request.
    pub target: String,
    /// IP address of the caller; null for the command line.
    pub address: Option<String>,
}

/// The caller of this request.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct CallerView {
    pub authentication: AuthenticationWord,
    /// Name of the token, or the subject of a JSON Web Token; null without a token.
    pub name: Option<String>,
    /// Role of the caller; `admin` if the service requires no token.
    pub role: Role,
    /// The asset to which a device's token is restricted; null for other roles.
    pub asset: Option<String>,
}
