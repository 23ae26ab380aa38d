"""Makes vectors.json with PyJWT and cryptography, which share no code with offbd:

    pip install 'PyJWT[crypto]' && python3 tests/it/jwt/make.py > tests/it/jwt/vectors.json

The private keys are new each time and not stored. Tokens expire in 2100.
"""

import json

import jwt
from cryptography.hazmat.primitives.asymmetric import ec, ed25519, rsa
from jwt.algorithms import ECAlgorithm, OKPAlgorithm, RSAAlgorithm

CLAIMS = {
    "iss": "https://id.example/realm",
    "aud": ["account", "offbd"],
    "sub": "olga",
    "iat": 1767225600,
    "nbf": 1767225600,
    "exp": 4102444800,
    "offbd_role": "operator",
}

RSA = rsa.generate_private_key(public_exponent=65537, key_size=2048)
KEYS = {
    "RS256": (RSA, RSAAlgorithm),
    "RS384": (RSA, RSAAlgorithm),
    "RS512": (RSA, RSAAlgorithm),
    "PS256": (RSA, RSAAlgorithm),
    "PS384": (RSA, RSAAlgorithm),
    "PS512": (RSA, RSAAlgorithm),
    "ES256": (ec.generate_private_key(ec.SECP256R1()), ECAlgorithm),
    "ES384": (ec.generate_private_key(ec.SECP384R1()), ECAlgorithm),
    "EdDSA": (ed25519.Ed25519PrivateKey.generate(), OKPAlgorithm),
}

keys, tokens = [], {}
for algorithm, (key, kind) in KEYS.items():
    name = "rsa" if key is RSA else algorithm.lower()
    tokens[algorithm] = jwt.encode(CLAIMS, key, algorithm=algorithm, headers={"kid": name})
    published = {**kind.to_jwk(key.public_key(), as_dict=True), "kid": name, "use": "sig"}
    if published not in keys:
        keys.append(published)
# A set may contain keys that are not for signatures, or of an unknown type.
keys.append({"kty": "OKP", "crv": "X25519", "x": "AAAA", "kid": "agreement", "use": "enc"})
keys.append({"kty": "AKP", "alg": "ML-DSA-44", "pub": "AAAA", "kid": "later"})
print(json.dumps({"claims": CLAIMS, "jwks": {"keys": keys}, "tokens": tokens}, indent=1))
