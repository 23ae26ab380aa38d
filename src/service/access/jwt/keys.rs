//! A provider's public keys (JWKS, RFC 7517), and which algorithms each is for.

use std::fmt;

use jsonwebtoken::jwk::{AlgorithmParameters, EllipticCurve, Jwk, JwkSet, KeyAlgorithm};
use jsonwebtoken::jwk::{KeyOperations, PublicKeyUse};
use jsonwebtoken::{Algorithm, DecodingKey};
use sha2::{Digest, Sha256};

use super::{Refusal, signatures};

/// SHA-256 of a key as it was published.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Fingerprint([u8; 32]);

impl fmt::Debug for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:02x}{:02x}…", self.0[0], self.0[1])
    }
}

/// A key that can verify.
#[derive(Debug)]
pub(super) struct Key {
    id: Option<String>,
    /// At least one; all of one family.
    pub(super) algorithms: Vec<Algorithm>,
    pub(super) decoding: DecodingKey,
    pub(super) fingerprint: Fingerprint,
}

/// The keys of a provider that can verify; others are left out.
#[derive(Debug)]
pub struct KeySet {
    keys: Vec<Key>,
}

/// Why a document is no set of keys.
#[derive(Debug, thiserror::Error)]
pub enum Unusable {
    #[error("it is no JSON Web Key Set")]
    Form(#[from] serde_json::Error),
    #[error("it has no key that verifies RS, PS, ES256, ES384 or EdDSA signatures")]
    Empty,
}

impl KeySet {
    /// Reads a set of keys.
    ///
    /// # Errors
    /// [`Unusable`] if it is none, or has no key that can verify.
    pub fn parse(document: &[u8]) -> Result<Self, Unusable> {
        signatures::install();
        let set: JwkSet = serde_json::from_slice(document)?;
        let keys: Vec<Key> = set.keys.iter().filter_map(key).collect();
        if keys.is_empty() { Err(Unusable::Empty) } else { Ok(Self { keys }) }
    }

    /// How many there are.
    #[must_use]
    pub fn n_keys(&self) -> usize {
        self.keys.len()
    }

    /// Whether the key is still published.
    #[must_use]
    pub fn has(&self, fingerprint: Fingerprint) -> bool {
        self.keys.iter().any(|key| key.fingerprint == fingerprint)
    }

    /// The key of this id for `algorithm`; without an id the only key there is.
    pub(super) fn find(&self, id: Option<&str>, algorithm: Algorithm) -> Result<&Key, Refusal> {
        let fits = |key: &&Key| key.algorithms.contains(&algorithm);
        match (id, self.keys.as_slice()) {
            (None, [only]) => Some(only).filter(fits).ok_or(Refusal::Algorithm),
            (None, _) => Err(Refusal::NamesNoKey),
            (Some(id), keys) => {
                let mut named = keys.iter().filter(|key| key.id.as_deref() == Some(id)).peekable();
                let unknown = named.peek().is_none();
                let why = if unknown { Refusal::UnknownKey } else { Refusal::Algorithm };
                named.find(fits).ok_or(why)
            }
        }
    }
}

fn key(jwk: &Jwk) -> Option<Key> {
    let algorithms = algorithms(jwk);
    if algorithms.is_empty() || !verifies(jwk) {
        return None;
    }
    Some(Key {
        id: jwk.common.key_id.clone(),
        algorithms,
        decoding: DecodingKey::from_jwk(jwk).ok()?,
        fingerprint: Fingerprint(Sha256::digest(serde_json::to_vec(jwk).ok()?).into()),
    })
}

/// Whether the key is published for signatures, as far as it says.
fn verifies(jwk: &Jwk) -> bool {
    let common = &jwk.common;
    let by_use = common.public_key_use.as_ref().is_none_or(|of| *of == PublicKeyUse::Signature);
    let operations = common.key_operations.as_ref();
    by_use && operations.is_none_or(|known| known.contains(&KeyOperations::Verify))
}

/// What the key is for: the algorithm that it states, or all of its kind. A
/// shared secret is for none, whatever it states: what verifies must not sign.
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
