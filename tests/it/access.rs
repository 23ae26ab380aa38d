//! Access control: the rights that the operations state, against a service that requires
//! tokens.

use std::collections::BTreeMap;

use crate::support::provider::{self, Key, Published};
use crate::support::{Answer, Client, Events, ServiceFixture, batch, config, eventually, rig};
use futures_util::future::join_all;
use futures_util::{SinkExt, StreamExt};
use offbd::config::{Auth, Config};
use offbd::server::tokens;
use offbd::service::access::{NewToken, Role};
use reqwest::Method;
use reqwest::header::{COOKIE, HOST, ORIGIN, SET_COOKIE, WWW_AUTHENTICATE};
use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;

/// A service that requires tokens, with the assets `a` and `b` and the client of an admin.
struct SecuredService {
    fixture: ServiceFixture,
    config: Config,
    admin: Client,
}

impl SecuredService {
    async fn new() -> Self {
        Self::with(|_| {}).await
    }

    async fn with(change: impl FnOnce(&mut Config)) -> Self {
        let fixture = ServiceFixture::start_with(|config| {
            config.auth = Some(Auth::Required);
            change(config);
        })
        .await;
        let config = config(fixture.data.path());
        let secret = token(&config, "root", Role::Admin, None).await;
        let admin = fixture.client.with(&secret);
        for asset in ["a", "b"] {
            admin.asset(asset).await;
        }
        Self { fixture, config, admin }
    }

    /// Returns a client with a new token.
    async fn caller(&self, name: &str, role: Role, asset: Option<&str>) -> Client {
        self.fixture.client.with(&token(&self.config, name, role, asset).await)
    }

    async fn device(&self, asset: &str) -> Client {
        self.caller(&format!("{asset}'s device"), Role::Device, Some(asset)).await
    }
}

/// Creates a token directly in the store, as the command line does.
async fn token(config: &Config, name: &str, role: Role, asset: Option<&str>) -> String {
    let (name, asset) = (name.to_owned(), asset.map(str::to_owned));
    let wanted = NewToken { name, role, asset, expires_at: None };
    tokens::create_token(config, wanted).await.unwrap()
}

/// The policy: for each right, whether a caller without a token, another asset's device, the
/// asset's device, a viewer, an operator and an admin has it.
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

/// Returns every operation of the OpenAPI description with the right that it states.
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
    // Deletions come last, that of the asset with its devices at the very end, so that the
    // other operations find their resources.
    operations.sort_by_key(|(method, path, _)| {
        (method == Method::DELETE, path.ends_with("/assets/{asset}"), path.clone())
    });
    operations
}

/// The operations as a readable list.
#[test]
fn regress_every_operation_states_the_right_it_requires() {
    let mut lines: Vec<_> = operations()
        .into_iter()
        .map(|(method, path, right)| format!("{right:<10} {method} {path}"))
        .collect();
    lines.sort();
    // Only the name of the test, without its module.
    insta::with_settings!({ prepend_module_to_snapshot => false }, {
        insta::assert_snapshot!(lines.join("\n"));
    });
}

/// Returns the status of a request; a stream is not read.
async fn status(client: &Client, method: &Method, path: &str) -> u16 {
    client.request(method.clone(), path).send().await.unwrap().status().as_u16()
}

#[tokio::test(flavor = "multi_thread")]
async fn validate_every_operation_against_every_kind_of_caller() {
    let (key, keys) = (Key::new("k"), tempfile::NamedTempFile::new().unwrap());
    std::fs::write(keys.path(), provider::jwks(&[&key])).unwrap();
    let path = keys.path().display();
    let service = SecuredService::with(|config| config.jwt = Some(provider::config(path))).await;
    let opened = service.admin.post("assets/a/sessions", &json!({ "name": "s" })).await.expect(201);
    let session = opened["id"].as_str().unwrap();
    let callers = [
        ("nobody", service.fixture.client.clone()),
        ("b's device", service.device("b").await),
        ("a's device", service.device("a").await),
        ("viewer", service.caller("viewer", Role::Viewer, None).await),
        ("operator", service.caller("operator", Role::Operator, None).await),
        ("admin", service.admin.clone()),
    ];
    // The same callers with tokens of an identity provider.
    let signed = |claims: Value| service.fixture.client.with(&key.token(&claims));
    let signed = [
        (
            "nobody",
            service.fixture.client.with(&Key::new("k").token(&provider::claims("s", "admin"))),
        ),
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
        let full = full.replace("{token}", "none").replace("{data}", "state");
        // An operation on one asset names it in its path or in its query.
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
async fn the_pages_and_the_openapi_description_need_no_token() {
    let service = SecuredService::new().await;
    let docs = ["/", "/docs/", "/docs/swagger-ui.css"];
    let files = ["/openapi.yaml", "/openapi.json", "/asyncapi.yaml", "/asset.schema.json"];
    for path in docs.into_iter().chain(files) {
        let answer = service.fixture.client.get(path).await;
        assert_eq!(answer.status, 200, "{path}");
        assert_eq!(answer.headers["x-content-type-options"], "nosniff", "{path}");
        let policy = answer.headers["content-security-policy"].to_str().unwrap();
        assert!(policy.contains("frame-ancestors 'none'"), "{path}: {policy}");
        assert_eq!(answer.headers["referrer-policy"], "no-referrer", "{path}");
    }
    service.fixture.client.get("/none").await.problem(404);
    // A method that no route has does not bypass the access control.
    let patch = service.fixture.client.request(Method::PATCH, "assets/a");
    let answer = service.fixture.client.send(patch).await;
    answer.problem(405);
    assert!(answer.headers["allow"].to_str().unwrap().contains("DELETE"));
    service
        .fixture
        .client
        .send(service.fixture.client.request(Method::HEAD, "assets"))
        .await
        .status
        .as_u16();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_request_without_a_valid_token_gets_a_challenge() {
    let service = SecuredService::new().await;
    let answer = service.fixture.client.get("assets").await;
    answer.problem(401);
    assert_eq!(answer.headers[WWW_AUTHENTICATE], "Bearer realm=\"offbd\"");
    let stranger = service.fixture.client.with("offbd_0000");
    let answer = stranger.get("assets").await;
    answer.problem(401);
    let challenge = answer.headers[WWW_AUTHENTICATE].to_str().unwrap();
    assert!(challenge.contains("error=\"invalid_token\""), "{challenge}");
    let basic = service.fixture.client.request(Method::GET, "assets").basic_auth("root", Some("x"));
    service.fixture.client.send(basic).await.problem(401);
    let head = service.fixture.client.request(Method::HEAD, "assets");
    assert_eq!(service.fixture.client.send(head).await.status, 401);
    let viewer = service.caller("viewer", Role::Viewer, None).await;
    let answer = viewer.delete("assets/a").await;
    answer.problem(403);
    let challenge = answer.headers[WWW_AUTHENTICATE].to_str().unwrap();
    assert!(challenge.contains("error=\"insufficient_scope\""), "{challenge}");
    assert_eq!(viewer.get("assets").await.headers["cache-control"], "no-store");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_headers_of_nodes_give_no_rights_without_the_secret_of_their_cluster() {
    let service = SecuredService::new().await;
    for secret in [None, Some(""), Some("guessed")] {
        let request = service.fixture.client.request(Method::POST, "assets/a/telemetry");
        let mut request = request.header("x-offbd-from-bus", "1").json(&batch(None, &rig(10, 10)));
        if let Some(secret) = secret {
            request = request.header("x-offbd-forwarded", secret);
        }
        assert_eq!(request.send().await.unwrap().status(), 401, "{secret:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_device_cannot_read_or_change_another_asset() {
    let service = SecuredService::new().await;
    let samples = rig(50, usize::MAX);
    service.admin.telemetry("b", Some("theirs"), &samples).await;
    let theirs = service.admin.session("b", "theirs").await;
    let theirs = theirs["id"].as_str().unwrap();
    let device = service.device("a").await;
    device.telemetry("a", Some("mine"), &samples).await;
    let mine = device.session("a", "mine").await;
    device.get(&format!("sessions/{}", mine["id"].as_str().unwrap())).await.expect(200);

    // In the path, whether the asset exists or not.
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
    // In the query, given twice or not at all.
    for query in ["", "?asset=b", "?asset=a&asset=b", "?asset=b&asset=a", "?Asset=a", "?asset="] {
        device.get(&format!("sessions{query}")).await.problem(403);
        device.get(&format!("events{query}")).await.problem(403);
    }
    let own = device.get("sessions?asset=a&state=open").await.expect(200);
    assert!(own["items"].as_array().unwrap().iter().all(|s| s["asset"] == "a"), "{own}");
    // In the body: the name of another asset's session opens a session of the own asset.
    let taken = device.post("assets/a/telemetry", &batch(Some("theirs"), &samples)).await;
    assert_ne!(taken.expect(200)["session_id"], theirs);
    device.post("assets", &json!({ "name": "c" })).await.problem(403);
    device.put("assets/a", &json!({ "name": "b" })).await.problem(403);
    // The session of the other asset is unchanged.
    let session = service.admin.get(&format!("sessions/{theirs}")).await.expect(200);
    assert_eq!((&session["state"], &session["samples"]), (&json!("open"), &json!(50)));
}

type AssetStream =
    tokio_tungstenite::WebSocketStream<tokio_tungstenite::MaybeTlsStream<tokio::net::TcpStream>>;

/// Opens the WebSocket of an asset; returns the status if it is rejected.
async fn socket(client: &Client, asset: &str) -> Result<AssetStream, u16> {
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

async fn frame(socket: &mut AssetStream) -> Value {
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
async fn a_websocket_accepts_batches_only_from_the_device() {
    let service = SecuredService::new().await;
    let (device, viewer) =
        (service.device("a").await, service.caller("v", Role::Viewer, None).await);
    assert_eq!(socket(&service.fixture.client, "a").await.err(), Some(401));
    assert_eq!(socket(&device, "b").await.err(), Some(403));
    let samples = rig(20, usize::MAX);
    let text = batch(None, &samples).to_string();
    let mut viewing = socket(&viewer, "a").await.unwrap();
    viewing.send(Message::text(text.clone())).await.unwrap();
    let refused = frame(&mut viewing).await;
    assert_eq!((&refused["type"], &refused["problem"]["status"]), (&json!("error"), &json!(403)));
    let mut feeding = socket(&device, "a").await.unwrap();
    feeding.send(Message::text(text)).await.unwrap();
    assert_eq!(frame(&mut feeding).await["accepted"], 20);
    let sessions = service.admin.get("sessions?asset=a").await.expect(200);
    assert_eq!(sessions["items"].as_array().unwrap().len(), 1, "{sessions}");
}

#[tokio::test(flavor = "multi_thread")]
async fn revoking_a_token_ends_its_streams_at_once() {
    let service = SecuredService::new().await;
    let wanted = json!({ "name": "rig", "role": "device", "asset": "a" });
    let made = service.admin.post("tokens", &wanted).await.expect(201);
    let secret = made["secret"].as_str().unwrap();
    assert!(secret.starts_with("offbd_") && secret.len() == 6 + 64, "{secret}");
    service.admin.post("tokens", &wanted).await.problem(409);
    let device = service.fixture.client.with(secret);
    device.get("assets/a").await.expect(200);
    let mut socket = socket(&device, "a").await.unwrap();
    let events = device.request(Method::GET, "events?asset=a").send().await.unwrap();
    let mut events = Events::new(events);
    assert_eq!(events.any().await.0, "begin");

    let token = format!("tokens/{}", made["id"].as_str().unwrap());
    service.admin.delete(&token).await.expect(204);
    device.get("assets/a").await.problem(401);
    let end = frame(&mut socket).await;
    assert_eq!(end["close"], "the token has expired or was revoked");
    assert!(events.ended().await);
    let shown = service.admin.get(&token).await.expect(200);
    assert!(shown["revoked_at"].is_string() && shown.get("secret").is_none(), "{shown}");
    // The name can be used again, and the old secret stays invalid.
    service.admin.post("tokens", &wanted).await.expect(201);
    device.get("assets/a").await.problem(401);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_token_revoked_by_another_process_is_soon_rejected() {
    let service = SecuredService::new().await;
    let viewer = service.caller("v", Role::Viewer, None).await;
    viewer.get("assets").await.expect(200);
    tokens::revoke_token(&service.config, "v").await.unwrap();
    tokens::revoke_token(&service.config, "v").await.unwrap_err();
    eventually(|| async {
        let status = viewer.get("assets").await.status.as_u16();
        (status == 401).then_some(())
    })
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_token_expires_and_is_invalid_once_its_asset_is_deleted() {
    let service = SecuredService::new().await;
    let soon = json!({ "name": "past", "role": "viewer", "expires_at": "2020-01-01T00:00:00Z" });
    assert_eq!(service.admin.post("tokens", &soon).await.problem(422)["pointer"], "/expires_at");
    for (wrong, pointer) in [
        (json!({ "name": "x", "role": "device" }), "/asset"),
        (json!({ "name": "x", "role": "viewer", "asset": "a" }), "/asset"),
        (json!({ "name": "", "role": "viewer" }), "/name"),
        (json!({ "name": "x\n", "role": "viewer" }), "/name"),
        (json!({ "name": "x", "role": "god" }), "/role"),
        (json!({ "name": "x", "role": "viewer", "expires_at": "soon" }), "/expires_at"),
    ] {
        let problem = service.admin.post("tokens", &wrong).await.problem(422);
        assert_eq!(problem["pointer"], pointer, "{wrong}");
    }
    let none = json!({ "name": "x", "role": "device", "asset": "none" });
    service.admin.post("tokens", &none).await.problem(404);
    // Expires in 1.5 s.
    let end = offbd::service::Clock::System.now() + 1_500_000;
    let wanted =
        NewToken { name: "brief".into(), role: Role::Viewer, asset: None, expires_at: Some(end) };
    let secret = tokens::create_token(&service.config, wanted).await.unwrap();
    let brief = service.fixture.client.with(&secret);
    eventually(|| async { (brief.get("assets").await.status == 401).then_some(()) }).await;
    assert!(offbd::service::Clock::System.now() >= end, "not before it expires");
    let device = service.device("b").await;
    device.get("assets/b").await.expect(200);
    service.admin.delete("assets/b").await.expect(204);
    service.admin.asset("b").await;
    device.get("assets/b").await.problem(401);
}

/// Returns the cookie that a response sets, as a browser sends it.
fn cookie(answer: &Answer) -> String {
    let set = answer.headers[SET_COOKIE].to_str().unwrap();
    for word in ["HttpOnly", "SameSite=Strict", "Path=/"] {
        assert!(set.contains(word), "{set}");
    }
    set.split(';').next().unwrap().to_owned()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_browser_can_log_in_act_and_log_out_with_a_cookie() {
    let service = SecuredService::new().await;
    let client = &service.fixture.client;
    let operator = service.caller("olga", Role::Operator, None).await;
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
    // A page of another origin, or without an origin, cannot change anything.
    for origin in [Some("https://evil.example"), Some("null"), None] {
        ask(Method::DELETE, path, origin).await.problem(403);
    }
    ask(Method::DELETE, path, Some(&own)).await.expect(204);
    let history = ask(Method::GET, "assets/a/faults/x_servo/history", None).await.expect(200);
    assert_eq!(history["items"][0]["by"], "olga", "{history}");
    ask(Method::DELETE, "assets/a", Some(&own)).await.problem(403);
    ask(Method::DELETE, "login", Some(&own)).await.expect(204);
    ask(Method::GET, "login", None).await.problem(401);
    // The token stays valid.
    operator.get("assets").await.expect(200);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_login_ends_with_its_token() {
    let service = SecuredService::new().await;
    let made =
        service.admin.post("tokens", &json!({ "name": "v", "role": "viewer" })).await.expect(201);
    let client = &service.fixture.client;
    let answer = client.post("login", &json!({ "token": made["secret"] })).await;
    let cookie = cookie(&answer);
    let ask = || client.send(client.request(Method::GET, "assets").header(COOKIE, cookie.clone()));
    ask().await.expect(200);
    service.admin.delete(&format!("tokens/{}", made["id"].as_str().unwrap())).await.expect(204);
    ask().await.problem(401);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_audit_log_records_actor_action_target_and_address() {
    let service = SecuredService::new().await;
    let operator = service.caller("olga", Role::Operator, None).await;
    let device = service.device("a").await;
    device.telemetry("a", Some("s"), &rig(20, usize::MAX)).await;
    operator.delete("assets/a/faults/x_servo").await.expect(204);
    operator.put("assets/a", &json!({ "name": "a", "sample_rate_hz": 50 })).await.expect(200);
    operator.put("assets/a/tags", &json!({ "tags": ["hall-2"] })).await.expect(200);
    operator.put("assets/a/tags", &json!({ "tags": ["two words"] })).await.problem(422);
    operator.delete("assets/a").await.problem(403);
    operator.delete("assets/a/faults/nonsense").await.problem(404);
    service.fixture.client.post("login", &json!({ "token": operator.token })).await.expect(200);
    let made =
        service.admin.post("tokens", &json!({ "name": "t", "role": "viewer" })).await.expect(201);
    let token = format!("/api/v1/tokens/{}", made["id"].as_str().unwrap());
    service.admin.delete(&token).await.expect(204);
    service.admin.delete("assets/b").await.expect(204);
    let mut seen = Vec::new();
    let mut path = "audit?limit=2".to_owned();
    loop {
        let page = service.admin.get(&path).await.expect(200);
        seen.extend(page["items"].as_array().unwrap().iter().cloned());
        let Some(next) = page["next"].as_str() else { break };
        path = format!("audit?limit=2&cursor={next}");
    }
    let entries: Vec<_> = seen
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
        at("olga", "put_tags", "/api/v1/assets/a/tags"),
        at("olga", "log_in", "/api/v1/login"),
        at("root", "create_token", &token),
        at("root", "revoke_token", &token),
        at("root", "delete_asset", "/api/v1/assets/b"),
    ];
    let entries: Vec<_> =
        entries.into_iter().filter(|(actor, ..)| actor != "command line").collect();
    assert_eq!(entries, expected);
    let by_hand = seen.iter().find(|entry| entry["actor"] == "command line").unwrap();
    assert_eq!((&by_hand["act"], &by_hand["address"]), (&json!("create_token"), &Value::Null));
}

#[tokio::test(flavor = "multi_thread")]
async fn the_store_contains_no_secret() {
    let mut service = SecuredService::new().await;
    let viewer = service.caller("v", Role::Viewer, None).await;
    viewer.get("assets").await.expect(200);
    let answer = service.fixture.client.post("login", &json!({ "token": viewer.token })).await;
    let cookie = cookie(&answer);
    let tokens = service.admin.get("tokens").await;
    service.fixture.server.take().unwrap().shutdown().await.unwrap();
    let mut all = tokens.text.into_bytes();
    all.extend(crate::support::stored(service.fixture.data.path()).await);
    let has = |secret: &str| all.windows(secret.len()).any(|w| w == secret.as_bytes());
    for secret in [viewer.token.as_deref(), service.admin.token.as_deref()] {
        let secret = secret.unwrap().trim_start_matches("offbd_");
        assert!(!has(secret), "{secret}");
    }
    assert!(!has(cookie.split_once('=').unwrap().1));
    assert!(has("command line"), "the search works");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_request_above_the_rate_limit_gets_429_with_retry_after() {
    let service = SecuredService::with(|config| {
        config.rates.token_per_s = 1;
        config.rates.address_per_s = 30;
    })
    .await;
    let viewer = service.caller("v", Role::Viewer, None).await;
    let other = service.caller("w", Role::Viewer, None).await;
    // At once: on a busy machine, a rate is not reached by one request after the other.
    let refused = async |client: &Client| {
        let answers = join_all((0..1000).map(|_| client.get("assets"))).await;
        answers.into_iter().find(|answer| answer.status == 429).expect("one is refused")
    };
    let answer = refused(&viewer).await;
    answer.problem(429);
    let wait: u64 = answer.headers["retry-after"].to_str().unwrap().parse().unwrap();
    assert!((1..=2).contains(&wait), "{wait}");
    other.get("assets").await.expect(200);
    // Callers without a valid token share the rate limit of their address; others do not.
    refused(&service.fixture.client.with("offbd_guess")).await.problem(429);
    other.get("assets").await.expect(200);
}

#[tokio::test(flavor = "multi_thread")]
async fn requests_from_another_origin_are_accepted_if_it_is_configured() {
    const THERE: &str = "https://there.example";
    let service = SecuredService::with(|config| config.origins = vec![THERE.to_owned()]).await;
    let preflight = |origin: &str| {
        let client = &service.fixture.client;
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
        let request = service.admin.request(Method::DELETE, "assets/a/faults/x_servo");
        service.admin.send(request.header(ORIGIN, origin.to_owned()))
    };
    act(THERE).await.expect(204);
    act("https://evil.example").await.problem(403);
}

#[tokio::test(flavor = "multi_thread")]
async fn without_authentication_other_origins_and_hosts_are_rejected() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    let act = |origin: &str| {
        let request = client.request(Method::POST, "assets/a/sessions");
        client.send(request.header(ORIGIN, origin.to_owned()))
    };
    act("https://evil.example").await.problem(403);
    act(&format!("http://{}", client.address)).await.expect(201);
    // A host name of a stranger that resolves to this machine.
    let named = |host: &str| {
        client.send(client.request(Method::GET, "assets").header(HOST, host.to_owned()))
    };
    named("evil.example").await.problem(421);
    named("localhost:8087").await.expect(200);
    named("[::1]:8087").await.expect(200);
    let view = client.get("login").await.expect(200);
    assert_eq!((&view["authentication"], &view["role"]), (&json!("off"), &json!("admin")));
}

/// A process with `offbd serve` that logs everything.
struct VerboseProcess {
    child: std::process::Child,
    log: Option<std::thread::JoinHandle<String>>,
    client: Client,
}

impl VerboseProcess {
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
        let mut first_lines = String::new();
        let address = lines.find_map(|line| {
            first_lines += &line;
            let line: Value = serde_json::from_str(&line).ok()?;
            (line["message"] == "serving").then(|| line["address"].as_str().unwrap().to_owned())
        });
        let client = Client::new(address.expect("the log contains the address"));
        let log =
            std::thread::spawn(move || lines.fold(first_lines, |all, line| all + &line + "\n"));
        Self { child, log: Some(log), client }
    }

    /// Stops the process and returns its log.
    fn stop(mut self) -> String {
        let pid = self.child.id().to_string();
        let kill = std::process::Command::new("kill").args(["-TERM", &pid]).status();
        assert!(kill.unwrap().success());
        assert!(self.child.wait().unwrap().success());
        self.log.take().unwrap().join().unwrap()
    }
}

impl Drop for VerboseProcess {
    fn drop(&mut self) {
        // Fails if the process has already ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn neither_the_log_nor_a_response_contains_a_secret() {
    let data = tempfile::tempdir().unwrap();
    let config = config(data.path());
    let root = token(&config, "root", Role::Admin, None).await;
    let key = Key::new("k");
    let jwks = publish_over_tls(&key, data.path()).await;
    let certificate = data.path().join("certificate.pem");
    let process = VerboseProcess::start(
        data.path(),
        &[
            ("OFFBD_JWT__ISSUER", provider::ISSUER),
            ("OFFBD_JWT__AUDIENCE", provider::AUDIENCE),
            ("OFFBD_JWT__JWKS", &jwks),
            ("SSL_CERT_FILE", certificate.to_str().unwrap()),
        ],
    );
    let admin = process.client.with(&root);
    let wrong = format!("offbd_{}", "5".repeat(64));
    let mut responses = String::new();
    let mut record = |answer: Answer| {
        responses += &answer.text;
        responses += &format!("{:?}", answer.headers);
        answer
    };
    record(admin.get("assets").await).expect(200);
    record(process.client.with(&wrong).get("assets").await).problem(401);
    record(process.client.post("login", &json!({ "token": wrong })).await).problem(401);
    record(process.client.post("login", &json!({ "tokens": root })).await).problem(422);
    record(
        process.client.post_text("login", "application/json", format!("{{\"token\":{root}")).await,
    )
    .problem(400);
    record(process.client.get(&format!("assets?token={root}")).await).problem(401);
    let made = admin.post("tokens", &json!({ "name": "v", "role": "viewer" })).await.expect(201);
    let login = process.client.post("login", &json!({ "token": root })).await;
    let cookie = cookie(&login);
    let ask = process.client.request(Method::GET, "assets").header(COOKIE, cookie.clone());
    record(process.client.send(ask).await).expect(200);
    let signed = key.token(&provider::claims("olga", "operator"));
    let forged = Key::new("k").token(&provider::claims("mallory", "admin"));
    record(process.client.with(&signed).get("assets").await).expect(200);
    record(process.client.with(&forged).get("assets").await).problem(401);
    record(process.client.post("login", &json!({ "token": signed })).await).problem(401);
    record(admin.get("tokens").await).expect(200);
    record(admin.get("audit").await).expect(200);
    let log = process.stop();
    assert!(log.contains("invalid signature"), "the reason for an operator");
    assert!(log.contains("/api/v1/login"), "the log contains requests");
    let cookie = cookie.split_once('=').unwrap().1;
    for secret in [&root[6..], &wrong[6..], &made["secret"].as_str().unwrap()[6..], cookie] {
        let line = log.lines().find(|line| line.contains(secret));
        assert_eq!(line, None, "in the log");
        assert!(!responses.contains(secret), "in a response: {responses}");
    }
    for part in signed.split('.').chain(forged.split('.')) {
        assert_eq!(log.lines().find(|line| line.contains(part)), None, "in the log");
        assert!(!responses.contains(part), "in a response: {responses}");
    }
    assert!(!log.contains("mallory"), "unverified claims are not logged");
}

/// Publishes `key` over TLS with a certificate that is written to `directory`, and returns the
/// URL.
async fn publish_over_tls(key: &Key, directory: &std::path::Path) -> String {
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
fn the_operations_manual_contains_the_policy() {
    let manual = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/operations/security.md");
    let manual = std::fs::read_to_string(manual).unwrap();
    for (right, allowed) in POLICY {
        let words = allowed.map(|allowed| if allowed { "yes" } else { "no" }).join(" | ");
        let row = format!("| {right} | {words} | ");
        assert!(manual.contains(&row), "docs/operations/security.md has no row `{row}`");
    }
}
