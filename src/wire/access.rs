//! Tokens, logins and the audit log as they are shown.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A token, without its secret.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct TokenView {
    pub id: String,
    /// What stands beside everything that is done with it.
    pub name: String,
    /// `device`, `viewer`, `operator` or `admin`.
    pub role: String,
    /// The one asset of a device.
    pub asset: Option<String>,
    /// RFC 3339.
    pub created_at: String,
    /// The name of the token by which it was made.
    pub created_by: String,
    /// RFC 3339; null if it does not end by itself.
    pub expires_at: Option<String>,
    /// To the hour.
    pub last_used_at: Option<String>,
    pub revoked_at: Option<String>,
}

/// A token that is wanted.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewTokenView {
    /// 1 to 100 bytes; no other token in force has it.
    #[schema(min_length = 1, max_length = 100)]
    pub name: String,
    /// `device`, `viewer`, `operator` or `admin`.
    #[schema(pattern = "^(device|viewer|operator|admin)$")]
    pub role: String,
    /// For a device: its one asset.
    pub asset: Option<String>,
    /// RFC 3339; without it the token does not end by itself.
    #[schema(format = DateTime)]
    pub expires_at: Option<String>,
}

/// A new token, with its secret, which is shown this once.
#[derive(Clone, Serialize, Deserialize, ToSchema)]
pub struct MadeTokenView {
    #[serde(flatten)]
    pub token: TokenView,
    /// What goes into `Authorization: Bearer …`.
    pub secret: String,
}

/// Something that was done.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct AuditView {
    pub id: String,
    /// RFC 3339.
    pub at: String,
    /// The name of the token, of a JSON Web Token the subject; `anyone` where none
    /// is asked for.
    pub actor: String,
    /// The token's id; of a JSON Web Token the issuer and the subject.
    pub token_id: Option<String>,
    /// The operation, as in this description.
    pub act: String,
    /// What it was done to.
    pub target: String,
    /// From where; null at the machine itself.
    pub address: Option<String>,
}

/// Who asks, and whether that matters.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct CallerView {
    /// `required` or `off`.
    pub authentication: String,
    /// The token's name; of a JSON Web Token the subject.
    pub name: Option<String>,
    /// What the caller may do; `admin` where no token is asked for.
    pub role: String,
    /// The one asset of a device.
    pub asset: Option<String>,
}
