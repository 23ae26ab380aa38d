//! Remarks on a moment or a stretch of a session.

use crate::support::{Client, ServiceFixture, rig};
use serde_json::{Value, json};

/// Records a session and returns the path of its remarks.
async fn recorded(client: &Client) -> String {
    client.asset("a").await;
    client.telemetry("a", Some("s"), &rig(200, 100)).await;
    let id = client.end("a", "s").await["id"].as_str().unwrap().to_owned();
    format!("sessions/{id}/remarks")
}

async fn texts(client: &Client, path: &str) -> Vec<Value> {
    let found = client.get(path).await.expect(200);
    found["items"].as_array().unwrap().iter().map(|item| item["text"].clone()).collect()
}

#[tokio::test]
async fn remarks_are_kept_in_order_of_time_until_they_are_removed() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    let path = recorded(client).await;
    let late = json!({ "text": " new horn ", "from_s": 1.5 });
    let late = client.post(&format!("{path}?by=ann"), &late).await.expect(201);
    assert_eq!((&late["text"], &late["by"]), (&json!("new horn"), &json!("ann")));
    assert_eq!((&late["from_s"], &late["to_s"]), (&json!(1.5), &json!(1.5)));
    let early = json!({ "text": "pushed\nby hand", "from_s": -0.5, "to_s": 0.7 });
    client.post(&path, &early).await.expect(201);
    assert_eq!(texts(client, &path).await, ["pushed\nby hand", "new horn"]);

    let one = format!("{path}/{}", late["id"].as_str().unwrap());
    client.delete(&one).await.expect(204);
    let gone = client.delete(&one).await.problem(404);
    assert_eq!(gone["type"], "urn:offbd:problem:unknown-remark");
    assert_eq!(texts(client, &path).await, ["pushed\nby hand"]);
}

#[tokio::test]
async fn remarks_are_deleted_with_their_session_and_written_to_the_audit_log() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    let path = recorded(client).await;
    client.post(&path, &json!({ "text": "a", "from_s": 0 })).await.expect(201);
    let audit = client.get("audit").await.expect(200);
    let acts = audit["items"].as_array().unwrap().iter().map(|entry| &entry["act"]);
    assert!(acts.into_iter().any(|act| act == "add_remark"), "{audit}");
    let session = path.trim_end_matches("/remarks");
    client.delete(session).await.expect(204);
    client.get(&path).await.problem(404);
    client.post(&path, &json!({ "text": "b", "from_s": 0 })).await.problem(404);
}

#[tokio::test]
async fn an_invalid_remark_is_refused_with_its_element() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    let path = recorded(client).await;
    for (body, pointer) in [
        (json!({ "text": " ", "from_s": 0 }), "/text"),
        (json!({ "text": "x".repeat(2001), "from_s": 0 }), "/text"),
        (json!({ "text": "bell \u{7}", "from_s": 0 }), "/text"),
        (json!({ "text": "a", "from_s": 2, "to_s": 1 }), "/to_s"),
        (json!({ "text": "a" }), "/from_s"),
    ] {
        let problem = client.post(&path, &body).await.problem(422);
        assert_eq!(problem["pointer"], pointer, "{body}: {problem}");
    }
    assert!(texts(client, &path).await.is_empty());
}
