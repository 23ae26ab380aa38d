//! JSON Web Tokens (RFC 7519) of an identity provider: whether one is in force,
//! whom it names, and what for.
//!
//! A pure function of the token, the provider's keys, what is expected, and the
//! time. Which algorithm may have signed is said by the key, never by the token.

mod keys;
mod signatures;

use jsonwebtoken::errors::ErrorKind;
use jsonwebtoken::{Validation, decode, decode_header};
use serde_json::Value;

pub use keys::{Fingerprint, KeySet, Unusable};

use super::Role;
use crate::store::Micros;

/// How far the clocks of the provider and of this machine may be apart, seconds.
pub const LEEWAY_S: f64 = 30.0;

/// Longest token, bytes; a longer one is refused. Providers stay far below.
const MAX_TOKEN: usize = 16 * 1024;

/// Longest subject, bytes: what OpenID Connect allows (Core 1.0, section 2). A
/// longer one is refused, for half a subject could be somebody else's.
pub const MAX_SUBJECT: usize = 255;

/// What a token must say, and where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Expected {
    /// `iss` is this.
    pub issuer: String,
    /// `aud` is this, or has it.
    pub audience: String,
    /// Where the role is: a claim's name, or a JSON pointer.
    pub role_claim: String,
    /// Where the one asset of a device is, likewise.
    pub asset_claim: String,
}

/// Why a token is refused; says nothing of what is in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    #[error("it is no JSON Web Token signed by an algorithm that is taken")]
    Form,
    #[error("the provider's keys are not there")]
    NoKeys,
    #[error("it names a key that the provider does not have")]
    UnknownKey,
    #[error("it names no key, and the provider has not exactly one")]
    NamesNoKey,
    #[error("its key is not for its algorithm")]
    Algorithm,
    #[error("its signature is wrong")]
    Signature,
    #[error("it is another issuer's")]
    Issuer,
    #[error("it is for another audience")]
    Audience,
    #[error("it has expired")]
    Expired,
    #[error("its time has not come")]
    Early,
    #[error("its claim `{0}` is missing or cannot be")]
    Claim(&'static str),
    #[error("it names no role of this service")]
    Role,
    #[error("it is a device's and names no asset")]
    Asset,
}

/// What a token in force says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Verified {
    pub subject: String,
    pub role: Role,
    /// The one asset of a device.
    pub asset: Option<String>,
    /// When it ends, the leeway included.
    pub expires_at: Micros,
    /// By which key it was signed.
    pub key: Fingerprint,
}

/// Whom `token` names, if it is in force at `now`.
///
/// # Errors
/// [`Refusal`]
pub fn verify(
    token: &str,
    keys: &KeySet,
    expected: &Expected,
    now: Micros,
) -> Result<Verified, Refusal> {
    if token.len() > MAX_TOKEN {
        return Err(Refusal::Form);
    }
    let header = decode_header(token).map_err(|_| Refusal::Form)?;
    // What must be understood is not (RFC 7515, section 4.1.11).
    if header.crit.is_some() {
        return Err(Refusal::Form);
    }
    let key = keys.find(header.kid.as_deref(), header.alg)?;
    let decoded = decode::<Value>(token, &key.decoding, &validation(&key.algorithms, expected));
    let claims = decoded.map_err(|error| refusal(error.kind()))?.claims;
    // The library would take one of several.
    if claims["iss"] != expected.issuer {
        return Err(Refusal::Issuer);
    }
    let expires_at = in_force(&claims, now)?;
    let role = role(claim(&claims, &expected.role_claim)).ok_or(Refusal::Role)?;
    let asset = match role {
        Role::Device => Some(asset(claim(&claims, &expected.asset_claim)).ok_or(Refusal::Asset)?),
        _ => None,
    };
    Ok(Verified { subject: subject(&claims)?, role, asset, expires_at, key: key.fingerprint })
}

/// What the library looks after; time is not for it, for it would read the clock.
fn validation(algorithms: &[jsonwebtoken::Algorithm], expected: &Expected) -> Validation {
    let algorithms = algorithms.to_vec();
    let mut validation = Validation { algorithms, validate_exp: false, ..Validation::default() };
    validation.set_issuer(&[&expected.issuer]);
    validation.set_audience(&[&expected.audience]);
    validation.set_required_spec_claims(&["aud", "exp", "iss", "sub"]);
    validation
}

fn refusal(error: &ErrorKind) -> Refusal {
    match error {
        ErrorKind::InvalidSignature => Refusal::Signature,
        ErrorKind::InvalidAlgorithm => Refusal::Algorithm,
        ErrorKind::InvalidIssuer => Refusal::Issuer,
        ErrorKind::InvalidAudience => Refusal::Audience,
        ErrorKind::MissingRequiredClaim(name) => {
            let known =
                ["aud", "exp", "iss", "sub"].into_iter().find(|known| *known == name.as_str());
            known.map_or(Refusal::Form, Refusal::Claim)
        }
        _ => Refusal::Form,
    }
}

/// When the token ends, if it is in force at `now`.
fn in_force(claims: &Value, now: Micros) -> Result<Micros, Refusal> {
    // What is beyond the range of moments is the end of it: `as` saturates.
    let moment = |seconds: f64| (seconds * 1e6) as Micros;
    let expires_at = claims["exp"].as_f64().ok_or(Refusal::Claim("exp"))?;
    let expires_at = moment(expires_at + LEEWAY_S);
    if now >= expires_at {
        return Err(Refusal::Expired);
    }
    match claims.get("nbf").map(Value::as_f64) {
        Some(None) => Err(Refusal::Claim("nbf")),
        Some(Some(begin)) if now < moment(begin - LEEWAY_S) => Err(Refusal::Early),
        _ => Ok(expires_at),
    }
}

fn subject(claims: &Value) -> Result<String, Refusal> {
    let subject = claims["sub"].as_str().unwrap_or_default();
    let whole = !subject.is_empty() && !subject.chars().any(char::is_control);
    let fits = whole && subject.len() <= MAX_SUBJECT;
    fits.then(|| subject.to_owned()).ok_or(Refusal::Claim("sub"))
}

/// A claim by its name, or by a JSON pointer, which begins with `/`.
fn claim<'a>(claims: &'a Value, place: &str) -> Option<&'a Value> {
    if place.starts_with('/') { claims.pointer(place) } else { claims.get(place) }
}

/// A role, or the greatest of several; what is none of this service's is passed
/// over in an array, for providers list a person's roles elsewhere too.
fn role(claim: Option<&Value>) -> Option<Role> {
    let one = |value: &Value| value.as_str()?.parse::<Role>().ok();
    match claim? {
        Value::Array(several) => {
            let held: Vec<Role> = several.iter().filter_map(one).collect();
            Role::ALL.into_iter().rev().find(|role| held.contains(role))
        }
        single => one(single),
    }
}

fn asset(claim: Option<&Value>) -> Option<String> {
    claim?.as_str().filter(|name| !name.is_empty()).map(str::to_owned)
}
