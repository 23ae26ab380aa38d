//! Who is let in to what: the stated rights against a server that asks for
//! tokens.

use std::collections::BTreeMap;

use crate::support::provider::{self, Key, Published};
use crate::support::{Answer, Bench, Client, Events, batch, config, eventually, rig};
use futures_util::{SinkExt, StreamExt};
use offbd::config::{Auth, Config};
use offbd::server::tokens;
use offbd::service::access::{NewToken, Role};
use reqwest::Method;
use reqwest::header::{COOKIE, HOST, ORIGIN, SET_COOKIE, WWW_AUTHENTICATE};
use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;

/// A server that asks for tokens, with the assets `a` and `b` and a token for
/// each kind of caller.
struct Gate {
    bench: Bench,
    config: Config,
    admin: Client,
}

impl Gate {
    async fn new() -> Self {
        Self::with(|_| {}).await
    }

    async fn with(change: impl FnOnce(&mut Config)) -> Self {
        let bench = Bench::start_with(|config| {
            config.auth = Some(Auth::Required);
            change(config);
        })
        .await;
        let config = config(bench.data.path());
        let secret = token(&config, "root", Role::Admin, None).await;
        let admin = bench.client.with(&secret);
        for asset in ["a", "b"] {
            admin.asset(asset).await;
        }
        Self { bench, config, admin }
    }

    /// A client with a new token.
    async fn caller(&self, name: &str, role: Role, asset: Option<&str>) -> Client {
        self.bench.client.with(&token(&self.config, name, role, asset).await)
    }

    async fn device(&self, asset: &str) -> Client {
        self.caller(&format!("{asset}'s device"), Role::Device, Some(asset)).await
    }
}

/// Makes a token in the store itself, as the command line does.
async fn token(config: &Config, name: &str, role: Role, asset: Option<&str>) -> String {
    let (name, asset) = (name.to_owned(), asset.map(str::to_owned));
    let wanted = NewToken { name, role, asset, expires_at: None };
    tokens::create_token(config, wanted).await.unwrap()
}

/// The policy: for each right who is let in, of nobody, another asset's device,
/// the asset's device, a viewer, an operator and an admin.
const POLICY: [(&str, [bool; 6]); 8] = [
    ("open", [true, true, true, true, true, true]),
    ("known", [false, true, true, true, true, true]),
    ("read-asset", [false, false, true, true, true, true]),
    ("read", [false, false, false, true, true, true]),
    ("feed", [false, false, true, false, false, true]),
    ("conduct", [false, false, true, false, true, true]),
    ("operate", [false, false, false, false, true, true]),
    ("administer", [false, false, false, false, false, true]),
];

/// Every operation of the interface's description with the right that it states.
fn operations() -> Vec<(Method, String, String)> {
    let document = serde_json::to_value(offbd::http::openapi()).unwrap();
    let mut operations = Vec::new();
    for (path, item) in document["paths"].as_object().unwrap() {
        for (method, operation) in item.as_object().unwrap() {
            let method: Method = method.to_uppercase().parse().unwrap();
            let right = operation["x-right"].as_str();
            let right = right.unwrap_or_else(|| panic!("{method} {path} states no right"));
            let asks = !operation["security"].is_null();
            assert_eq!(asks, right != "open", "{method} {path} says whether a token is needed");
            operations.push((method, path.clone(), right.to_owned()));
        }
    }
    // What deletes comes last, the asset with its devices last of all, so that
    // the others find what they ask for.
    operations.sort_by_key(|(method, path, _)| {
        (method == Method::DELETE, path.ends_with("/assets/{asset}"), path.clone())
    });
    operations
}

/// The operations in a document for people, one line each.
#[test]
fn regress_every_operation_states_who_is_let_in() {
    let mut lines: Vec<_> = operations()
        .into_iter()
        .map(|(method, path, right)| format!("{right:<10} {method} {path}"))
        .collect();
    lines.sort();
    // The name alone: these tests are in two binaries.
    insta::with_settings!({ prepend_module_to_snapshot => false }, {
        insta::assert_snapshot!(lines.join("\n"));
    });
}

/// Asks for `path` with `method`, whatever the answer; a stream is not read.
async fn status(client: &Client, method: &Method, path: &str) -> u16 {
    client.request(method.clone(), path).send().await.unwrap().status().as_u16()
}

#[tokio::test(flavor = "multi_thread")]
async fn validate_the_matrix_of_callers_and_operations() {
    let (key, keys) = (Key::new("k"), tempfile::NamedTempFile::new().unwrap());
    std::fs::write(keys.path(), provider::jwks(&[&key])).unwrap();
    let path = keys.path().display();
    let gate = Gate::with(|config| config.jwt = Some(provider::config(path))).await;
    let opened = gate.admin.post("assets/a/sessions", &json!({ "name": "s" })).await.expect(201);
    let session = opened["id"].as_str().unwrap();
    let callers = [
        ("nobody", gate.bench.client.clone()),
        ("b's device", gate.device("b").await),
        ("a's device", gate.device("a").await),
        ("viewer", gate.caller("viewer", Role::Viewer, None).await),
        ("operator", gate.caller("operator", Role::Operator, None).await),
        ("admin", gate.admin.clone()),
    ];
    // The same by tokens of an identity provider.
    let signed = |claims: Value| gate.bench.client.with(&key.token(&claims));
    let signed = [
        ("nobody", gate.bench.client.with(&Key::new("k").token(&provider::claims("s", "admin")))),
        ("b's device", signed(provider::device("b"))),
        ("a's device", signed(provider::device("a"))),
        ("viewer", signed(provider::claims("victor", "viewer"))),
        ("operator", signed(provider::claims("olga", "operator"))),
        ("admin", signed(provider::claims("ann", "admin"))),
    ];
    let policy = BTreeMap::from(POLICY);
    let mut asked = 0;
    for (method, path, right) in operations() {
        let id = if path.contains("/sessions/") { session } else { "none" };
        let full = path.replace("{asset}", "a").replace("{id}", id).replace("{code}", "x_servo");
        let full = full.replace("{token}", "none");
        // What concerns one asset says so in its query where its path does not.
        let about = right == "read-asset" && !path.contains('{');
        let full = if about { format!("{full}?asset=a") } else { full };
        let allowed = policy[right.as_str()];
        let asking = callers.iter().zip(allowed).chain(signed.iter().zip(allowed));
        for ((name, client), allowed) in asking {
            let status = status(client, &method, &full).await;
            let expected: &[u16] = match (allowed, *name) {
                (true, _) => &[],
                (false, "nobody") => &[401],
                (false, _) => &[403],
            };
            let as_stated =
                if allowed { !matches!(status, 401 | 403) } else { expected.contains(&status) };
            let login = path.ends_with("/login") && method == Method::POST;
            assert!(as_stated || (login && status == 401), "{name}: {method} {full}: {status}");
            asked += 1;
        }
    }
    assert!(asked >= 12 * 40, "{asked}");
}

#[tokio::test(flavor = "multi_thread")]
async fn pages_and_their_description_are_for_everyone() {
    let gate = Gate::new().await;
    for path in ["/", "/docs/", "/docs/swagger-ui.css", "/openapi.yaml", "/openapi.json"] {
        let answer = gate.bench.client.get(path).await;
        assert_eq!(answer.status, 200, "{path}");
        assert_eq!(answer.headers["x-content-type-options"], "nosniff", "{path}");
        let policy = answer.headers["content-security-policy"].to_str().unwrap();
        assert!(policy.contains("frame-ancestors 'none'"), "{path}: {policy}");
        assert_eq!(answer.headers["referrer-policy"], "no-referrer", "{path}");
    }
    gate.bench.client.get("/none").await.problem(404);
    // A method that no route has is no way around the guard.
    let patch = gate.bench.client.request(Method::PATCH, "assets/a");
    let answer = gate.bench.client.send(patch).await;
    answer.problem(405);
    assert!(answer.headers["allow"].to_str().unwrap().contains("DELETE"));
    gate.bench.client.send(gate.bench.client.request(Method::HEAD, "assets")).await.status.as_u16();
}

#[tokio::test(flavor = "multi_thread")]
async fn who_shows_no_token_is_told_how() {
    let gate = Gate::new().await;
    let answer = gate.bench.client.get("assets").await;
    answer.problem(401);
    assert_eq!(answer.headers[WWW_AUTHENTICATE], "Bearer realm=\"offbd\"");
    let stranger = gate.bench.client.with("offbd_0000");
    let answer = stranger.get("assets").await;
    answer.problem(401);
    let challenge = answer.headers[WWW_AUTHENTICATE].to_str().unwrap();
    assert!(challenge.contains("error=\"invalid_token\""), "{challenge}");
    let basic = gate.bench.client.request(Method::GET, "assets").basic_auth("root", Some("x"));
    gate.bench.client.send(basic).await.problem(401);
    let head = gate.bench.client.request(Method::HEAD, "assets");
    assert_eq!(gate.bench.client.send(head).await.status, 401);
    let viewer = gate.caller("viewer", Role::Viewer, None).await;
    let answer = viewer.delete("assets/a").await;
    answer.problem(403);
    let challenge = answer.headers[WWW_AUTHENTICATE].to_str().unwrap();
    assert!(challenge.contains("error=\"insufficient_scope\""), "{challenge}");
    assert_eq!(viewer.get("assets").await.headers["cache-control"], "no-store");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_device_neither_sees_nor_touches_another_asset() {
    let gate = Gate::new().await;
    let samples = rig(50, usize::MAX);
    gate.admin.telemetry("b", Some("theirs"), &samples).await;
    let theirs = gate.admin.session("b", "theirs").await;
    let theirs = theirs["id"].as_str().unwrap();
    let device = gate.device("a").await;
    device.telemetry("a", Some("mine"), &samples).await;
    let mine = device.session("a", "mine").await;
    device.get(&format!("sessions/{}", mine["id"].as_str().unwrap())).await.expect(200);

    // By path, whether it exists or not.
    for path in ["assets/b", "assets/none", "assets/b/state", "assets/%62/state"] {
        device.get(path).await.problem(403);
    }
    device.post("assets/b/telemetry", &batch(Some("theirs"), &samples)).await.problem(403);
    for id in [theirs, "none", "..", "%2e%2e"] {
        let answer = device.get(&format!("sessions/{id}/faults")).await;
        assert!(matches!(answer.status.as_u16(), 403 | 404), "{id}: {}", answer.text);
        assert!(!answer.text.contains("\"items\""), "{id}: {}", answer.text);
    }
    device.post(&format!("sessions/{theirs}/end"), &Value::Null).await.problem(403);
    // By query, named twice or not at all.
    for query in ["", "?asset=b", "?asset=a&asset=b", "?asset=b&asset=a", "?Asset=a", "?asset="] {
        device.get(&format!("sessions{query}")).await.problem(403);
        device.get(&format!("events{query}")).await.problem(403);
    }
    let own = device.get("sessions?asset=a&state=open").await.expect(200);
    assert!(own["items"].as_array().unwrap().iter().all(|s| s["asset"] == "a"), "{own}");
    // By body: another asset's session by its name is a session of its own.
    let taken = device.post("assets/a/telemetry", &batch(Some("theirs"), &samples)).await;
    assert_ne!(taken.expect(200)["session_id"], theirs);
    device.post("assets", &json!({ "name": "c" })).await.problem(403);
    device.put("assets/a", &json!({ "name": "b" })).await.problem(403);
    // Nothing of it came through.
    let session = gate.admin.get(&format!("sessions/{theirs}")).await.expect(200);
    assert_eq!((&session["state"], &session["samples"]), (&json!("open"), &json!(50)));
}

type Socket =
    tokio_tungstenite::WebSocketStream<tokio_tungstenite::MaybeTlsStream<tokio::net::TcpStream>>;

/// The WebSocket of an asset, or the status with which it is refused.
async fn socket(client: &Client, asset: &str) -> Result<Socket, u16> {
    let url = format!("ws://{}/api/v1/assets/{asset}/stream", client.address);
    let mut request = url.into_client_request().unwrap();
    if let Some(token) = &client.token {
        let value = format!("Bearer {token}").parse().unwrap();
        request.headers_mut().insert("authorization", value);
    }
    match tokio_tungstenite::connect_async(request).await {
        Ok((socket, _)) => Ok(socket),
        Err(tokio_tungstenite::tungstenite::Error::Http(answer)) => Err(answer.status().as_u16()),
        Err(error) => panic!("{error}"),
    }
}

async fn frame(socket: &mut Socket) -> Value {
    loop {
        match tokio::time::timeout(crate::support::DEADLINE, socket.next()).await.unwrap() {
            Some(Ok(Message::Text(text))) => return serde_json::from_str(&text).unwrap(),
            Some(Ok(Message::Close(close))) => {
                return json!({ "close": close.unwrap().reason.as_str() });
            }
            Some(Ok(_)) => {}
            other => panic!("{other:?}"),
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_websocket_takes_batches_from_the_device_alone() {
    let gate = Gate::new().await;
    let (device, viewer) = (gate.device("a").await, gate.caller("v", Role::Viewer, None).await);
    assert_eq!(socket(&gate.bench.client, "a").await.err(), Some(401));
    assert_eq!(socket(&device, "b").await.err(), Some(403));
    let samples = rig(20, usize::MAX);
    let text = batch(None, &samples).to_string();
    let mut sees = socket(&viewer, "a").await.unwrap();
    sees.send(Message::text(text.clone())).await.unwrap();
    let refused = frame(&mut sees).await;
    assert_eq!((&refused["type"], &refused["problem"]["status"]), (&json!("error"), &json!(403)));
    let mut feeds = socket(&device, "a").await.unwrap();
    feeds.send(Message::text(text)).await.unwrap();
    assert_eq!(frame(&mut feeds).await["accepted"], 20);
    let sessions = gate.admin.get("sessions?asset=a").await.expect(200);
    assert_eq!(sessions["items"].as_array().unwrap().len(), 1, "{sessions}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_revoked_token_ends_at_once_with_all_that_it_began() {
    let gate = Gate::new().await;
    let wanted = json!({ "name": "rig", "role": "device", "asset": "a" });
    let made = gate.admin.post("tokens", &wanted).await.expect(201);
    let secret = made["secret"].as_str().unwrap();
    assert!(secret.starts_with("offbd_") && secret.len() == 6 + 64, "{secret}");
    gate.admin.post("tokens", &wanted).await.problem(409);
    let device = gate.bench.client.with(secret);
    device.get("assets/a").await.expect(200);
    let mut socket = socket(&device, "a").await.unwrap();
    let events = device.request(Method::GET, "events?asset=a").send().await.unwrap();
    let mut events = Events::new(events);
    assert_eq!(events.any().await.0, "begin");

    let token = format!("tokens/{}", made["id"].as_str().unwrap());
    gate.admin.delete(&token).await.expect(204);
    device.get("assets/a").await.problem(401);
    let end = frame(&mut socket).await;
    assert_eq!(end["close"], "the token is no longer in force");
    assert!(events.ended().await);
    let shown = gate.admin.get(&token).await.expect(200);
    assert!(shown["revoked_at"].is_string() && shown.get("secret").is_none(), "{shown}");
    // Its name is free again, and the old secret stays worth nothing.
    gate.admin.post("tokens", &wanted).await.expect(201);
    device.get("assets/a").await.problem(401);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_another_process_revokes_is_refused_soon() {
    let gate = Gate::new().await;
    let viewer = gate.caller("v", Role::Viewer, None).await;
    viewer.get("assets").await.expect(200);
    tokens::revoke_token(&gate.config, "v").await.unwrap();
    tokens::revoke_token(&gate.config, "v").await.unwrap_err();
    eventually(|| async {
        let status = viewer.get("assets").await.status.as_u16();
        (status == 401).then_some(())
    })
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn tokens_end_by_themselves_and_with_their_asset() {
    let gate = Gate::new().await;
    let soon = json!({ "name": "past", "role": "viewer", "expires_at": "2020-01-01T00:00:00Z" });
    assert_eq!(gate.admin.post("tokens", &soon).await.problem(422)["pointer"], "/expires_at");
    for (wrong, pointer) in [
        (json!({ "name": "x", "role": "device" }), "/asset"),
        (json!({ "name": "x", "role": "viewer", "asset": "a" }), "/asset"),
        (json!({ "name": "", "role": "viewer" }), "/name"),
        (json!({ "name": "x\n", "role": "viewer" }), "/name"),
        (json!({ "name": "x", "role": "god" }), "/role"),
        (json!({ "name": "x", "role": "viewer", "expires_at": "soon" }), "/expires_at"),
    ] {
        let problem = gate.admin.post("tokens", &wrong).await.problem(422);
        assert_eq!(problem["pointer"], pointer, "{wrong}");
    }
    let none = json!({ "name": "x", "role": "device", "asset": "none" });
    gate.admin.post("tokens", &none).await.problem(404);
    // In a moment from now.
    let end = offbd::service::Clock.now() + 1_500_000;
    let wanted =
        NewToken { name: "brief".into(), role: Role::Viewer, asset: None, expires_at: Some(end) };
    let secret = tokens::create_token(&gate.config, wanted).await.unwrap();
    let brief = gate.bench.client.with(&secret);
    eventually(|| async { (brief.get("assets").await.status == 401).then_some(()) }).await;
    assert!(offbd::service::Clock.now() >= end, "not before its time");
    let device = gate.device("b").await;
    device.get("assets/b").await.expect(200);
    gate.admin.delete("assets/b").await.expect(204);
    gate.admin.asset("b").await;
    device.get("assets/b").await.problem(401);
}

/// The cookie that an answer sets, as a browser sends it.
fn cookie(answer: &Answer) -> String {
    let set = answer.headers[SET_COOKIE].to_str().unwrap();
    for word in ["HttpOnly", "SameSite=Strict", "Path=/"] {
        assert!(set.contains(word), "{set}");
    }
    set.split(';').next().unwrap().to_owned()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_browser_logs_in_acts_as_itself_and_logs_out() {
    let gate = Gate::new().await;
    let client = &gate.bench.client;
    let operator = gate.caller("olga", Role::Operator, None).await;
    let own = format!("http://{}", client.address);
    let log_in = |token: &str, origin: &str| {
        let body = json!({ "token": token });
        let request = client.request(Method::POST, "login").header(ORIGIN, origin.to_owned());
        client.send(request.json(&body))
    };
    log_in("offbd_wrong", &own).await.problem(401);
    let secret = operator.token.clone().unwrap();
    log_in(&secret, "https://evil.example").await.problem(403);
    let answer = log_in(&secret, &own).await;
    assert_eq!(answer.expect(200)["role"], "operator");
    let cookie = cookie(&answer);
    assert!(!cookie.contains(&secret), "the cookie is not the token");
    let ask = |method: Method, path: &str, origin: Option<&str>| {
        let request = client.request(method, path).header(COOKIE, cookie.clone());
        client.send(match origin {
            Some(origin) => request.header(ORIGIN, origin),
            None => request,
        })
    };
    let path = "assets/a/faults/x_servo?by=somebody";
    assert_eq!(ask(Method::GET, "login", None).await.expect(200)["name"], "olga");
    // Another site's page, or none that says where it is from, changes nothing.
    for origin in [Some("https://evil.example"), Some("null"), None] {
        ask(Method::DELETE, path, origin).await.problem(403);
    }
    ask(Method::DELETE, path, Some(&own)).await.expect(204);
    let history = ask(Method::GET, "assets/a/faults/x_servo/history", None).await.expect(200);
    assert_eq!(history["items"][0]["by"], "olga", "{history}");
    ask(Method::DELETE, "assets/a", Some(&own)).await.problem(403);
    ask(Method::DELETE, "login", Some(&own)).await.expect(204);
    ask(Method::GET, "login", None).await.problem(401);
    // The token itself goes on.
    operator.get("assets").await.expect(200);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_login_ends_with_its_token() {
    let gate = Gate::new().await;
    let made =
        gate.admin.post("tokens", &json!({ "name": "v", "role": "viewer" })).await.expect(201);
    let client = &gate.bench.client;
    let answer = client.post("login", &json!({ "token": made["secret"] })).await;
    let cookie = cookie(&answer);
    let ask = || client.send(client.request(Method::GET, "assets").header(COOKIE, cookie.clone()));
    ask().await.expect(200);
    gate.admin.delete(&format!("tokens/{}", made["id"].as_str().unwrap())).await.expect(204);
    ask().await.problem(401);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_audit_log_says_who_did_what_from_where() {
    let gate = Gate::new().await;
    let operator = gate.caller("olga", Role::Operator, None).await;
    let device = gate.device("a").await;
    device.telemetry("a", Some("s"), &rig(20, usize::MAX)).await;
    operator.delete("assets/a/faults/x_servo").await.expect(204);
    operator.put("assets/a", &json!({ "name": "a", "sample_rate_hz": 50 })).await.expect(200);
    operator.delete("assets/a").await.problem(403);
    operator.delete("assets/a/faults/nonsense").await.problem(404);
    gate.bench.client.post("login", &json!({ "token": operator.token })).await.expect(200);
    let made =
        gate.admin.post("tokens", &json!({ "name": "t", "role": "viewer" })).await.expect(201);
    let token = format!("/api/v1/tokens/{}", made["id"].as_str().unwrap());
    gate.admin.delete(&token).await.expect(204);
    gate.admin.delete("assets/b").await.expect(204);
    let mut seen = Vec::new();
    let mut path = "audit?limit=2".to_owned();
    loop {
        let page = gate.admin.get(&path).await.expect(200);
        seen.extend(page["items"].as_array().unwrap().iter().cloned());
        let Some(next) = page["next"].as_str() else { break };
        path = format!("audit?limit=2&cursor={next}");
    }
    let told: Vec<_> = seen
        .iter()
        .rev()
        .map(|entry| {
            let word = |key: &str| entry[key].as_str().unwrap_or("-").to_owned();
            (word("actor"), word("act"), word("target"), word("address"))
        })
        .skip_while(|(actor, ..)| actor == "command line")
        .collect();
    let at = |actor: &str, act: &str, target: &str| {
        (actor.to_owned(), act.to_owned(), target.to_owned(), "127.0.0.1".to_owned())
    };
    let expected = [
        at("root", "create_asset", "/api/v1/assets/a"),
        at("root", "create_asset", "/api/v1/assets/b"),
        at("olga", "clear_fault", "/api/v1/assets/a/faults/x_servo"),
        at("olga", "put_asset", "/api/v1/assets/a"),
        at("olga", "log_in", "/api/v1/login"),
        at("root", "create_token", &token),
        at("root", "revoke_token", &token),
        at("root", "delete_asset", "/api/v1/assets/b"),
    ];
    let told: Vec<_> = told.into_iter().filter(|(actor, ..)| actor != "command line").collect();
    assert_eq!(told, expected);
    let by_hand = seen.iter().find(|entry| entry["actor"] == "command line").unwrap();
    assert_eq!((&by_hand["act"], &by_hand["address"]), (&json!("create_token"), &Value::Null));
}

#[tokio::test(flavor = "multi_thread")]
async fn the_store_has_no_secret() {
    let mut gate = Gate::new().await;
    let viewer = gate.caller("v", Role::Viewer, None).await;
    viewer.get("assets").await.expect(200);
    let answer = gate.bench.client.post("login", &json!({ "token": viewer.token })).await;
    let cookie = cookie(&answer);
    let tokens = gate.admin.get("tokens").await;
    gate.bench.server.take().unwrap().shutdown().await.unwrap();
    let mut all = tokens.text.into_bytes();
    all.extend(crate::support::stored(gate.bench.data.path()).await);
    let has = |secret: &str| all.windows(secret.len()).any(|w| w == secret.as_bytes());
    for secret in [viewer.token.as_deref(), gate.admin.token.as_deref()] {
        let secret = secret.unwrap().trim_start_matches("offbd_");
        assert!(!has(secret), "{secret}");
    }
    assert!(!has(cookie.split_once('=').unwrap().1));
    assert!(has("command line"), "the search finds what is there");
}

#[tokio::test(flavor = "multi_thread")]
async fn who_asks_too_often_is_told_when_to_come_again() {
    let gate = Gate::with(|config| {
        config.rates.token_per_s = 1;
        config.rates.address_per_s = 30;
    })
    .await;
    let viewer = gate.caller("v", Role::Viewer, None).await;
    let other = gate.caller("w", Role::Viewer, None).await;
    let refused = async |client: &Client, most: usize| {
        for _ in 0..most {
            let answer = client.get("assets").await;
            if answer.status == 429 {
                return answer;
            }
        }
        panic!("never refused");
    };
    let answer = refused(&viewer, 100).await;
    answer.problem(429);
    let wait: u64 = answer.headers["retry-after"].to_str().unwrap().parse().unwrap();
    assert!((1..=2).contains(&wait), "{wait}");
    other.get("assets").await.expect(200);
    // Who has no token shares the rate of the address; tokens known do not.
    refused(&gate.bench.client.with("offbd_guess"), 5000).await.problem(429);
    other.get("assets").await.expect(200);
}

#[tokio::test(flavor = "multi_thread")]
async fn another_sites_page_is_let_in_where_it_is_listed() {
    const THERE: &str = "https://there.example";
    let gate = Gate::with(|config| config.origins = vec![THERE.to_owned()]).await;
    let preflight = |origin: &str| {
        let client = &gate.bench.client;
        let request = client.request(Method::OPTIONS, "assets/a/faults/x_servo");
        let request = request.header(ORIGIN, origin.to_owned());
        client.send(request.header("access-control-request-method", "DELETE"))
    };
    let answer = preflight(THERE).await;
    assert_eq!(answer.headers["access-control-allow-origin"], THERE);
    assert!(!answer.headers.contains_key("access-control-allow-credentials"));
    let answer = preflight("https://evil.example").await;
    assert!(!answer.headers.contains_key("access-control-allow-origin"), "{answer:?}");
    let act = |origin: &str| {
        let request = gate.admin.request(Method::DELETE, "assets/a/faults/x_servo");
        gate.admin.send(request.header(ORIGIN, origin.to_owned()))
    };
    act(THERE).await.expect(204);
    act("https://evil.example").await.problem(403);
}

#[tokio::test(flavor = "multi_thread")]
async fn without_tokens_no_page_elsewhere_gets_in() {
    let bench = Bench::start().await;
    let client = &bench.client;
    client.asset("a").await;
    let act = |origin: &str| {
        let request = client.request(Method::POST, "assets/a/sessions");
        client.send(request.header(ORIGIN, origin.to_owned()))
    };
    act("https://evil.example").await.problem(403);
    act(&format!("http://{}", client.address)).await.expect(201);
    // A name that somebody else's server leads to this machine.
    let named = |host: &str| {
        client.send(client.request(Method::GET, "assets").header(HOST, host.to_owned()))
    };
    named("evil.example").await.problem(421);
    named("localhost:8087").await.expect(200);
    named("[::1]:8087").await.expect(200);
    let view = client.get("login").await.expect(200);
    assert_eq!((&view["authentication"], &view["role"]), (&json!("off"), &json!("admin")));
}

/// `offbd serve` in a process of its own that logs all there is to say.
struct Loud {
    child: std::process::Child,
    log: Option<std::thread::JoinHandle<String>>,
    client: Client,
}

impl Loud {
    fn start(data: &std::path::Path, environment: &[(&str, &str)]) -> Self {
        use std::io::BufRead;
        let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_offbd"))
            .args(["serve", "--listen", "127.0.0.1:0", "--log-format", "json", "--log", "trace"])
            .arg("--data")
            .arg(data)
            .args(config(data).database.iter().flat_map(|url| ["--database", url]))
            .env("OFFBD_AUTH", "required")
            .envs(environment.iter().copied())
            .stderr(std::process::Stdio::piped())
            .spawn()
            .unwrap();
        let log = std::io::BufReader::new(child.stderr.take().unwrap());
        let mut lines = log.lines().map_while(Result::ok);
        let mut begun = String::new();
        let address = lines.find_map(|line| {
            begun += &line;
            let line: Value = serde_json::from_str(&line).ok()?;
            (line["message"] == "serving").then(|| line["address"].as_str().unwrap().to_owned())
        });
        let client = Client::new(address.expect("the log says where it listens"));
        let log = std::thread::spawn(move || lines.fold(begun, |all, line| all + &line + "\n"));
        Self { child, log: Some(log), client }
    }

    /// Stops it; all that it logged.
    fn stop(mut self) -> String {
        let pid = self.child.id().to_string();
        let kill = std::process::Command::new("kill").args(["-TERM", &pid]).status();
        assert!(kill.unwrap().success());
        assert!(self.child.wait().unwrap().success());
        self.log.take().unwrap().join().unwrap()
    }
}

impl Drop for Loud {
    fn drop(&mut self) {
        // One that has ended already needs no killing.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn no_log_and_no_error_has_a_secret() {
    let data = tempfile::tempdir().unwrap();
    let config = config(data.path());
    let root = token(&config, "root", Role::Admin, None).await;
    let key = Key::new("k");
    let jwks = encrypted(&key, data.path()).await;
    let certificate = data.path().join("certificate.pem");
    let loud = Loud::start(
        data.path(),
        &[
            ("OFFBD_JWT__ISSUER", provider::ISSUER),
            ("OFFBD_JWT__AUDIENCE", provider::AUDIENCE),
            ("OFFBD_JWT__JWKS", &jwks),
            ("SSL_CERT_FILE", certificate.to_str().unwrap()),
        ],
    );
    let admin = loud.client.with(&root);
    let wrong = format!("offbd_{}", "5".repeat(64));
    let mut told = String::new();
    let mut hear = |answer: Answer| {
        told += &answer.text;
        told += &format!("{:?}", answer.headers);
        answer
    };
    hear(admin.get("assets").await).expect(200);
    hear(loud.client.with(&wrong).get("assets").await).problem(401);
    hear(loud.client.post("login", &json!({ "token": wrong })).await).problem(401);
    hear(loud.client.post("login", &json!({ "tokens": root })).await).problem(422);
    hear(loud.client.post_text("login", "application/json", format!("{{\"token\":{root}")).await)
        .problem(422);
    hear(loud.client.get(&format!("assets?token={root}")).await).problem(401);
    let made = admin.post("tokens", &json!({ "name": "v", "role": "viewer" })).await.expect(201);
    let login = loud.client.post("login", &json!({ "token": root })).await;
    let cookie = cookie(&login);
    let ask = loud.client.request(Method::GET, "assets").header(COOKIE, cookie.clone());
    hear(loud.client.send(ask).await).expect(200);
    let signed = key.token(&provider::claims("olga", "operator"));
    let forged = Key::new("k").token(&provider::claims("mallory", "admin"));
    hear(loud.client.with(&signed).get("assets").await).expect(200);
    hear(loud.client.with(&forged).get("assets").await).problem(401);
    hear(loud.client.post("login", &json!({ "token": signed })).await).problem(401);
    hear(admin.get("tokens").await).expect(200);
    hear(admin.get("audit").await).expect(200);
    let log = loud.stop();
    assert!(log.contains("its signature is wrong"), "what an operator asks");
    assert!(log.contains("/api/v1/login"), "the log is what was meant");
    let cookie = cookie.split_once('=').unwrap().1;
    for secret in [&root[6..], &wrong[6..], &made["secret"].as_str().unwrap()[6..], cookie] {
        let line = log.lines().find(|line| line.contains(secret));
        assert_eq!(line, None, "in the log");
        assert!(!told.contains(secret), "in an answer: {told}");
    }
    for part in signed.split('.').chain(forged.split('.')) {
        assert_eq!(log.lines().find(|line| line.contains(part)), None, "in the log");
        assert!(!told.contains(part), "in an answer: {told}");
    }
    assert!(!log.contains("mallory"), "what was not verified is not told");
}

/// The URL where `key` is published over TLS, by the certificate that is put into
/// `directory`.
async fn encrypted(key: &Key, directory: &std::path::Path) -> String {
    use tokio_rustls::rustls::{ServerConfig, crypto::ring, pki_types::PrivateKeyDer};
    let certified = rcgen::generate_simple_self_signed(["localhost".to_owned()]).unwrap();
    std::fs::write(directory.join("certificate.pem"), certified.cert.pem()).unwrap();
    let secret = PrivateKeyDer::Pkcs8(certified.signing_key.serialize_der().into());
    let tls = ServerConfig::builder_with_provider(ring::default_provider().into())
        .with_safe_default_protocol_versions()
        .unwrap()
        .with_no_client_auth()
        .with_single_cert(vec![certified.cert.der().clone()], secret)
        .unwrap();
    let published = Published::new(provider::jwks(&[key]));
    let port = published.serve(Some(std::sync::Arc::new(tls).into())).await;
    format!("https://localhost:{port}/jwks")
}

#[test]
fn the_manual_has_the_policy() {
    let manual = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/operations.md");
    let manual = std::fs::read_to_string(manual).unwrap();
    for (right, allowed) in POLICY {
        let words = allowed.map(|allowed| if allowed { "yes" } else { "no" }).join(" | ");
        let row = format!("| {right} | {words} | ");
        assert!(manual.contains(&row), "docs/operations.md has no row `{row}`");
    }
}
