//! Who may do what, and who did what.
//!
//! A *right* is what an operation takes; a *role* is what a token was given.
//! [`Right::reach`] is the whole of the policy: a device reaches its own asset,
//! the others all or nothing. Knows no headers, no cookies and no addresses.

mod audit;
pub mod jwt;
mod passes;
mod provider;
mod tokens;

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

pub use audit::Deed;
pub(super) use passes::Passes;
pub use passes::{Credential, LOOK_AGAIN};
pub use provider::{KeyFeed, MAX_KEY_AGE, Provider};
pub use tokens::{MAX_TOKEN_NAME, Minted, NewToken, PREFIX, mint, token_view};

use crate::store::Micros;

/// What a token is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// One rig's own device.
    Device,
    /// Sees everything, changes nothing.
    Viewer,
    /// Works with the rigs and their faults.
    Operator,
    /// May do everything.
    Admin,
}

impl Role {
    /// Every role, the least first.
    pub const ALL: [Self; 4] = [Self::Device, Self::Viewer, Self::Operator, Self::Admin];

    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Device => "device",
            Self::Viewer => "viewer",
            Self::Operator => "operator",
            Self::Admin => "admin",
        }
    }
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

impl FromStr for Role {
    type Err = String;
    fn from_str(word: &str) -> Result<Self, String> {
        let known = Self::ALL.into_iter().find(|role| role.as_str() == word);
        known.ok_or_else(|| format!("`{word}` is not one of device, viewer, operator, admin"))
    }
}

/// What an operation takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Right {
    /// Nobody is asked who they are.
    Open,
    /// Any token.
    Known,
    /// Seeing what concerns one asset.
    ReadAsset,
    /// Seeing everything.
    Read,
    /// Sending an asset's telemetry.
    Feed,
    /// Opening and ending an asset's sessions.
    Conduct,
    /// Working with assets, faults and recordings.
    Operate,
    /// Deleting what was recorded; tokens; the audit log.
    Administer,
}

/// How far a right reaches for a role.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reach {
    Nothing,
    /// The one asset of the device.
    Own,
    Everything,
}

impl Right {
    /// Every right.
    pub const ALL: [Self; 8] = [
        Self::Open,
        Self::Known,
        Self::ReadAsset,
        Self::Read,
        Self::Feed,
        Self::Conduct,
        Self::Operate,
        Self::Administer,
    ];

    /// The word for it in the interface's description.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Open => "open",
            Self::Known => "known",
            Self::ReadAsset => "read-asset",
            Self::Read => "read",
            Self::Feed => "feed",
            Self::Conduct => "conduct",
            Self::Operate => "operate",
            Self::Administer => "administer",
        }
    }

    /// How far it reaches for `role`.
    #[must_use]
    pub const fn reach(self, role: Role) -> Reach {
        match (self, role) {
            (Self::Open | Self::Known, _) | (_, Role::Admin) => Reach::Everything,
            (Self::ReadAsset | Self::Feed | Self::Conduct, Role::Device) => Reach::Own,
            (Self::ReadAsset | Self::Read, Role::Viewer | Role::Operator)
            | (Self::Conduct | Self::Operate, Role::Operator) => Reach::Everything,
            _ => Reach::Nothing,
        }
    }
}

/// A token that was found to be in force.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pass {
    /// The token's id; of a JSON Web Token the issuer and the subject.
    pub id: String,
    /// The token's name; of a JSON Web Token the subject.
    pub name: String,
    pub role: Role,
    /// The one asset of a device.
    pub asset: Option<String>,
    pub expires_at: Option<Micros>,
    /// By what it was found.
    pub credential: Credential,
    /// What signed it, if it is a JSON Web Token.
    pub signed_by: Option<jwt::Fingerprint>,
}

/// Who asks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Caller {
    /// Nobody is asked for a token here.
    Anyone,
    Known(Arc<Pass>),
}

impl Caller {
    /// The name of the token.
    #[must_use]
    pub fn name(&self) -> Option<&str> {
        self.pass().map(|pass| pass.name.as_str())
    }

    #[must_use]
    pub fn pass(&self) -> Option<&Pass> {
        match self {
            Self::Anyone => None,
            Self::Known(pass) => Some(pass),
        }
    }

    /// How far `right` reaches for the caller.
    #[must_use]
    pub fn reach(&self, right: Right) -> Reach {
        self.pass().map_or(Reach::Everything, |pass| right.reach(pass.role))
    }

    /// Whether the caller may do to `asset` what takes `right`.
    #[must_use]
    pub fn may(&self, right: Right, asset: &str) -> bool {
        match self.reach(right) {
            Reach::Nothing => false,
            Reach::Own => self.pass().and_then(|pass| pass.asset.as_deref()) == Some(asset),
            Reach::Everything => true,
        }
    }
}
