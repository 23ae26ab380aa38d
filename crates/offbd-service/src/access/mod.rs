//! Authentication, authorization and audit entries.
//!
//! A *right* is required by an operation; a *role* is assigned to a token.
//! [`Right::scope`] is the complete policy: it maps each right and role to the assets that
//! the right covers. Independent of HTTP headers, cookies and addresses.

mod audit;
pub mod jwt;
pub(super) mod principals;
mod provider;
mod tokens;

use std::sync::Arc;

pub use audit::AuditEntry;
pub(super) use principals::PrincipalCache;
pub use principals::{Credential, PRINCIPAL_CACHE_TIME};
pub use provider::{KeyFeed, MAX_KEY_AGE, Provider};
pub(super) use tokens::random;
pub use tokens::{MAX_TOKEN_NAME, Minted, NewToken, mint, token_view};

use offbd_store::Micros;
pub use offbd_wire::words::Role;

/// The prefix of every token, so that secret scanners recognize it.
pub const PREFIX: &str = "offbd_";

/// A right that an operation requires. [`Self::as_str`] is the value of `x-right` in the
/// OpenAPI document.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Right {
    /// `open`: no token required.
    Public,
    /// `known`: any valid token.
    Authenticated,
    /// `read-asset`: reading data of one asset.
    ReadAsset,
    /// `read`: reading data of the whole fleet.
    Read,
    /// `feed`: sending telemetry of an asset.
    SendTelemetry,
    /// `conduct`: opening and ending sessions of an asset.
    ControlSessions,
    /// `operate`: changing assets, faults, recordings and calibrations.
    Operate,
    /// `administer`: deleting assets and sessions, managing tokens, reading the audit log.
    Administer,
}

/// The assets that a right covers for a role.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AccessScope {
    /// No asset: the role does not have the right.
    None,
    /// Only the asset of the device's token.
    OwnAsset,
    /// All assets.
    All,
}

impl Right {
    /// Every right.
    pub const ALL: [Self; 8] = [
        Self::Public,
        Self::Authenticated,
        Self::ReadAsset,
        Self::Read,
        Self::SendTelemetry,
        Self::ControlSessions,
        Self::Operate,
        Self::Administer,
    ];

    /// Returns the value of `x-right` in the OpenAPI document.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Public => "open",
            Self::Authenticated => "known",
            Self::ReadAsset => "read-asset",
            Self::Read => "read",
            Self::SendTelemetry => "feed",
            Self::ControlSessions => "conduct",
            Self::Operate => "operate",
            Self::Administer => "administer",
        }
    }

    /// Returns the assets that this right covers for `role`.
    #[must_use]
    pub const fn scope(self, role: Role) -> AccessScope {
        match (self, role) {
            (Self::Public | Self::Authenticated, _) | (_, Role::Admin) => AccessScope::All,
            (Self::ReadAsset | Self::SendTelemetry | Self::ControlSessions, Role::Device) => {
                AccessScope::OwnAsset
            }
            (Self::ReadAsset | Self::Read, Role::Viewer | Role::Operator)
            | (Self::ControlSessions | Self::Operate, Role::Operator) => AccessScope::All,
            _ => AccessScope::None,
        }
    }
}

/// The authenticated identity behind a valid token.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Principal {
    /// The id of the token; for a JSON Web Token its issuer and subject.
    pub id: String,
    /// The name of the token; for a JSON Web Token its subject.
    pub name: String,
    pub role: Role,
    /// The asset of a device.
    pub asset: Option<String>,
    pub expires_at: Option<Micros>,
    /// The credential of the request.
    pub credential: Credential,
    /// The key that signed the token, if it is a JSON Web Token.
    pub signed_by: Option<jwt::Fingerprint>,
}

/// The caller of a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Caller {
    /// Authentication is off.
    Anonymous,
    Authenticated(Arc<Principal>),
}

impl Caller {
    /// Returns the name of the token.
    #[must_use]
    pub fn name(&self) -> Option<&str> {
        self.principal().map(|principal| principal.name.as_str())
    }

    #[must_use]
    pub fn principal(&self) -> Option<&Principal> {
        match self {
            Self::Anonymous => None,
            Self::Authenticated(principal) => Some(principal),
        }
    }

    /// Returns the assets that `right` covers for the caller.
    #[must_use]
    pub fn scope(&self, right: Right) -> AccessScope {
        self.principal().map_or(AccessScope::All, |principal| right.scope(principal.role))
    }

    /// Whether the caller has `right` for `asset`.
    #[must_use]
    pub fn may(&self, right: Right, asset: &str) -> bool {
        match self.scope(right) {
            AccessScope::None => false,
            AccessScope::OwnAsset => {
                self.principal().and_then(|principal| principal.asset.as_deref()) == Some(asset)
            }
            AccessScope::All => true,
        }
    }
}
