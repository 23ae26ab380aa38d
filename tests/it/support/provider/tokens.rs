//! The keys of an identity provider, and tokens signed with them. `fuzz/` contains this file too.

use base64::Engine;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use offbd_service::access::jwt::ExpectedClaims;
use ring::rand::SystemRandom;
use ring::signature::{Ed25519KeyPair, KeyPair};
use serde_json::{Value, json};

pub const ISSUER: &str = "https://id.example/realm";
pub const AUDIENCE: &str = "offbd";

/// Base64url without padding (RFC 7515, section 2).
pub fn base64(bytes: impl AsRef<[u8]>) -> String {
    URL_SAFE_NO_PAD.encode(bytes)
}

/// Returns a token with the signature made by `sign`.
pub fn token(header: &Value, claims: &Value, sign: impl Fn(&[u8]) -> Vec<u8>) -> String {
    let message = format!("{}.{}", base64(header.to_string()), base64(claims.to_string()));
    let signature = base64(sign(message.as_bytes()));
    format!("{message}.{signature}")
}

/// An Ed25519 key pair.
pub struct Key {
    pub id: &'static str,
    pair: Ed25519KeyPair,
}

impl Key {
    pub fn new(id: &'static str) -> Self {
        let pair = Ed25519KeyPair::generate_pkcs8(&SystemRandom::new()).unwrap();
        Self { id, pair: Ed25519KeyPair::from_pkcs8(pair.as_ref()).unwrap() }
    }

    pub fn public(&self) -> Value {
        let x = base64(self.pair.public_key());
        json!({ "kty": "OKP", "crv": "Ed25519", "use": "sig", "kid": self.id, "x": x })
    }

    pub fn sign(&self, message: &[u8]) -> Vec<u8> {
        self.pair.sign(message).as_ref().to_vec()
    }

    pub fn token(&self, claims: &Value) -> String {
        let header = json!({ "alg": "EdDSA", "typ": "JWT", "kid": self.id });
        token(&header, claims, |message| self.sign(message))
    }
}

/// Returns the JSON Web Key Set of `keys`.
pub fn jwks(keys: &[&Key]) -> String {
    let keys: Vec<Value> = keys.iter().map(|key| key.public()).collect();
    json!({ "keys": keys }).to_string()
}

/// The end of 2099, s since 1970.
pub const END: i64 = 4_102_444_800;

/// Returns claims of `subject` that expire at [`END`].
pub fn claims(subject: &str, role: &str) -> Value {
    json!({ "iss": ISSUER, "aud": AUDIENCE, "sub": subject, "exp": END, "offbd_role": role })
}

/// Returns the claims of an asset's device.
pub fn device(asset: &str) -> Value {
    let mut claims = claims(&format!("{asset}'s device"), "device");
    claims["offbd_asset"] = json!(asset);
    claims
}

/// Returns the claims that the provider's tokens have.
pub fn expected() -> ExpectedClaims {
    let (role_claim, asset_claim) = ("offbd_role".to_owned(), "offbd_asset".to_owned());
    let (issuer, audience) = (ISSUER.to_owned(), AUDIENCE.to_owned());
    ExpectedClaims { issuer, audience, role_claim, asset_claim }
}
