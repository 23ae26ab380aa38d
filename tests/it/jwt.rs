//! JSON Web Tokens of an identity provider: which are taken, and for whom.

use crate::support::provider::{self, Key, Published, base64, claims, jwks, token};
use crate::support::{Bench, Client, Events, eventually};
use offbd::config::Auth;
use offbd::server::tokens;
use offbd::service::access::jwt::{Expected, KeySet, LEEWAY_S, MAX_SUBJECT, Refusal, verify};
use offbd::service::access::{NewToken, Role};
use reqwest::Method;
use reqwest::header::WWW_AUTHENTICATE;
use ring::hmac;
use serde_json::{Value, json};

const NOW_S: i64 = 1_800_000_000;

fn expected() -> Expected {
    provider::config("").expected()
}

fn at(seconds: f64) -> i64 {
    ((NOW_S as f64 + seconds) * 1e6) as i64
}

/// What PyJWT made, see `make.py` beside it.
fn vectors() -> Value {
    serde_json::from_str(include_str!("jwt/vectors.json")).unwrap()
}

#[test]
fn validate_tokens_of_another_implementation() {
    let vectors = vectors();
    let keys = KeySet::parse(vectors["jwks"].to_string().as_bytes()).unwrap();
    assert_eq!(keys.n_keys(), 4, "those that verify");
    let tokens = vectors["tokens"].as_object().unwrap();
    assert_eq!(tokens.len(), 9);
    for (algorithm, token) in tokens {
        let token = token.as_str().unwrap();
        let told = verify(token, &keys, &expected(), at(0.0)).unwrap();
        let said = (told.subject.as_str(), told.role, told.asset, told.expires_at);
        let end = provider::END * 1_000_000 + (LEEWAY_S * 1e6) as i64;
        assert_eq!(said, ("olga", Role::Operator, None, end), "{algorithm}");

        let parts: Vec<&str> = token.split('.').collect();
        let mut risen = vectors["claims"].clone();
        risen["offbd_role"] = json!("admin");
        let changed = [parts[0], &base64(risen.to_string()), parts[2]].join(".");
        assert_eq!(verify(&changed, &keys, &expected(), at(0.0)), Err(Refusal::Signature));
        let other = if algorithm == "RS256" { "PS256" } else { "RS256" };
        let other: Vec<&str> = tokens[other].as_str().unwrap().split('.').collect();
        let moved = [parts[0], parts[1], other[2]].join(".");
        assert_eq!(verify(&moved, &keys, &expected(), at(0.0)), Err(Refusal::Signature));
        // Of several keys one must be named.
        let header = base64(json!({ "alg": algorithm }).to_string());
        let nameless = [header.as_str(), parts[1], parts[2]].join(".");
        assert_eq!(verify(&nameless, &keys, &expected(), at(0.0)), Err(Refusal::NamesNoKey));
    }
}

/// A token of `claims`, changed, as it is answered.
fn told(change: impl FnOnce(&mut Value)) -> Result<Role, Refusal> {
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
fn claims_must_be_those_expected() {
    let with = |name: &str, value: Value| told(|claims| claims[name] = value);
    let without = |name: &str| told(|claims| drop(claims.as_object_mut().unwrap().remove(name)));
    assert_eq!(told(|_| {}), Ok(Role::Viewer));
    for (name, value, wanted) in [
        ("iss", json!("https://id.example/realm/"), Refusal::Issuer),
        ("iss", json!([provider::ISSUER, "https://evil.example"]), Refusal::Issuer),
        ("iss", json!(7), Refusal::Claim("iss")),
        ("aud", json!("offbd2"), Refusal::Audience),
        ("aud", json!(["account", "offbd2"]), Refusal::Audience),
        ("aud", json!([]), Refusal::Audience),
        ("aud", json!({ "offbd": true }), Refusal::Claim("aud")),
        ("exp", json!("4102444800"), Refusal::Claim("exp")),
        ("exp", json!(0), Refusal::Expired),
        ("exp", json!(-1), Refusal::Claim("exp")),
        ("nbf", json!("now"), Refusal::Claim("nbf")),
        ("nbf", Value::Null, Refusal::Claim("nbf")),
        ("sub", json!(""), Refusal::Claim("sub")),
        ("sub", json!("a\nb"), Refusal::Claim("sub")),
        ("sub", json!("s".repeat(MAX_SUBJECT + 1)), Refusal::Claim("sub")),
        ("offbd_role", json!("god"), Refusal::Role),
        ("offbd_role", json!("Admin"), Refusal::Role),
        ("offbd_role", json!(["god", 7]), Refusal::Role),
        ("offbd_role", json!({ "admin": true }), Refusal::Role),
        ("offbd_role", json!("device"), Refusal::Asset),
    ] {
        assert_eq!(with(name, value.clone()), Err(wanted), "{name} {value}");
    }
    for name in ["iss", "aud", "exp", "sub"] {
        assert!(matches!(without(name), Err(Refusal::Claim(missing)) if missing == name), "{name}");
    }
    assert_eq!(without("offbd_role"), Err(Refusal::Role));
    assert_eq!(with("sub", json!("s".repeat(MAX_SUBJECT))), Ok(Role::Viewer));
    assert_eq!(with("exp", json!(1e19)), Ok(Role::Viewer));
}

#[test]
fn a_token_is_in_force_from_one_moment_to_another() {
    let key = Key::new("k");
    let keys = KeySet::parse(jwks(&[&key]).as_bytes()).unwrap();
    let mut claims = claims("s", "viewer");
    (claims["nbf"], claims["exp"]) = (json!(NOW_S), json!(NOW_S as f64 + 60.5));
    let token = key.token(&claims);
    for (moment, wanted) in [
        (-LEEWAY_S - 0.001, Some(Refusal::Early)),
        (-LEEWAY_S, None),
        (60.5 + LEEWAY_S - 0.001, None),
        (60.5 + LEEWAY_S, Some(Refusal::Expired)),
    ] {
        let told = verify(&token, &keys, &expected(), at(moment));
        assert_eq!(told.err(), wanted, "{moment}");
    }
}

#[test]
fn roles_are_where_the_configuration_says() {
    let key = Key::new("k");
    let keys = KeySet::parse(jwks(&[&key]).as_bytes()).unwrap();
    let mut claims = claims("s", "admin");
    claims["realm_access"] = json!({ "roles": ["offline", "viewer", "device", "operator"] });
    claims["https://offbd.example/role"] = json!("viewer");
    claims["rig"] = json!({ "name": "a" });
    claims["device"] = json!(["device"]);
    let token = key.token(&claims);
    for (place, wanted, asset) in [
        ("/realm_access/roles", Ok(Role::Operator), None),
        ("https://offbd.example/role", Ok(Role::Viewer), None),
        ("/realm_access/roles/2", Ok(Role::Device), Some("a")),
        ("device", Ok(Role::Device), Some("a")),
        ("realm_access", Err(Refusal::Role), None),
        ("/realm_access/none", Err(Refusal::Role), None),
    ] {
        let (role_claim, asset_claim) = (place.to_owned(), "/rig/name".to_owned());
        let expected = Expected { role_claim, asset_claim, ..expected() };
        let told = verify(&token, &keys, &expected, at(0.0));
        assert_eq!(told.as_ref().map(|told| told.role).map_err(|e| *e), wanted, "{place}");
        assert_eq!(told.ok().and_then(|told| told.asset).as_deref(), asset, "{place}");
    }
}

#[test]
fn the_key_says_which_algorithm_may_have_signed() {
    let (key, other) = (Key::new("k"), Key::new("k"));
    let document = jwks(&[&key]);
    let keys = KeySet::parse(document.as_bytes()).unwrap();
    let claims = claims("s", "admin");
    let refused = |token: &str| verify(token, &keys, &expected(), at(0.0)).unwrap_err();
    let header = |algorithm: &str| json!({ "alg": algorithm, "kid": "k" });
    let ours = |message: &[u8]| key.sign(message);

    // Not signed at all.
    for none in ["none", "None", ""] {
        assert_eq!(refused(&token(&header(none), &claims, |_| Vec::new())), Refusal::Form);
    }
    assert_eq!(refused(&token(&header("EdDSA"), &claims, |_| Vec::new())), Refusal::Signature);
    // Signed by what everybody knows: the public key as the secret of an HMAC.
    let x = key.public()["x"].as_str().unwrap().to_owned();
    for secret in [x.as_bytes(), document.as_bytes(), key.public().to_string().as_bytes()] {
        let secret = hmac::Key::new(hmac::HMAC_SHA256, secret);
        let forged = |message: &[u8]| hmac::sign(&secret, message).as_ref().to_vec();
        assert_eq!(refused(&token(&header("HS256"), &claims, forged)), Refusal::Algorithm);
    }
    // Signed by another, or said to be so in another way.
    assert_eq!(refused(&other.token(&claims)), Refusal::Signature);
    for algorithm in ["RS256", "ES256", "PS512"] {
        assert_eq!(refused(&token(&header(algorithm), &claims, ours)), Refusal::Algorithm);
    }
    let own = json!({ "alg": "EdDSA", "kid": "k", "jwk": other.public() });
    assert_eq!(refused(&token(&own, &claims, |m| other.sign(m))), Refusal::Signature);
    let unknown = json!({ "alg": "EdDSA", "kid": "l" });
    assert_eq!(refused(&token(&unknown, &claims, ours)), Refusal::UnknownKey);
    let critical = json!({ "alg": "EdDSA", "kid": "k", "crit": ["b64"], "b64": false });
    assert_eq!(refused(&token(&critical, &claims, ours)), Refusal::Form);
    // The only key need not be named.
    let nameless = token(&json!({ "alg": "EdDSA" }), &claims, ours);
    verify(&nameless, &keys, &expected(), at(0.0)).unwrap();
    for broken in ["", ".", "..", "a.b", "a.b.c.d", "....", &"x".repeat(100_000)] {
        assert_eq!(refused(broken), Refusal::Form);
    }
    let whole = key.token(&claims);
    for end in 0..whole.len() {
        verify(&whole[..end], &keys, &expected(), at(0.0)).unwrap_err();
    }
}

#[test]
fn a_key_is_used_for_what_it_was_published_for() {
    let key = Key::new("k");
    let told = |change: fn(&mut Value)| {
        let mut published = key.public();
        change(&mut published);
        let document = json!({ "keys": [published, Key::new("other").public()] }).to_string();
        let keys = KeySet::parse(document.as_bytes()).unwrap();
        verify(&key.token(&claims("s", "viewer")), &keys, &expected(), at(0.0)).err()
    };
    assert_eq!(told(|key| key["alg"] = json!("EdDSA")), None);
    assert_eq!(told(|key| key["key_ops"] = json!(["verify"])), None);
    for change in [
        |key: &mut Value| key["use"] = json!("enc"),
        |key: &mut Value| key["key_ops"] = json!(["encrypt"]),
        |key: &mut Value| key["alg"] = json!("ES256"),
        |key: &mut Value| key["alg"] = json!("HS256"),
        |key: &mut Value| key["crv"] = json!("X25519"),
    ] {
        assert_eq!(told(change), Some(Refusal::UnknownKey));
    }
    // A secret that both sides know is no key that verifies.
    let secret = json!({ "kty": "oct", "kid": "k", "alg": "HS256", "k": base64("secret") });
    let why = |document: Value| KeySet::parse(document.to_string().as_bytes()).err().unwrap();
    let error = why(json!({ "keys": [secret] })).to_string();
    assert!(error.contains("has no key"), "{error}");
    assert!(why(json!({ "keys": 7 })).to_string().contains("no JSON Web Key Set"));
}

/// A server that takes the tokens of a provider whose keys are at `jwks`, with
/// the asset `a`.
async fn gate(jwks: impl ToString, change: impl FnOnce(&mut offbd::config::Config)) -> Bench {
    let bench = Bench::start_with(|config| {
        config.auth = Some(Auth::Required);
        config.jwt = Some(provider::config(jwks));
        change(config);
    })
    .await;
    let name = "root".to_owned();
    let root = NewToken { name, role: Role::Admin, asset: None, expires_at: None };
    let secret =
        tokens::create_token(&crate::support::config(bench.data.path()), root).await.unwrap();
    bench.client.with(&secret).asset("a").await;
    bench
}

/// A file with the keys, and its directory.
fn file(keys: &[&Key]) -> (tempfile::TempDir, String) {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("jwks.json");
    std::fs::write(&path, jwks(keys)).unwrap();
    (directory, path.to_str().unwrap().to_owned())
}

async fn status(client: &Client, token: &str) -> u16 {
    client.with(token).get("assets").await.status.as_u16()
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_done_bears_the_subject() {
    let key = Key::new("k");
    let (_directory, path) = file(&[&key]);
    let bench = gate(path, |_| {}).await;
    let admin = bench.client.with(&key.token(&claims("olga@id.example", "admin")));
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
    // A token in the store is not looked for, and no login is stored.
    let shown = json!({ "token": admin.token });
    bench.client.post("login", &shown).await.problem(401);
}

#[tokio::test(flavor = "multi_thread")]
async fn who_is_refused_is_told_so_and_no_more() {
    let key = Key::new("k");
    let (_directory, path) = file(&[&key]);
    let bench = gate(path, |_| {}).await;
    let mut past = claims("s", "admin");
    past["exp"] = json!(1_700_000_000);
    let answer = bench.client.with(&key.token(&past)).get("assets").await;
    answer.problem(401);
    let challenge = answer.headers[WWW_AUTHENTICATE].to_str().unwrap();
    assert_eq!(challenge, "Bearer realm=\"offbd\", error=\"invalid_token\"");
    let viewer = bench.client.with(&key.token(&claims("s", "viewer")));
    viewer.delete("assets/a").await.problem(403);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_subject_has_one_rate_whatever_its_tokens() {
    let key = Key::new("k");
    let (_directory, path) = file(&[&key]);
    let bench = gate(path, |config| config.rates.token_per_s = 1).await;
    let tokens: Vec<String> = (0..40)
        .map(|i| {
            let mut claims = claims("s", "viewer");
            claims["jti"] = json!(i);
            key.token(&claims)
        })
        .collect();
    let mut refused = 0;
    for token in &tokens {
        refused += usize::from(status(&bench.client, token).await == 429);
    }
    assert!(refused > 0, "ten at once, then one a second");
    assert_eq!(status(&bench.client, &key.token(&claims("t", "viewer"))).await, 200);
}

#[tokio::test(flavor = "multi_thread")]
async fn streams_end_with_their_token() {
    let key = Key::new("k");
    let (_directory, path) = file(&[&key]);
    let bench = gate(path, |_| {}).await;
    // In a moment from now, the leeway included.
    let end = offbd::service::Clock.now() as f64 / 1e6 + 4.0;
    let mut brief = provider::device("a");
    brief["exp"] = json!(end - LEEWAY_S);
    let device = bench.client.with(&key.token(&brief));
    let events = device.request(Method::GET, "events?asset=a").send().await.unwrap();
    let mut events = Events::new(events);
    assert_eq!(events.any().await.0, "begin");
    assert!(events.ended().await);
    assert!(offbd::service::Clock.now() as f64 / 1e6 >= end, "not before its time");
    device.get("assets/a").await.problem(401);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_new_key_in_the_file_is_found_and_an_old_one_gone() {
    let (old, new) = (Key::new("old"), Key::new("new"));
    let (_directory, path) = file(&[&old]);
    let bench = gate(&path, |_| {}).await;
    let of_old = bench.client.with(&old.token(&provider::device("a")));
    let events = of_old.request(Method::GET, "events?asset=a").send().await.unwrap();
    let mut events = Events::new(events);
    assert_eq!(events.any().await.0, "begin");
    std::fs::write(&path, jwks(&[&new])).unwrap();
    assert_eq!(status(&bench.client, &new.token(&claims("s", "viewer"))).await, 200);
    // What the old key signed was known for a moment longer.
    eventually(|| async { (of_old.get("assets/a").await.status == 401).then_some(()) }).await;
    assert!(events.ended().await);
}

#[tokio::test(flavor = "multi_thread")]
async fn keys_are_fetched_rarely_and_kept_while_nobody_answers() {
    let (old, new) = (Key::new("old"), Key::new("new"));
    let published = Published::new(jwks(&[&old]));
    let port = published.serve(None).await;
    let bench = gate(format!("http://127.0.0.1:{port}/jwks"), |_| {}).await;
    assert_eq!(published.n_asked(), 1);
    let of_old = || old.token(&claims("s", "viewer"));
    assert_eq!(status(&bench.client, &of_old()).await, 200);
    assert_eq!(published.n_asked(), 1, "they are there");
    // Nobody answers: what was there goes on, also for tokens not seen before.
    published.is(String::new());
    assert_eq!(status(&bench.client, &new.token(&claims("s", "viewer"))).await, 401);
    let mut another = claims("t", "viewer");
    another["jti"] = json!("another");
    assert_eq!(status(&bench.client, &old.token(&another)).await, 200);
    // However many tokens name keys that are not there.
    for i in 0..100 {
        let mut claims = claims("s", "admin");
        claims["jti"] = json!(i);
        assert_eq!(status(&bench.client, &new.token(&claims)).await, 401);
    }
    assert!(published.n_asked() < 20, "{}", published.n_asked());
    assert!(published.n_asked() >= 2);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_provider_that_comes_later_is_found() {
    let key = Key::new("k");
    let published = Published::default();
    let port = published.serve(None).await;
    let bench = gate(format!("http://localhost:{port}/jwks"), |_| {}).await;
    assert_eq!(published.n_asked(), 1);
    published.is(jwks(&[&key]));
    assert_eq!(status(&bench.client, &key.token(&claims("s", "viewer"))).await, 200);
    assert_eq!(published.n_asked(), 2);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_file_that_cannot_be_is_named_at_the_start() {
    let (directory, path) = file(&[]);
    let missing = directory.path().join("none").to_str().unwrap().to_owned();
    let long = directory.path().join("long").to_str().unwrap().to_owned();
    std::fs::write(&long, " ".repeat(300_000)).unwrap();
    for (jwks, wanted) in [(path, "has no key"), (missing, "none"), (long, "bytes")] {
        let data = tempfile::tempdir().unwrap();
        let mut config = crate::support::config(data.path());
        (config.auth, config.jwt) = (Some(Auth::Required), Some(provider::config(jwks)));
        let error = format!("{:#}", offbd::server::start(config).await.err().unwrap());
        assert!(error.contains("`jwt.jwks`") && error.contains(wanted), "{error}");
    }
}
