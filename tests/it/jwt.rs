//! JSON Web Tokens of an identity provider: which are accepted, and for which principal.

use crate::support::provider::{self, Key, Published, base64, claims, jwks, token};
use crate::support::{Client, Events, ServiceFixture, eventually};
use offbd::config::Auth;
use offbd::server::tokens;
use offbd::service::access::jwt::{
    ExpectedClaims, JwtError, KeySet, LEEWAY_S, MAX_SUBJECT, verify,
};
use offbd::service::access::{NewToken, Role};
use reqwest::Method;
use reqwest::header::WWW_AUTHENTICATE;
use ring::hmac;
use serde_json::{Value, json};

const NOW_S: i64 = 1_800_000_000;

fn expected() -> ExpectedClaims {
    provider::config("").expected()
}

fn at(seconds: f64) -> i64 {
    ((NOW_S as f64 + seconds) * 1e6) as i64
}

/// Test vectors made with PyJWT, see `jwt/make.py`.
fn vectors() -> Value {
    serde_json::from_str(include_str!("jwt/vectors.json")).unwrap()
}

#[test]
fn validate_tokens_made_by_another_implementation() {
    let vectors = vectors();
    let keys = KeySet::parse(vectors["jwks"].to_string().as_bytes()).unwrap();
    assert_eq!(keys.n_keys(), 4, "the keys that verify signatures");
    let tokens = vectors["tokens"].as_object().unwrap();
    assert_eq!(tokens.len(), 9);
    for (algorithm, token) in tokens {
        let token = token.as_str().unwrap();
        let verified = verify(token, &keys, &expected(), at(0.0)).unwrap();
        let found = (verified.subject.as_str(), verified.role, verified.asset, verified.expires_at);
        let end = provider::END * 1_000_000 + (LEEWAY_S * 1e6) as i64;
        assert_eq!(found, ("olga", Role::Operator, None, end), "{algorithm}");

        let parts: Vec<&str> = token.split('.').collect();
        let mut elevated = vectors["claims"].clone();
        elevated["offbd_role"] = json!("admin");
        let changed = [parts[0], &base64(elevated.to_string()), parts[2]].join(".");
        assert_eq!(verify(&changed, &keys, &expected(), at(0.0)), Err(JwtError::Signature));
        let other = if algorithm == "RS256" { "PS256" } else { "RS256" };
        let other: Vec<&str> = tokens[other].as_str().unwrap().split('.').collect();
        let moved = [parts[0], parts[1], other[2]].join(".");
        assert_eq!(verify(&moved, &keys, &expected(), at(0.0)), Err(JwtError::Signature));
        // With several keys, the token must name one.
        let header = base64(json!({ "alg": algorithm }).to_string());
        let nameless = [header.as_str(), parts[1], parts[2]].join(".");
        assert_eq!(verify(&nameless, &keys, &expected(), at(0.0)), Err(JwtError::NoKeyId));
    }
}

/// Returns the role of a token with changed claims, or the error.
fn role_of(change: impl FnOnce(&mut Value)) -> Result<Role, JwtError> {
    let key = Key::new("k");
    let mut claims = json!({
        "iss": provider::ISSUER, "aud": provider::AUDIENCE, "sub": "s", "exp": NOW_S + 60,
        "offbd_role": "viewer",
    });
    change(&mut claims);
    let keys = KeySet::parse(jwks(&[&key]).as_bytes()).unwrap();
    verify(&key.token(&claims), &keys, &expected(), at(0.0)).map(|verified| verified.role)
}

#[test]
fn a_token_with_unexpected_claims_is_rejected() {
    let with = |name: &str, value: Value| role_of(|claims| claims[name] = value);
    let without = |name: &str| role_of(|claims| drop(claims.as_object_mut().unwrap().remove(name)));
    assert_eq!(role_of(|_| {}), Ok(Role::Viewer));
    for (name, value, wanted) in [
        ("iss", json!("https://id.example/realm/"), JwtError::Issuer),
        ("iss", json!([provider::ISSUER, "https://evil.example"]), JwtError::Issuer),
        ("iss", json!(7), JwtError::Claim("iss")),
        ("aud", json!("offbd2"), JwtError::Audience),
        ("aud", json!(["account", "offbd2"]), JwtError::Audience),
        ("aud", json!([]), JwtError::Audience),
        ("aud", json!({ "offbd": true }), JwtError::Claim("aud")),
        ("exp", json!("4102444800"), JwtError::Claim("exp")),
        ("exp", json!(0), JwtError::Expired),
        ("exp", json!(-1), JwtError::Claim("exp")),
        ("nbf", json!("now"), JwtError::Claim("nbf")),
        ("nbf", Value::Null, JwtError::Claim("nbf")),
        ("sub", json!(""), JwtError::Claim("sub")),
        ("sub", json!("a\nb"), JwtError::Claim("sub")),
        ("sub", json!("s".repeat(MAX_SUBJECT + 1)), JwtError::Claim("sub")),
        ("offbd_role", json!("god"), JwtError::Role),
        ("offbd_role", json!("Admin"), JwtError::Role),
        ("offbd_role", json!(["god", 7]), JwtError::Role),
        ("offbd_role", json!({ "admin": true }), JwtError::Role),
        ("offbd_role", json!("device"), JwtError::Asset),
    ] {
        assert_eq!(with(name, value.clone()), Err(wanted), "{name} {value}");
    }
    for name in ["iss", "aud", "exp", "sub"] {
        assert!(
            matches!(without(name), Err(JwtError::Claim(missing)) if missing == name),
            "{name}"
        );
    }
    assert_eq!(without("offbd_role"), Err(JwtError::Role));
    assert_eq!(with("sub", json!("s".repeat(MAX_SUBJECT))), Ok(Role::Viewer));
    assert_eq!(with("exp", json!(1e19)), Ok(Role::Viewer));
}

#[test]
fn a_token_is_valid_from_nbf_to_exp_with_leeway() {
    let key = Key::new("k");
    let keys = KeySet::parse(jwks(&[&key]).as_bytes()).unwrap();
    let mut claims = claims("s", "viewer");
    (claims["nbf"], claims["exp"]) = (json!(NOW_S), json!(NOW_S as f64 + 60.5));
    let token = key.token(&claims);
    for (moment, wanted) in [
        (-LEEWAY_S - 0.001, Some(JwtError::NotYetValid)),
        (-LEEWAY_S, None),
        (60.5 + LEEWAY_S - 0.001, None),
        (60.5 + LEEWAY_S, Some(JwtError::Expired)),
    ] {
        let result = verify(&token, &keys, &expected(), at(moment));
        assert_eq!(result.err(), wanted, "{moment}");
    }
}

#[test]
fn role_and_asset_are_read_from_the_configured_claims() {
    let key = Key::new("k");
    let keys = KeySet::parse(jwks(&[&key]).as_bytes()).unwrap();
    let mut claims = claims("s", "admin");
    claims["realm_access"] = json!({ "roles": ["offline", "viewer", "device", "operator"] });
    claims["https://offbd.example/role"] = json!("viewer");
    claims["rig"] = json!({ "name": "a" });
    claims["device"] = json!(["device"]);
    let token = key.token(&claims);
    for (claim, wanted, asset) in [
        ("/realm_access/roles", Ok(Role::Operator), None),
        ("https://offbd.example/role", Ok(Role::Viewer), None),
        ("/realm_access/roles/2", Ok(Role::Device), Some("a")),
        ("device", Ok(Role::Device), Some("a")),
        ("realm_access", Err(JwtError::Role), None),
        ("/realm_access/none", Err(JwtError::Role), None),
    ] {
        let (role_claim, asset_claim) = (claim.to_owned(), "/rig/name".to_owned());
        let expected = ExpectedClaims { role_claim, asset_claim, ..expected() };
        let result = verify(&token, &keys, &expected, at(0.0));
        assert_eq!(
            result.as_ref().map(|verified| verified.role).map_err(|e| *e),
            wanted,
            "{claim}"
        );
        assert_eq!(result.ok().and_then(|verified| verified.asset).as_deref(), asset, "{claim}");
    }
}

#[test]
fn only_the_algorithm_of_the_key_is_accepted() {
    let (key, other) = (Key::new("k"), Key::new("k"));
    let document = jwks(&[&key]);
    let keys = KeySet::parse(document.as_bytes()).unwrap();
    let claims = claims("s", "admin");
    let refused = |token: &str| verify(token, &keys, &expected(), at(0.0)).unwrap_err();
    let header = |algorithm: &str| json!({ "alg": algorithm, "kid": "k" });
    let ours = |message: &[u8]| key.sign(message);

    // Not signed at all.
    for none in ["none", "None", ""] {
        assert_eq!(refused(&token(&header(none), &claims, |_| Vec::new())), JwtError::Malformed);
    }
    assert_eq!(refused(&token(&header("EdDSA"), &claims, |_| Vec::new())), JwtError::Signature);
    // Signed with something public: the public key as the secret of an HMAC.
    let x = key.public()["x"].as_str().unwrap().to_owned();
    for secret in [x.as_bytes(), document.as_bytes(), key.public().to_string().as_bytes()] {
        let secret = hmac::Key::new(hmac::HMAC_SHA256, secret);
        let forged = |message: &[u8]| hmac::sign(&secret, message).as_ref().to_vec();
        assert_eq!(refused(&token(&header("HS256"), &claims, forged)), JwtError::Algorithm);
    }
    // Signed with another key, or with a wrong `alg`.
    assert_eq!(refused(&other.token(&claims)), JwtError::Signature);
    for algorithm in ["RS256", "ES256", "PS512"] {
        assert_eq!(refused(&token(&header(algorithm), &claims, ours)), JwtError::Algorithm);
    }
    let own = json!({ "alg": "EdDSA", "kid": "k", "jwk": other.public() });
    assert_eq!(refused(&token(&own, &claims, |m| other.sign(m))), JwtError::Signature);
    let unknown = json!({ "alg": "EdDSA", "kid": "l" });
    assert_eq!(refused(&token(&unknown, &claims, ours)), JwtError::UnknownKey);
    let critical = json!({ "alg": "EdDSA", "kid": "k", "crit": ["b64"], "b64": false });
    assert_eq!(refused(&token(&critical, &claims, ours)), JwtError::Malformed);
    // With one key, the token need not name it.
    let nameless = token(&json!({ "alg": "EdDSA" }), &claims, ours);
    verify(&nameless, &keys, &expected(), at(0.0)).unwrap();
    for broken in ["", ".", "..", "a.b", "a.b.c.d", "....", &"x".repeat(100_000)] {
        assert_eq!(refused(broken), JwtError::Malformed);
    }
    let whole = key.token(&claims);
    for end in 0..whole.len() {
        verify(&whole[..end], &keys, &expected(), at(0.0)).unwrap_err();
    }
}

#[test]
fn a_key_is_used_only_for_its_published_purpose() {
    let key = Key::new("k");
    let error = |change: fn(&mut Value)| {
        let mut published = key.public();
        change(&mut published);
        let document = json!({ "keys": [published, Key::new("other").public()] }).to_string();
        let keys = KeySet::parse(document.as_bytes()).unwrap();
        verify(&key.token(&claims("s", "viewer")), &keys, &expected(), at(0.0)).err()
    };
    assert_eq!(error(|key| key["alg"] = json!("EdDSA")), None);
    assert_eq!(error(|key| key["key_ops"] = json!(["verify"])), None);
    for change in [
        |key: &mut Value| key["use"] = json!("enc"),
        |key: &mut Value| key["key_ops"] = json!(["encrypt"]),
        |key: &mut Value| key["alg"] = json!("ES256"),
        |key: &mut Value| key["alg"] = json!("HS256"),
        |key: &mut Value| key["crv"] = json!("X25519"),
    ] {
        assert_eq!(error(change), Some(JwtError::UnknownKey));
    }
    // A symmetric key is not accepted.
    let secret = json!({ "kty": "oct", "kid": "k", "alg": "HS256", "k": base64("secret") });
    let why = |document: Value| KeySet::parse(document.to_string().as_bytes()).err().unwrap();
    let error_text = why(json!({ "keys": [secret] })).to_string();
    assert!(error_text.contains("no key verifies"), "{error_text}");
    assert!(why(json!({ "keys": 7 })).to_string().contains("not a JSON Web Key Set"));
}

/// Starts a service that accepts the tokens of a provider with its keys at `jwks`, and
/// registers the asset `a`.
async fn service(
    jwks: impl ToString,
    change: impl FnOnce(&mut offbd::config::Config),
) -> ServiceFixture {
    let fixture = ServiceFixture::start_with(|config| {
        config.auth = Some(Auth::Required);
        config.jwt = Some(provider::config(jwks));
        change(config);
    })
    .await;
    let name = "root".to_owned();
    let root = NewToken { name, role: Role::Admin, asset: None, expires_at: None };
    let secret =
        tokens::create_token(&crate::support::config(fixture.data.path()), root).await.unwrap();
    fixture.client.with(&secret).asset("a").await;
    fixture
}

/// Writes the keys to a file and returns its directory and path.
fn key_file(keys: &[&Key]) -> (tempfile::TempDir, String) {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("jwks.json");
    std::fs::write(&path, jwks(keys)).unwrap();
    (directory, path.to_str().unwrap().to_owned())
}

async fn status(client: &Client, token: &str) -> u16 {
    client.with(token).get("assets").await.status.as_u16()
}

#[tokio::test(flavor = "multi_thread")]
async fn actions_are_recorded_with_the_subject() {
    let key = Key::new("k");
    let (_directory, path) = key_file(&[&key]);
    let fixture = service(path, |_| {}).await;
    let admin = fixture.client.with(&key.token(&claims("olga@id.example", "admin")));
    let view = admin.get("login").await.expect(200);
    assert_eq!((&view["name"], &view["role"]), (&json!("olga@id.example"), &json!("admin")));
    admin.asset("b").await;
    admin.delete("assets/b/faults/x_servo?by=somebody").await.expect(204);
    let history = admin.get("assets/b/faults/x_servo/history").await.expect(200);
    assert_eq!(history["items"][0]["by"], "olga@id.example");
    let audit = admin.get("audit?limit=1").await.expect(200);
    let entry = &audit["items"][0];
    assert_eq!(
        (&entry["actor"], &entry["act"]),
        (&json!("olga@id.example"), &json!("clear_fault"))
    );
    assert_eq!(entry["token_id"], format!("{} olga@id.example", provider::ISSUER));
    // A JSON Web Token cannot be used to log in.
    let login = json!({ "token": admin.token });
    fixture.client.post("login", &login).await.problem(401);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_rejected_token_gets_a_challenge_without_details() {
    let key = Key::new("k");
    let (_directory, path) = key_file(&[&key]);
    let fixture = service(path, |_| {}).await;
    let mut past = claims("s", "admin");
    past["exp"] = json!(1_700_000_000);
    let answer = fixture.client.with(&key.token(&past)).get("assets").await;
    answer.problem(401);
    let challenge = answer.headers[WWW_AUTHENTICATE].to_str().unwrap();
    assert_eq!(challenge, "Bearer realm=\"offbd\", error=\"invalid_token\"");
    let viewer = fixture.client.with(&key.token(&claims("s", "viewer")));
    viewer.delete("assets/a").await.problem(403);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_rate_limit_applies_to_a_subject_not_to_a_token() {
    let key = Key::new("k");
    let (_directory, path) = key_file(&[&key]);
    let fixture = service(path, |config| config.rates.token_per_s = 1).await;
    let tokens: Vec<String> = (0..40)
        .map(|i| {
            let mut claims = claims("s", "viewer");
            claims["jti"] = json!(i);
            key.token(&claims)
        })
        .collect();
    let mut refused = 0;
    for token in &tokens {
        refused += usize::from(status(&fixture.client, token).await == 429);
    }
    assert!(refused > 0, "a burst of ten, then one per second");
    assert_eq!(status(&fixture.client, &key.token(&claims("t", "viewer"))).await, 200);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_ends_when_its_token_expires() {
    let key = Key::new("k");
    let (_directory, path) = key_file(&[&key]);
    let fixture = service(path, |_| {}).await;
    // Expires in four seconds, including the leeway.
    let end = offbd::service::Clock::System.now() as f64 / 1e6 + 4.0;
    let mut brief = provider::device("a");
    brief["exp"] = json!(end - LEEWAY_S);
    let device = fixture.client.with(&key.token(&brief));
    let events = device.request(Method::GET, "events?asset=a").send().await.unwrap();
    let mut events = Events::new(events);
    assert_eq!(events.any().await.0, "begin");
    assert!(events.ended().await);
    assert!(offbd::service::Clock::System.now() as f64 / 1e6 >= end, "not before it expires");
    device.get("assets/a").await.problem(401);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_changed_key_file_is_reloaded_and_old_keys_expire() {
    let (old, new) = (Key::new("old"), Key::new("new"));
    let (_directory, path) = key_file(&[&old]);
    let fixture = service(&path, |_| {}).await;
    let of_old = fixture.client.with(&old.token(&provider::device("a")));
    let events = of_old.request(Method::GET, "events?asset=a").send().await.unwrap();
    let mut events = Events::new(events);
    assert_eq!(events.any().await.0, "begin");
    std::fs::write(&path, jwks(&[&new])).unwrap();
    assert_eq!(status(&fixture.client, &new.token(&claims("s", "viewer"))).await, 200);
    // Tokens signed with the old key are accepted from a cache for a moment longer.
    eventually(|| async { (of_old.get("assets/a").await.status == 401).then_some(()) }).await;
    assert!(events.ended().await);
}

#[tokio::test(flavor = "multi_thread")]
async fn keys_are_fetched_rarely_and_kept_while_the_provider_is_unavailable() {
    let (old, new) = (Key::new("old"), Key::new("new"));
    let published = Published::new(jwks(&[&old]));
    let port = published.serve(None).await;
    let fixture = service(format!("http://127.0.0.1:{port}/jwks"), |_| {}).await;
    assert_eq!(published.n_requests(), 1);
    let of_old = || old.token(&claims("s", "viewer"));
    assert_eq!(status(&fixture.client, &of_old()).await, 200);
    assert_eq!(published.n_requests(), 1, "the keys are cached");
    // The provider is unavailable: cached keys are used, also for new tokens.
    published.set(String::new());
    assert_eq!(status(&fixture.client, &new.token(&claims("s", "viewer"))).await, 401);
    let mut another = claims("t", "viewer");
    another["jti"] = json!("another");
    assert_eq!(status(&fixture.client, &old.token(&another)).await, 200);
    // Many tokens with unknown keys do not cause many requests.
    for i in 0..100 {
        let mut claims = claims("s", "admin");
        claims["jti"] = json!(i);
        assert_eq!(status(&fixture.client, &new.token(&claims)).await, 401);
    }
    assert!(published.n_requests() < 20, "{}", published.n_requests());
    assert!(published.n_requests() >= 2);
}

#[tokio::test(flavor = "multi_thread")]
async fn keys_are_fetched_later_if_the_provider_was_unavailable_at_start() {
    let key = Key::new("k");
    let published = Published::default();
    let port = published.serve(None).await;
    let fixture = service(format!("http://localhost:{port}/jwks"), |_| {}).await;
    assert_eq!(published.n_requests(), 1);
    published.set(jwks(&[&key]));
    assert_eq!(status(&fixture.client, &key.token(&claims("s", "viewer"))).await, 200);
    assert_eq!(published.n_requests(), 2);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_invalid_key_file_is_reported_at_start() {
    let (directory, path) = key_file(&[]);
    let missing = directory.path().join("none").to_str().unwrap().to_owned();
    let long = directory.path().join("long").to_str().unwrap().to_owned();
    std::fs::write(&long, " ".repeat(300_000)).unwrap();
    for (jwks, wanted) in [(path, "no key verifies"), (missing, "none"), (long, "bytes")] {
        let data = tempfile::tempdir().unwrap();
        let mut config = crate::support::config(data.path());
        (config.auth, config.jwt) = (Some(Auth::Required), Some(provider::config(jwks)));
        let error = format!("{:#}", offbd::server::start(config).await.err().unwrap());
        assert!(error.contains("`jwt.jwks`") && error.contains(wanted), "{error}");
    }
}
