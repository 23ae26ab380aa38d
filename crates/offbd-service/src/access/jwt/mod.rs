//! Verifies JSON Web Tokens (RFC 7519) of an identity provider.
//!
//! [`verify`] is a pure function of the token, the provider's keys, the expected claims and
//! the time. The permitted algorithms are those of the key, never the one in the token.

mod keys;
mod signatures;

use jsonwebtoken::errors::ErrorKind;
use jsonwebtoken::{Validation, decode, decode_header};
use serde_json::Value;

pub use keys::{Fingerprint, KeySet, KeySetError};

use super::Role;
use offbd_store::Micros;

/// Permitted difference between the clocks of the provider and this machine, s.
pub const LEEWAY_S: f64 = 30.0;

/// Longest token, bytes; a longer one is refused. Tokens of providers are much shorter.
const MAX_TOKEN: usize = 16 * 1024;

/// Longest subject, bytes, as in OpenID Connect Core 1.0, section 2. A longer one is
/// refused, because a truncated subject could be that of another person.
pub const MAX_SUBJECT: usize = 255;

/// The claims that a token must have.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExpectedClaims {
    /// Required value of `iss`.
    pub issuer: String,
    /// Required value of `aud`, or of one of its elements.
    pub audience: String,
    /// The claim with the role: a name or a JSON pointer.
    pub role_claim: String,
    /// The claim with the asset of a device: a name or a JSON pointer.
    pub asset_claim: String,
}

/// Why a token is refused. The messages do not contain any part of the token.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum JwtError {
    #[error("not a JSON Web Token signed by a supported algorithm")]
    Malformed,
    #[error("the provider's keys are not available")]
    NoKeys,
    #[error("the provider has no key with this key id")]
    UnknownKey,
    #[error("no key id, and the provider does not have exactly one key")]
    NoKeyId,
    #[error("the key does not support the algorithm of the token")]
    Algorithm,
    #[error("invalid signature")]
    Signature,
    #[error("wrong issuer")]
    Issuer,
    #[error("wrong audience")]
    Audience,
    #[error("expired")]
    Expired,
    #[error("not valid yet")]
    NotYetValid,
    #[error("missing or invalid claim `{0}`")]
    Claim(&'static str),
    #[error("no role of this service in the role claim")]
    Role,
    #[error("the token has the role `device` and does not name an asset")]
    Asset,
}

/// The content of a valid token.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VerifiedToken {
    pub subject: String,
    pub role: Role,
    /// The asset of a device.
    pub asset: Option<String>,
    /// Expiry time, including the leeway.
    pub expires_at: Micros,
    /// The key that signed it.
    pub key: Fingerprint,
}

/// Verifies `token` at the time `now`.
///
/// # Errors
/// [`JwtError`] if it is invalid.
pub fn verify(
    token: &str,
    keys: &KeySet,
    expected: &ExpectedClaims,
    now: Micros,
) -> Result<VerifiedToken, JwtError> {
    if token.len() > MAX_TOKEN {
        return Err(JwtError::Malformed);
    }
    let header = decode_header(token).map_err(|_| JwtError::Malformed)?;
    // No critical extension is supported (RFC 7515, section 4.1.11).
    if header.crit.is_some() {
        return Err(JwtError::Malformed);
    }
    let key = keys.find(header.kid.as_deref(), header.alg)?;
    let decoded = decode::<Value>(token, &key.decoding, &validation(&key.algorithms, expected));
    let claims = decoded.map_err(|error| jwt_error(error.kind()))?.claims;
    // The library would also accept an array that contains the issuer.
    if claims["iss"] != expected.issuer {
        return Err(JwtError::Issuer);
    }
    let expires_at = check_time(&claims, now)?;
    let role = role(claim(&claims, &expected.role_claim)).ok_or(JwtError::Role)?;
    let asset = match role {
        Role::Device => Some(asset(claim(&claims, &expected.asset_claim)).ok_or(JwtError::Asset)?),
        _ => None,
    };
    Ok(VerifiedToken { subject: subject(&claims)?, role, asset, expires_at, key: key.fingerprint })
}

/// Returns the checks of the library. Times are not among them, because the library would
/// read the clock.
fn validation(algorithms: &[jsonwebtoken::Algorithm], expected: &ExpectedClaims) -> Validation {
    let algorithms = algorithms.to_vec();
    let mut validation = Validation { algorithms, validate_exp: false, ..Validation::default() };
    validation.set_issuer(&[&expected.issuer]);
    validation.set_audience(&[&expected.audience]);
    validation.set_required_spec_claims(&["aud", "exp", "iss", "sub"]);
    validation
}

fn jwt_error(error: &ErrorKind) -> JwtError {
    match error {
        ErrorKind::InvalidSignature => JwtError::Signature,
        ErrorKind::InvalidAlgorithm => JwtError::Algorithm,
        ErrorKind::InvalidIssuer => JwtError::Issuer,
        ErrorKind::InvalidAudience => JwtError::Audience,
        ErrorKind::MissingRequiredClaim(name) => {
            let known =
                ["aud", "exp", "iss", "sub"].into_iter().find(|known| *known == name.as_str());
            known.map_or(JwtError::Malformed, JwtError::Claim)
        }
        _ => JwtError::Malformed,
    }
}

/// Checks `exp` and `nbf`; returns the expiry time.
fn check_time(claims: &Value, now: Micros) -> Result<Micros, JwtError> {
    // `as` saturates at the ends of the range.
    let micros = |seconds: f64| (seconds * 1e6) as Micros;
    let expires_at = claims["exp"].as_f64().ok_or(JwtError::Claim("exp"))?;
    let expires_at = micros(expires_at + LEEWAY_S);
    if now >= expires_at {
        return Err(JwtError::Expired);
    }
    match claims.get("nbf").map(Value::as_f64) {
        Some(None) => Err(JwtError::Claim("nbf")),
        Some(Some(begin)) if now < micros(begin - LEEWAY_S) => Err(JwtError::NotYetValid),
        _ => Ok(expires_at),
    }
}

fn subject(claims: &Value) -> Result<String, JwtError> {
    let subject = claims["sub"].as_str().unwrap_or_default();
    let whole = !subject.is_empty() && !subject.chars().any(char::is_control);
    let fits = whole && subject.len() <= MAX_SUBJECT;
    fits.then(|| subject.to_owned()).ok_or(JwtError::Claim("sub"))
}

/// Returns a claim by its name, or by a JSON pointer, which starts with `/`.
fn claim<'a>(claims: &'a Value, path: &str) -> Option<&'a Value> {
    if path.starts_with('/') { claims.pointer(path) } else { claims.get(path) }
}

/// Returns the role, or the highest of an array. Unknown roles in an array are ignored,
/// because a provider also lists roles of other services.
fn role(claim: Option<&Value>) -> Option<Role> {
    let one = |value: &Value| value.as_str()?.parse::<Role>().ok();
    match claim? {
        Value::Array(several) => {
            let held: Vec<Role> = several.iter().filter_map(one).collect();
            Role::ALL.iter().copied().rev().find(|role| held.contains(role))
        }
        single => one(single),
    }
}

fn asset(claim: Option<&Value>) -> Option<String> {
    claim?.as_str().filter(|name| !name.is_empty()).map(str::to_owned)
}
