//! A provider's public keys (JSON Web Key Set, RFC 7517), and the algorithms of each.

use std::fmt;

use jsonwebtoken::jwk::{AlgorithmParameters, EllipticCurve, Jwk, JwkSet, KeyAlgorithm};
use jsonwebtoken::jwk::{KeyOperations, PublicKeyUse};
use jsonwebtoken::{Algorithm, DecodingKey};
use sha2::{Digest, Sha256};

use super::{JwtError, signatures};

/// The SHA-256 of a published key.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Fingerprint([u8; 32]);

impl fmt::Debug for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:02x}{:02x}…", self.0[0], self.0[1])
    }
}

/// A key that verifies signatures.
#[derive(Debug)]
pub(super) struct VerificationKey {
    id: Option<String>,
    /// At least one; all of the same family.
    pub(super) algorithms: Vec<Algorithm>,
    pub(super) decoding: DecodingKey,
    pub(super) fingerprint: Fingerprint,
}

/// The keys of a provider that verify signatures; others are ignored.
#[derive(Debug)]
pub struct KeySet {
    keys: Vec<VerificationKey>,
}

/// Why a document is not a usable key set.
#[derive(Debug, thiserror::Error)]
pub enum KeySetError {
    #[error("not a JSON Web Key Set")]
    Malformed(#[from] serde_json::Error),
    #[error("no key verifies RS, PS, ES256, ES384 or EdDSA signatures")]
    Empty,
}

impl KeySet {
    /// Parses a key set.
    ///
    /// # Errors
    /// [`KeySetError`] if it is malformed or has no key that verifies signatures.
    pub fn parse(document: &[u8]) -> Result<Self, KeySetError> {
        signatures::install();
        let set: JwkSet = serde_json::from_slice(document)?;
        let keys: Vec<VerificationKey> = set.keys.iter().filter_map(key).collect();
        if keys.is_empty() { Err(KeySetError::Empty) } else { Ok(Self { keys }) }
    }

    /// Returns the number of keys.
    #[must_use]
    pub fn n_keys(&self) -> usize {
        self.keys.len()
    }

    /// Whether the key is still published.
    #[must_use]
    pub fn has(&self, fingerprint: Fingerprint) -> bool {
        self.keys.iter().any(|key| key.fingerprint == fingerprint)
    }

    /// Returns the key with this id for `algorithm`; without an id the only key of the set.
    pub(super) fn find(
        &self,
        id: Option<&str>,
        algorithm: Algorithm,
    ) -> Result<&VerificationKey, JwtError> {
        let fits = |key: &&VerificationKey| key.algorithms.contains(&algorithm);
        match (id, self.keys.as_slice()) {
            (None, [only]) => Some(only).filter(fits).ok_or(JwtError::Algorithm),
            (None, _) => Err(JwtError::NoKeyId),
            (Some(id), keys) => {
                let mut named = keys.iter().filter(|key| key.id.as_deref() == Some(id)).peekable();
                let unknown = named.peek().is_none();
                let error = if unknown { JwtError::UnknownKey } else { JwtError::Algorithm };
                named.find(fits).ok_or(error)
            }
        }
    }
}

fn key(jwk: &Jwk) -> Option<VerificationKey> {
    let algorithms = algorithms(jwk);
    if algorithms.is_empty() || !verifies(jwk) {
        return None;
    }
    Some(VerificationKey {
        id: jwk.common.key_id.clone(),
        algorithms,
        decoding: DecodingKey::from_jwk(jwk).ok()?,
        fingerprint: Fingerprint(Sha256::digest(serde_json::to_vec(jwk).ok()?).into()),
    })
}

/// Whether `use` and `key_ops`, if present, permit verifying signatures.
fn verifies(jwk: &Jwk) -> bool {
    let common = &jwk.common;
    let by_use = common.public_key_use.as_ref().is_none_or(|of| *of == PublicKeyUse::Signature);
    let operations = common.key_operations.as_ref();
    by_use && operations.is_none_or(|known| known.contains(&KeyOperations::Verify))
}

/// Returns the algorithms of a key: the one in `alg`, or all of its type. A symmetric key
/// has none, because a key that verifies must not be able to sign.
fn algorithms(jwk: &Jwk) -> Vec<Algorithm> {
    use Algorithm::{ES256, ES384, EdDSA, PS256, PS384, PS512, RS256, RS384, RS512};
    let able: &[Algorithm] = match &jwk.algorithm {
        AlgorithmParameters::RSA(_) => &[RS256, RS384, RS512, PS256, PS384, PS512],
        AlgorithmParameters::EllipticCurve(key) if key.curve == EllipticCurve::P256 => &[ES256],
        AlgorithmParameters::EllipticCurve(key) if key.curve == EllipticCurve::P384 => &[ES384],
        AlgorithmParameters::OctetKeyPair(key) if key.curve == EllipticCurve::Ed25519 => &[EdDSA],
        _ => &[],
    };
    let stated = jwk.common.key_algorithm;
    let fits = |able: &Algorithm| stated.is_none_or(|stated| stated == KeyAlgorithm::from(*able));
    able.iter().copied().filter(fits).collect()
}
