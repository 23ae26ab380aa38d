//! Notifications reach a real receiver: each change at least once, with a stable id, in the
//! order of its rig, whatever happens to receiver and service.

use std::collections::BTreeMap;
use std::path::Path;

use crate::support::process::Process;
use crate::support::receiver::{Received, Reply, WebhookReceiver, is_signed};
use crate::support::{Client, ServiceFixture, eventually, hours_from_now, rig};
use offbd::config::Config;
use serde_json::{Value, json};

/// Short delays, so that a retry comes soon.
fn quick(config: &mut Config) {
    config.notifications.first_retry_s = 1;
    config.notifications.timeout_s = 1;
}

async fn webhook(client: &Client, name: &str, url: &str) -> (String, String) {
    let new = json!({ "name": name, "webhook": { "url": url } });
    let made = client.post("notifications/channels", &new).await.expect(201);
    let word = |key: &str| made[key].as_str().unwrap().to_owned();
    (word("id"), word("secret"))
}

async fn rule(client: &Client, channel: &str, more: Value) -> Value {
    let mut rule = json!({ "name": "all", "channel": channel,
        "changes": ["pending", "confirmed", "passed", "healed", "cleared"] });
    rule.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
    client.post("notifications/rules", &rule).await.expect(201)
}

/// The ids of the messages of all transitions of an asset, in their order. A fault that is
/// named at once is told once, with its kind.
async fn expected(client: &Client, asset: &str) -> Vec<String> {
    let mut changes = Vec::new();
    for code in ["x_servo", "y_servo", "stuck_ball", "sensor"] {
        let path = format!("assets/{asset}/faults/{code}/history?limit=500");
        let page = client.get(&path).await.expect(200);
        let entries = page["items"].as_array().unwrap().iter().filter(|e| !e["fault"].is_null());
        changes.extend(entries.map(|entry| {
            let of = |key: &str| entry["fault"][key].clone();
            (entry["id"].as_i64().unwrap(), code, [of("status"), of("status_byte")], of("kind"))
        }));
    }
    changes.sort_unstable_by_key(|change| change.0);
    assert!(!changes.is_empty());
    let is_named = |(i, (_, code, status, kind)): (usize, &(i64, &str, [Value; 2], Value))| {
        let same = |later: &&(i64, &str, [Value; 2], Value)| (&later.1, &later.2) == (code, status);
        let named = changes[i + 1..].iter().find(same);
        kind.is_null() && status[0] == "confirmed" && named.is_some_and(|later| !later.3.is_null())
    };
    let told = changes.iter().enumerate().filter(|change| !is_named(*change));
    told.map(|(_, change)| format!("evt_{}", change.0)).collect()
}

/// The ids of the messages of an asset in the order of their first arrival.
fn arrived(received: &[Received], asset: &str) -> Vec<String> {
    let mut ids = Vec::<String>::new();
    for message in received.iter().map(Received::message) {
        let id = message["id"].as_str().unwrap().to_owned();
        if message["data"]["asset"] == asset && !ids.contains(&id) {
            ids.push(id);
        }
    }
    ids
}

async fn wait_for_all(client: &Client, receiver: &WebhookReceiver, asset: &str) {
    let expected = expected(client, asset).await;
    eventually(async || {
        (arrived(&receiver.received(), asset).len() >= expected.len()).then_some(())
    })
    .await;
    assert_eq!(arrived(&receiver.received(), asset), expected);
}

/// The kind of a dead servo is known a moment after its confirmation, in another batch.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_fault_that_is_streamed_is_confirmed_by_one_message() {
    let receiver = WebhookReceiver::start(&[]).await;
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    let (channel, _) = webhook(client, "hook", &receiver.url()).await;
    rule(client, &channel, json!({ "codes": ["x_servo"], "changes": ["confirmed"] })).await;
    for batch in rig(2000, 300).chunks(10) {
        client.telemetry("a", Some("s"), batch).await;
    }
    let named = |received: &Received| !received.message()["data"]["event"]["kind"].is_null();
    eventually(async || receiver.received().into_iter().find(named)).await;
    let messages = receiver.received();
    let of = |kind: &str| messages.iter().filter(|m| m.message()["type"] == kind).count();
    // On a machine that is busy for two seconds in between, the kind comes as an update.
    assert_eq!(of("org.offbd.fault.confirmed.v1"), 1);
    assert_eq!(of("org.offbd.fault.updated.v1"), messages.len() - 1);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_webhook_can_post_text_for_people() {
    let receiver = WebhookReceiver::start(&[]).await;
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    for format in ["slack", "text"] {
        let webhook = json!({ "url": receiver.url(), "format": format });
        let new = json!({ "name": format, "webhook": webhook });
        let made = client.post("notifications/channels", &new).await.expect(201);
        assert_eq!(made["format"], format);
        let path = format!("notifications/channels/{}/test", made["id"].as_str().unwrap());
        client.post(&path, &Value::Null).await.expect(202);
        let body =
            |start: &str| receiver.received().into_iter().find(|m| m.body.starts_with(start));
        let (start, media_type) = match format {
            "slack" => ("{\"text\":\"This is a test", "application/json"),
            _ => ("This is a test", "text/plain; charset=utf-8"),
        };
        let received = eventually(async || body(start)).await;
        assert_eq!(received.header("content-type"), media_type);
    }
    let wrong = json!({ "name": "x", "webhook": { "url": receiver.url(), "format": "xml" } });
    client.post("notifications/channels", &wrong).await.expect(422);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn validate_a_fault_arrives_as_a_signed_cloud_event() {
    let receiver = WebhookReceiver::start(&[]).await;
    let fixture = ServiceFixture::start_with(|config| {
        config.notifications.public_url = Some("https://offbd.example".to_owned());
    })
    .await;
    let client = &fixture.client;
    client.asset("a").await;
    let (channel, secret) = webhook(client, "hook", &receiver.url()).await;
    rule(client, &channel, json!({ "asset": "a", "codes": ["x_servo"] })).await;
    client.telemetry("a", Some("s"), &rig(2000, 300)).await;
    let is_confirmation = |received: &Received| received.body.contains("fault.confirmed");
    let confirmed =
        eventually(async || receiver.received().into_iter().find(is_confirmation)).await;
    let message = confirmed.message();
    for (key, value) in [
        ("specversion", "1.0"),
        ("type", "org.offbd.fault.confirmed.v1"),
        ("source", "https://offbd.example/api/v1/assets/a"),
        ("subject", "x_servo"),
        ("datacontenttype", "application/json"),
    ] {
        assert_eq!(message[key], value, "{key}: {message}");
    }
    assert_eq!(confirmed.path, "/hook");
    assert_eq!(confirmed.header("content-type"), "application/cloudevents+json");
    assert_eq!(confirmed.header("webhook-id"), message["id"]);
    let data = &message["data"];
    assert_eq!(data["link"], "https://offbd.example/rigs/a/faults/x_servo");
    assert_eq!(data["event"]["status"], "confirmed");
    assert!(data["event"]["session_id"].is_string(), "{data}");
    assert!(data["summary"].as_str().unwrap().starts_with("a: X servo"), "{data}");
    assert!((2..=3).contains(&data["advice"].as_array().unwrap().len()), "{data}");

    assert!(is_signed(&confirmed, &secret));
    let forged =
        Received { body: confirmed.body.replace("x_servo", "y_servo"), ..confirmed.clone() };
    assert!(!is_signed(&forged, &secret));
    let other = "whsec_AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA=";
    assert!(!is_signed(&confirmed, other));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_receiver_that_fails_gets_every_change_in_order_once_it_recovers() {
    let elsewhere = WebhookReceiver::start(&[]).await;
    let replies =
        [Reply::Status(500), Reply::Redirect(elsewhere.url()), Reply::Hang, Reply::RetryAfter(1)];
    let receiver = WebhookReceiver::start(&replies).await;
    let fixture = ServiceFixture::start_with(quick).await;
    let client = &fixture.client;
    client.asset("a").await;
    let (channel, _) = webhook(client, "hook", &receiver.url()).await;
    rule(client, &channel, json!({})).await;
    client.telemetry("a", Some("s"), &rig(2000, 300)).await;
    client.delete("assets/a/faults/x_servo?by=ann").await.expect(204);
    wait_for_all(client, &receiver, "a").await;
    let received = receiver.received();
    let first = received[0].header("webhook-id");
    assert!(received[..5].iter().all(|r| r.header("webhook-id") == first), "one after the other");
    assert!(received[..5].iter().all(|r| r.body == received[0].body), "the same bytes each time");
    assert_eq!(elsewhere.received().len(), 0, "a redirect was followed");
    let page = client.get("notifications/deliveries?limit=500").await.expect(200);
    let oldest = page["items"].as_array().unwrap().last().unwrap();
    assert_eq!((&oldest["message_id"], &oldest["attempts"]), (&json!(first), &json!(5)));
}

/// The delays of the real service, with a receiver that is never there: given up, and shown.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_cannot_be_delivered_is_given_up_and_shown() {
    let away = WebhookReceiver::start(&[]).await.url();
    let gone = WebhookReceiver::start(&[Reply::Status(410)]).await;
    let fixture = ServiceFixture::start_with(|config| {
        quick(config);
        config.notifications.give_up_after_s = 1;
    })
    .await;
    let client = &fixture.client;
    for (name, url, reason) in [("away", away, "refused"), ("gone", gone.url(), "410")] {
        let (channel, _) = webhook(client, name, &url).await;
        let test = format!("notifications/channels/{channel}/test");
        let answer = client.post(&test, &Value::Null).await;
        let path = answer.headers["location"].to_str().unwrap().to_owned();
        assert_eq!(answer.expect(202)["state"], "pending");
        let delivery = eventually(async || {
            let delivery = client.get(&path).await.expect(200);
            (delivery["state"] != "pending").then_some(delivery)
        })
        .await;
        assert_eq!(delivery["state"], "given_up");
        assert!(delivery["error"].as_str().unwrap().contains(reason), "{delivery}");
        let shown = client.get(&format!("notifications/channels/{channel}")).await.expect(200);
        assert_eq!((&shown["pending"], &shown["given_up"]), (&json!(0), &json!(1)));
    }
    assert_eq!(gone.received().len(), 1);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_channel_that_hangs_holds_up_neither_another_nor_ingest() {
    let hanging = WebhookReceiver::start(&vec![Reply::Hang; 100]).await;
    let working = WebhookReceiver::start(&[]).await;
    let fixture = ServiceFixture::start_with(|config| config.notifications.timeout_s = 60).await;
    let client = &fixture.client;
    for (name, receiver) in [("hanging", &hanging), ("working", &working)] {
        let (channel, _) = webhook(client, name, &receiver.url()).await;
        rule(client, &channel, json!({})).await;
    }
    client.asset("a").await;
    client.asset("b").await;
    client.telemetry("a", Some("s"), &rig(2000, 300)).await;
    hanging.wait_for(1).await;
    client.telemetry("b", Some("s"), &rig(2000, 300)).await;
    wait_for_all(client, &working, "a").await;
    wait_for_all(client, &working, "b").await;
    // The rigs do not wait for each other, not even in the channel that hangs.
    let assets = eventually(async || {
        let received = hanging.received();
        (received.len() >= 2).then(|| received.iter().map(Received::message).collect::<Vec<_>>())
    })
    .await;
    let of = |message: &Value| message["data"]["asset"].as_str().unwrap().to_owned();
    assert_eq!(assets.iter().map(of).collect::<Vec<_>>(), ["a", "b"], "one at a time for each rig");
}

/// Kills between commit and delivery, and while deliveries are made.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn killed_at_any_time_the_service_delivers_every_change_with_the_same_id() {
    let data = tempfile::tempdir().unwrap();
    let start = || {
        let one = Path::new("1");
        let quick =
            [("OFFBD_NOTIFICATIONS__FIRST_RETRY_S", one), ("OFFBD_NOTIFICATIONS__TIMEOUT_S", one)];
        Process::start_with(data.path(), &quick)
    };
    // Reserves an address at which nobody listens at first.
    let address = WebhookReceiver::start(&[]).await.address.clone();
    let mut process = start();
    process.client.asset("a").await;
    let (channel, secret) =
        webhook(&process.client, "hook", &format!("http://{address}/hook")).await;
    rule(&process.client, &channel, json!({})).await;
    let samples = rig(3000, 300);
    for (i, part) in samples.chunks(300).enumerate() {
        process.client.telemetry("a", Some(&format!("s{}", i / 4)), part).await;
        process.child.kill().unwrap();
        drop(process);
        process = start();
    }
    process.client.delete("assets/a/faults/x_servo?by=ann").await.expect(204);
    // The first message hangs, and the service is killed with it.
    let receiver = WebhookReceiver::listen(&address, &[Reply::Hang]).await;
    receiver.wait_for(1).await;
    process.child.kill().unwrap();
    drop(process);
    process = start();
    wait_for_all(&process.client, &receiver, "a").await;
    let mut bodies = BTreeMap::<String, String>::new();
    for received in receiver.received() {
        let id = received.header("webhook-id").to_owned();
        let first = bodies.entry(id).or_insert_with(|| received.body.clone());
        assert_eq!(*first, received.body, "a message changed from attempt to attempt");
    }
    assert!(is_signed(&receiver.received()[0], &secret));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_rule_tells_only_of_what_it_is_for() {
    let receiver = WebhookReceiver::start(&[]).await;
    let fixture = ServiceFixture::start_with(quick).await;
    let client = &fixture.client;
    for asset in ["lab-1", "lab-2", "hall-1"] {
        client.asset(asset).await;
    }
    let (channel, _) = webhook(client, "hook", &receiver.url()).await;
    let muted = json!({ "reason": "new horn", "until": hours_from_now(1) });
    client.put("assets/lab-2/mutes/x_servo?by=ann", &muted).await.expect(200);
    let only = json!({ "asset": "lab-*", "codes": ["x_servo"], "changes": ["confirmed"] });
    let lab = rule(client, &channel, only).await;
    let silent = json!({ "asset": "hall-1", "silent_until": "2999-01-01T00:00:00Z" });
    rule(client, &channel, silent).await;
    for asset in ["lab-2", "hall-1", "lab-1"] {
        client.telemetry(asset, Some("s"), &rig(2000, 300)).await;
    }
    // Events are planned in their order: with that of the last rig, all have been.
    let received = receiver.wait_for(1).await;
    for message in received.iter().map(Received::message) {
        assert_eq!(message["data"]["asset"], "lab-1", "{message}");
        assert_eq!(message["type"], "org.offbd.fault.confirmed.v1");
        assert_eq!(message["subject"], "x_servo");
    }
    // The muted fault is on record all the same, and is not shown as tested.
    let fault = client.get("assets/lab-2/faults/x_servo").await.expect(200);
    assert_eq!(fault["status"], "confirmed");
    assert_eq!(fault["monitor"]["muted"]["by"], "ann");
    // A channel in use stays.
    let path = format!("notifications/channels/{channel}");
    let problem = client.delete(&path).await.problem(409);
    assert!(problem["detail"].as_str().unwrap().contains("all"), "{problem}");
    let id = lab["id"].as_str().unwrap();
    client.delete(&format!("notifications/rules/{id}")).await.expect(204);
    client.delete(&format!("notifications/rules/{id}")).await.problem(404);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn no_answer_and_no_log_has_a_secret() {
    let data = tempfile::tempdir().unwrap();
    let process = Process::start_with(data.path(), &[("OFFBD_LOG__LEVEL", Path::new("debug"))]);
    let client = &process.client;
    let secret = "whsec_bXktdmVyeS1vd24tc2VjcmV0LW9mLXRoZS1jaGFubmVs";
    let url = "http://127.0.0.1:1/very-own-path";
    let new = json!({ "name": "hook", "webhook": { "url": url, "secret": secret } });
    let made = client.post("notifications/channels", &new).await.expect(201);
    assert_eq!(made["secret"], Value::Null, "a secret that the caller knows");
    let channel = format!("notifications/channels/{}", made["id"].as_str().unwrap());
    let path = client.post(&format!("{channel}/test"), &Value::Null).await;
    let path = path.headers["location"].to_str().unwrap().to_owned();
    eventually(async || {
        let delivery = client.get(&path).await.expect(200);
        (delivery["attempts"] != 0).then_some(())
    })
    .await;
    let paths = ["notifications/channels", &channel, "notifications/deliveries", &path, "audit"];
    for path in paths {
        let text = client.get(path).await.text;
        assert!(!text.contains("whsec") && !text.contains(&secret[6..]), "{path}: {text}");
    }
    let log = process.log();
    assert!(log.contains("notifications/channels"), "{log}");
    assert!(!log.contains(&secret[6..]) && !log.contains("very-own-path"), "{log}");
    // A change without a secret keeps it.
    let renamed = json!({ "name": "other", "webhook": { "url": url } });
    let put = client.put(&channel, &renamed).await.expect(200);
    assert_eq!((&put["name"], &put["secret"]), (&json!("other"), &Value::Null));
    let audit = client.get("audit").await.expect(200);
    let acts: Vec<_> = audit["items"].as_array().unwrap().iter().map(|e| &e["act"]).collect();
    assert_eq!(acts[..3], ["put_channel", "test_channel", "create_channel"]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn targets_that_are_not_permitted_are_refused() {
    let receiver = WebhookReceiver::start(&[]).await;
    let fixture = ServiceFixture::start_with(|config| {
        quick(config);
        config.notifications.targets = vec!["*.example".to_owned(), "localhost".to_owned()];
        config.notifications.private_addresses = false;
    })
    .await;
    let client = &fixture.client;
    for (url, why) in [
        (receiver.url().as_str(), "notifications.targets"),
        ("http://evil.org/", "notifications.targets"),
        ("ftp://hooks.example/", "https://"),
        ("https://ann:secret@hooks.example/", "password"),
        ("http://hooks.example:99999/", "port"),
        ("http://hooks.example:0/", "port"),
        ("/hook", "https://"),
    ] {
        let new = json!({ "name": "hook", "webhook": { "url": url } });
        let problem = client.post("notifications/channels", &new).await.problem(422);
        assert_eq!(problem["pointer"], "/webhook/url");
        assert!(problem["detail"].as_str().unwrap().contains(why), "{url}: {problem}");
    }
    // A name is permitted, the address behind it is not.
    let port = receiver.address.split(':').next_back().unwrap();
    let (channel, _) = webhook(client, "hook", &format!("http://localhost:{port}/")).await;
    client.post(&format!("notifications/channels/{channel}/test"), &Value::Null).await.expect(202);
    let error = eventually(async || {
        let page = client.get("notifications/deliveries").await.expect(200);
        page["items"][0]["error"].as_str().map(str::to_owned)
    })
    .await;
    assert!(error.contains("private address"), "{error}");
    assert_eq!(receiver.received().len(), 0);
}

#[tokio::test]
async fn invalid_settings_are_refused_with_their_element() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    let (channel, _) = webhook(client, "hook", "https://hooks.example/").await;
    let url = "https://hooks.example/";
    for (new, pointer) in [
        (json!({ "name": "", "webhook": { "url": url } }), "/name"),
        (json!({ "name": "x" }), "/webhook"),
        (
            json!({ "name": "x", "webhook": { "url": url, "secret": "whsec_short" } }),
            "/webhook/secret",
        ),
        (json!({ "name": "x", "webhook": { "url": url, "method": "GET" } }), "/webhook/method"),
    ] {
        let problem = client.post("notifications/channels", &new).await.problem(422);
        assert_eq!(problem["pointer"], pointer, "{problem}");
    }
    let again = json!({ "name": "hook", "webhook": { "url": url } });
    client.post("notifications/channels", &again).await.problem(409);
    for (more, pointer) in [
        (json!({ "channel": "none" }), "/channel"),
        (json!({ "asset": "" }), "/asset"),
        (json!({ "changes": [] }), "/changes"),
        (json!({ "changes": ["exploded"] }), "/changes/0"),
        (json!({ "codes": ["z_servo"] }), "/codes/0"),
        (json!({ "silent_until": "tomorrow" }), "/silent_until"),
        (json!({ "repeat_s": 59 }), "/repeat_s"),
        (json!({ "delay_s": 86_401 }), "/delay_s"),
    ] {
        let mut rule = json!({ "name": "r", "channel": channel });
        rule.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        let problem = client.post("notifications/rules", &rule).await.problem(422);
        assert_eq!(problem["pointer"], pointer, "{problem}");
    }
    assert_eq!(client.get("notifications/rules").await.expect(200)["items"], json!([]));
}

#[cfg(feature = "email")]
mod email {
    use super::*;
    use crate::support::receiver::MailServer;

    /// A foreign mail server refuses the first attempt and takes the second.
    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn validate_a_fault_arrives_by_mail() {
        let mut server = MailServer::start(&["refuse-first", "auth"]);
        let fixture = ServiceFixture::start_with(quick).await;
        let client = &fixture.client;
        client.asset("a").await;
        let email = json!({ "host": "localhost", "port": server.port, "security": "none",
            "user": "ann", "password": "very-own-password", "from": "offbd@lab.example",
            "to": ["ann@lab.example", "bob@lab.example"] });
        let new = json!({ "name": "mail", "email": email });
        let made = client.post("notifications/channels", &new).await.expect(201);
        assert_eq!(made["email"]["has_password"], true);
        assert!(!made.to_string().contains("very-own-password"), "{made}");
        let only = json!({ "codes": ["x_servo"], "changes": ["confirmed"] });
        rule(client, made["id"].as_str().unwrap(), only).await;
        client.telemetry("a", Some("s"), &rig(2000, 300)).await;
        let (refused, taken) =
            tokio::task::spawn_blocking(move || (server.next(), server.next())).await.unwrap();
        assert_eq!((&refused["refused"], &taken["refused"]), (&json!(true), &json!(false)));
        assert_eq!(taken["from"], "offbd@lab.example");
        assert_eq!(taken["to"], json!(["ann@lab.example", "bob@lab.example"]));
        assert_eq!(taken["user"], "ann");
        let text = taken["text"].as_str().unwrap();
        assert!(text.contains("Subject: [offbd] a: x servo confirmed"), "{text}");
        assert!(text.contains("What to do:"), "{text}");
        let id = |mail: &Value| {
            let text = mail["text"].as_str().unwrap();
            text.lines().find(|line| line.starts_with("Message-ID")).unwrap().to_owned()
        };
        assert_eq!(id(&refused), id(&taken));
    }

    /// Nobody listens at first: the attempts fail, and the mail arrives once the server is back.
    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn a_mail_server_that_is_away_gets_the_mail_once_it_is_back() {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        drop(listener);
        let fixture = ServiceFixture::start_with(quick).await;
        let client = &fixture.client;
        let email = json!({ "host": "localhost", "port": port, "security": "none",
            "from": "offbd@lab.example", "to": ["ann@lab.example"] });
        let new = json!({ "name": "mail", "email": email });
        let made = client.post("notifications/channels", &new).await.expect(201);
        let test = format!("notifications/channels/{}/test", made["id"].as_str().unwrap());
        let answer = client.post(&test, &Value::Null).await;
        let path = answer.headers["location"].to_str().unwrap().to_owned();
        let delivery = || async { client.get(&path).await.expect(200) };
        let refused = eventually(async || {
            let delivery = delivery().await;
            (delivery["attempts"].as_u64() >= Some(2)).then_some(delivery)
        })
        .await;
        assert_eq!(refused["state"], "pending", "{refused}");
        assert!(refused["error"].as_str().unwrap().contains("refused"), "{refused}");
        let mut server = MailServer::start(&[&port.to_string()]);
        // It is kept until it has answered.
        let received = tokio::task::spawn_blocking(move || (server.next(), server));
        let (taken, _server) = received.await.unwrap();
        assert_eq!(taken["to"], json!(["ann@lab.example"]));
        let delivered = eventually(async || {
            let delivery = delivery().await;
            (delivery["state"] == "delivered").then_some(delivery)
        })
        .await;
        assert!(delivered["attempts"].as_u64() >= Some(3), "{delivered}");
        assert_eq!(delivered["error"], Value::Null);
    }

    /// Whoever may change a channel must not learn its password by naming another server.
    #[tokio::test]
    async fn a_stored_password_is_for_its_server_alone() {
        let fixture = ServiceFixture::start().await;
        let client = &fixture.client;
        let email = json!({ "host": "mail.example", "port": 587, "security": "starttls",
            "user": "ann", "password": "very-own-password", "from": "offbd@lab.example",
            "to": ["ann@lab.example"] });
        let new = json!({ "name": "mail", "email": email });
        let made = client.post("notifications/channels", &new).await.expect(201);
        let path = format!("notifications/channels/{}", made["id"].as_str().unwrap());
        let put = async |changes: &[(&str, Value)]| {
            let mut email = email.clone();
            email.as_object_mut().unwrap().remove("password");
            changes.iter().for_each(|(key, value)| email[key] = value.clone());
            client.put(&path, &json!({ "name": "mail", "email": email })).await
        };
        for (key, value) in [
            ("host", json!("evil.example")),
            ("port", json!(588)),
            ("security", json!("none")),
            ("user", json!("bob")),
        ] {
            let problem = put(&[(key, value.clone())]).await.problem(422);
            assert_eq!(problem["pointer"], "/email/password", "{key}: {problem}");
            let again = put(&[(key, value), ("password", json!("again"))]).await.expect(200);
            assert_eq!(again["email"]["has_password"], true);
            put(&[("password", json!("very-own-password"))]).await.expect(200);
        }
        let kept = put(&[("to", json!(["bob@lab.example"]))]).await.expect(200);
        assert_eq!(kept["email"]["has_password"], true);
        let without = put(&[("host", json!("evil.example")), ("user", Value::Null)]).await;
        assert_eq!(without.expect(200)["email"]["has_password"], false);
    }

    #[tokio::test]
    async fn invalid_mail_settings_are_refused_with_their_element() {
        let fixture = ServiceFixture::start().await;
        let whole = json!({ "host": "mail.example", "port": 587, "security": "starttls",
            "from": "offbd@lab.example", "to": ["ann@lab.example"] });
        for (key, value, pointer) in [
            ("port", json!(0), "/email/port"),
            ("from", json!("offbd"), "/email/from"),
            ("to", json!([]), "/email/to"),
            ("to", json!(["ann@lab.example", "a b@c"]), "/email/to/1"),
            ("user", json!("ann"), "/email/password"),
            ("security", json!("maybe"), "/email/security"),
        ] {
            let mut email = whole.clone();
            email[key] = value;
            let new = json!({ "name": "mail", "email": email });
            let problem = fixture.client.post("notifications/channels", &new).await.problem(422);
            assert_eq!(problem["pointer"], pointer, "{problem}");
        }
    }
}
