//! `ETag`, `If-Match` and `If-None-Match`: of two people who edit the same thing, the second does not overwrite the
//! change of the first unseen.

use std::collections::BTreeMap;

use crate::support::{Answer, Client, ServiceFixture, hours_from_now};
use proptest::prelude::*;
use proptest::test_runner::{Config as Cases, TestRunner};
use reqwest::Method;
use serde_json::{Value, json};

/// Makes the content of something from a number and the id of a channel.
type Content = fn(usize, &str) -> Value;

/// Something that is edited, with a number in its content.
#[derive(Clone, Debug)]
struct Edited {
    path: String,
    content: Content,
    /// The id of the channel of a rule.
    channel: String,
}

impl Edited {
    fn content(&self, n: usize) -> Value {
        (self.content)(n, &self.channel)
    }
}

/// A hook to which nothing is sent.
const URL: &str = "http://127.0.0.1:9/";

fn rig(n: usize, _: &str) -> Value {
    json!({ "name": "a", "sample_rate_hz": 100, "ball": { "radius_m": 0.02 + 0.0001 * n as f64 } })
}

fn tags(n: usize, _: &str) -> Value {
    json!({ "tags": ["hall", format!("t{n}")] })
}

fn channel(n: usize, _: &str) -> Value {
    json!({ "name": format!("hook {n}"), "webhook": { "url": URL } })
}

fn rule(n: usize, channel: &str) -> Value {
    json!({ "name": format!("rule {n}"), "channel": channel, "changes": ["confirmed"] })
}

/// Makes one of everything that is edited, each with the number 0.
async fn edited(client: &Client) -> Vec<Edited> {
    client.put("assets/a", &rig(0, "")).await.expect(201);
    client.put("assets/a/tags", &tags(0, "")).await.expect(200);
    let hook = client.post("notifications/channels", &channel(0, "")).await.expect(201);
    let hook = hook["id"].as_str().unwrap().to_owned();
    let made = client.post("notifications/rules", &rule(0, &hook)).await.expect(201);
    let rules = format!("notifications/rules/{}", made["id"].as_str().unwrap());
    let channels = format!("notifications/channels/{hook}");
    let all: [(&str, Content); 4] =
        [("assets/a", rig), ("assets/a/tags", tags), (&channels, channel), (&rules, rule)];
    let of = |(path, content): (&str, _)| Edited {
        path: path.to_owned(),
        content,
        channel: hook.clone(),
    };
    all.into_iter().map(of).collect()
}

fn tag(answer: &Answer) -> String {
    answer.headers["etag"].to_str().unwrap().to_owned()
}

async fn send(client: &Client, method: Method, path: &str, body: &Value, tag: &str) -> Answer {
    client.send(client.request(method, path).json(body).header("if-match", tag)).await
}

/// Asks for what the client may have already.
async fn ask(client: &Client, path: &str, known: &str) -> Answer {
    client.send(client.request(Method::GET, path).header("if-none-match", known)).await
}

#[tokio::test]
async fn the_second_of_two_editors_gets_412_with_the_present_tag() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    for each in edited(client).await {
        let path = &each.path;
        let read = tag(&client.get(path).await);
        let first = send(client, Method::PUT, path, &each.content(1), &read).await;
        first.expect(200);
        assert_ne!(tag(&first), read, "{path}");
        // Who has the first edition gets the second, and who has that gets its tag alone.
        ask(client, path, &read).await.expect(200);
        for known in [tag(&first), format!("\"x\", W/{}", tag(&first)), "*".to_owned()] {
            let unchanged = ask(client, path, &known).await;
            assert_eq!(unchanged.expect(304), Value::Null, "{path}: {known}");
            assert_eq!(tag(&unchanged), tag(&first), "{path}");
        }
        ask(client, path, "x").await.problem(400);
        let second = send(client, Method::PUT, path, &each.content(2), &read).await;
        let problem = second.problem(412);
        assert_eq!(problem["type"], "urn:offbd:problem:changed", "{path}");
        assert_eq!(problem["etag"], tag(&first), "{path}");
        assert_eq!(tag(&second), tag(&first), "{path}");
        assert!(problem["detail"].as_str().unwrap().contains(&tag(&first)), "{problem}");
        let now = client.get(path).await;
        assert_eq!(tag(&now), tag(&first), "nothing has changed at {path}");
        if now.json().get("etag").is_some() {
            assert_eq!(now.json()["etag"], tag(&first), "{path}");
        }
        // With the tag of the problem, among others, the editor can go on; a proxy may weaken it.
        let tags = format!("\"x\", W/{}", problem["etag"].as_str().unwrap());
        send(client, Method::PUT, path, &each.content(2), &tags).await.expect(200);
        send(client, Method::PUT, path, &each.content(3), "*").await.expect(200);
        // Without `If-Match`, as ever.
        client.put(path, &each.content(4)).await.expect(200);
        send(client, Method::PUT, path, &each.content(5), "x").await.problem(400);
    }
}

#[tokio::test]
async fn what_somebody_has_changed_is_not_deleted_unseen() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    let all = edited(client).await;
    // Tags are not deleted. A rule is deleted before its channel.
    for each in all.iter().rev().filter(|each| !each.path.ends_with("/tags")) {
        let path = &each.path;
        let read = tag(&client.get(path).await);
        client.put(path, &each.content(1)).await.expect(200);
        let refused = send(client, Method::DELETE, path, &Value::Null, &read).await;
        let now = refused.problem(412)["etag"].as_str().unwrap().to_owned();
        assert_eq!(tag(&client.get(path).await), now, "{path}");
        send(client, Method::DELETE, path, &Value::Null, &now).await.expect(204);
        client.get(path).await.problem(404);
    }
    // Who edits a rig does not register it again after its deletion.
    for tag in ["*", "\"0\""] {
        let refused = send(client, Method::PUT, "assets/a", &rig(2, ""), tag).await;
        assert_eq!(refused.problem(412)["etag"], Value::Null);
    }
    client.get("assets/a").await.problem(404);
}

/// The owner's notes and the mutes of monitors have their entity tags in lists.
#[tokio::test]
async fn notes_and_mutes_are_not_overwritten_unseen() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.put("assets/a", &rig(0, "")).await.expect(201);
    let note = |n: usize| json!({ "text": format!("note {n}") });
    let mute = |n: usize| json!({ "reason": format!("{n}"), "until": hours_from_now(1) });
    let create = async |path: &str, body: &Value| {
        let request = client.request(Method::PUT, path).json(body);
        client.send(request.header("if-none-match", "*")).await
    };
    let listed = async |list: &str| client.get(list).await.json();
    for (list, items, path, content) in [
        ("advice", "notes", "advice/x_servo/note", &note as &dyn Fn(usize) -> Value),
        ("assets/a/mutes", "items", "assets/a/mutes/x_servo", &mute as &dyn Fn(usize) -> Value),
    ] {
        let present = async || listed(list).await[items].clone();
        let refused = send(client, Method::PUT, path, &content(0), "*").await;
        assert_eq!(refused.problem(412)["etag"], Value::Null, "{path}");
        assert_eq!(present().await, json!([]));
        let first = create(path, &content(0)).await;
        first.expect(200);
        let read = tag(&first);
        assert_eq!(present().await[0]["etag"], read, "{path}");
        // Who thinks that there is none gets the tag of the one there is.
        assert_eq!(create(path, &content(1)).await.problem(412)["etag"], read, "{path}");
        let second = send(client, Method::PUT, path, &content(1), &read).await;
        second.expect(200);
        let refused = send(client, Method::PUT, path, &content(2), &read).await;
        assert_eq!(refused.problem(412)["etag"], tag(&second), "{path}");
        assert_eq!(present().await[0]["etag"], tag(&second), "{path}");
        // As ever without a condition.
        client.put(path, &content(3)).await.expect(200);
    }
    let stale = send(client, Method::DELETE, "assets/a/mutes/x_servo", &Value::Null, "\"0\"").await;
    let now = stale.problem(412)["etag"].as_str().unwrap().to_owned();
    send(client, Method::DELETE, "assets/a/mutes/x_servo", &Value::Null, &now).await.expect(204);
    assert_eq!(listed("assets/a/mutes").await["items"], json!([]));
    create("assets/a", &rig(1, "")).await.problem(412);
    // Conditions that are malformed or cannot hold.
    for (matching, none_matching) in [(None, "\"x\""), (Some(""), "*"), (Some("\"x\""), "*")] {
        let request = client.request(Method::PUT, "assets/a").json(&rig(1, ""));
        let request = request.header("if-none-match", none_matching);
        let request = match matching {
            Some(matching) => request.header("if-match", matching),
            None => request,
        };
        client.send(request).await.problem(400);
    }
}

/// All have read the same edition, or none, and send at the same time.
#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn exactly_one_of_many_simultaneous_notes_and_mutes_is_kept() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.put("assets/a", &rig(0, "")).await.expect(201);
    for path in ["advice/x_servo/note", "assets/a/mutes/x_servo"] {
        let mut read = None;
        for round in 0..5 {
            let editors: Vec<_> = (0..16)
                .map(|n| {
                    let body = match path.starts_with("advice") {
                        true => json!({ "text": format!("{round} {n}") }),
                        false => {
                            json!({ "reason": format!("{round} {n}"), "until": hours_from_now(1) })
                        }
                    };
                    let request = client.request(Method::PUT, path).json(&body);
                    let request = match &read {
                        Some(tag) => request.header("if-match", tag),
                        None => request.header("if-none-match", "*"),
                    };
                    let client = client.clone();
                    tokio::spawn(async move { client.send(request).await })
                })
                .collect();
            let mut made = succeeded(editors).await;
            assert_eq!(made.len(), 1, "{path}, round {round}");
            read = made.pop();
        }
    }
}

/// The entity tags that the changes have made; the others are refused.
async fn succeeded(editors: Vec<tokio::task::JoinHandle<Answer>>) -> Vec<String> {
    let mut made = Vec::new();
    for editor in editors {
        let answer = editor.await.unwrap();
        match answer.status.as_u16() {
            200 => made.push(tag(&answer)),
            _ => drop(answer.problem(412)),
        }
    }
    made
}

/// All have read the same edition, and send at the same time.
#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn exactly_one_of_many_simultaneous_editors_succeeds() {
    const EDITORS: usize = 16;
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    for each in edited(client).await {
        for round in 0..5 {
            let read = tag(&client.get(&each.path).await);
            let editors: Vec<_> = (1..=EDITORS)
                .map(|n| {
                    let (client, each, read) = (client.clone(), each.clone(), read.clone());
                    tokio::spawn(async move {
                        let content = each.content(100 * (round + 1) + n);
                        send(&client, Method::PUT, &each.path, &content, &read).await
                    })
                })
                .collect();
            let made = succeeded(editors).await;
            assert_eq!(made, [tag(&client.get(&each.path).await)], "{each:?}");
        }
    }
}

#[test]
fn the_tag_changes_exactly_when_the_content_does() {
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let fixture = runtime.block_on(ServiceFixture::start());
    let client = &fixture.client;
    let all = runtime.block_on(edited(client));
    let steps = proptest::collection::vec((0..all.len(), 0..4_usize, any::<bool>()), 1..12);
    let mut runner = TestRunner::new(Cases::with_cases(20));
    let result = runner.run(&steps, |steps| {
        runtime.block_on(async {
            // The content by its tag and the tag by its content, of everything.
            let (mut contents, mut tags) = (BTreeMap::new(), BTreeMap::new());
            for (which, n, is_named) in steps {
                let each = &all[which];
                let before = tag(&client.get(&each.path).await);
                let condition = if is_named { before.as_str() } else { "*" };
                let put = send(client, Method::PUT, &each.path, &each.content(n), condition).await;
                put.expect(200);
                for other in &all {
                    let now = client.get(&other.path).await;
                    let mut content = now.json();
                    // Not what is edited: where it is, and what happens with it.
                    for key in ["etag", "channel_name", "pending", "given_up"] {
                        content.as_object_mut().unwrap().remove(key);
                    }
                    let (key, content) = ((other.path.clone(), tag(&now)), content.to_string());
                    let of_tag = contents.entry(key).or_insert_with(|| content.clone());
                    prop_assert_eq!(&*of_tag, &content);
                    let key = (other.path.clone(), content);
                    let of_content = tags.entry(key).or_insert_with(|| tag(&now));
                    prop_assert_eq!(&*of_content, &tag(&now));
                }
                prop_assert_eq!(tag(&put), tag(&client.get(&each.path).await));
            }
            Ok(())
        })
    });
    result.unwrap();
}
