//! Tags of rigs: set, listed, as a filter, and deleted with the rig.

use crate::support::{Client, ServiceFixture, rig};
use serde_json::{Value, json};

/// The values of `key` of the items of a list.
async fn listed(client: &Client, path: &str, key: &str) -> Vec<String> {
    let page = client.get(path).await.expect(200);
    let word = |item: &Value| item[key].as_str().unwrap().to_owned();
    page["items"].as_array().unwrap().iter().map(word).collect()
}

async fn tag(client: &Client, asset: &str, tags: &[&str]) {
    client.put(&format!("assets/{asset}/tags"), &json!({ "tags": tags })).await.expect(200);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn lists_are_filtered_by_a_tag() {
    let mut fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    for asset in ["a", "b", "c"] {
        client.asset(asset).await;
        client.telemetry(asset, Some("sick"), &rig(2000, 300)).await;
    }
    tag(client, "a", &["hall-2", "Prüfstand", "hall-2"]).await;
    tag(client, "b", &["hall-2"]).await;
    tag(client, "c", &["hall-20"]).await;
    fixture.restart().await;
    let client = &fixture.client;
    let tags = client.get("assets/a/tags").await.expect(200);
    assert_eq!(tags, json!({ "tags": ["Prüfstand", "hall-2"] }));
    let fleet = client.get("fleet?name=a").await.expect(200);
    assert_eq!(fleet["items"][0]["tags"], tags["tags"]);
    assert_eq!(listed(client, "fleet?tag=hall-2", "asset").await, ["a", "b"]);
    assert_eq!(listed(client, "sessions?tag=hall-20", "asset").await, ["c"]);
    let mut failing = listed(client, "alarms?state=failing&code=x_servo&tag=hall-2", "asset").await;
    failing.sort();
    assert_eq!(failing, ["a", "b"]);
    assert_eq!(listed(client, "fleet?tag=hall", "asset").await, [] as [&str; 0]);
    let in_use = client.get("tags").await.expect(200);
    let count = |tag: &str| {
        let items = in_use["items"].as_array().unwrap();
        items.iter().find(|item| item["tag"] == tag).unwrap()["assets"].clone()
    };
    assert_eq!((count("hall-2"), count("hall-20")), (json!(2), json!(1)));
}

#[tokio::test]
async fn the_tags_in_use_come_page_by_page() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    tag(client, "a", &["x", "y", "z"]).await;
    let (mut paged, mut cursor) = (Vec::new(), String::new());
    loop {
        let page = client.get(&format!("tags?limit=1{cursor}")).await.expect(200);
        paged.push(page["items"][0]["tag"].clone());
        let Some(next) = page["next"].as_str() else { break };
        cursor = format!("&cursor={next}");
    }
    assert_eq!(paged, ["x", "y", "z"]);
    client.get("tags?cursor=nonsense").await.problem(400);
}

#[tokio::test]
async fn a_wrong_tag_is_named_and_changes_nothing() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    tag(client, "a", &["hall-2"]).await;
    let path = "assets/a/tags";
    for wrong in ["", "two words", "a/b", "a\tb", &"x".repeat(51)] {
        let tags = json!({ "tags": ["fine", wrong] });
        assert_eq!(client.put(path, &tags).await.problem(422)["pointer"], "/tags/1", "{wrong}");
    }
    let many: Vec<_> = (0..21).map(|i| format!("t{i}")).collect();
    let problem = client.put(path, &json!({ "tags": many })).await.problem(422);
    assert_eq!(problem["pointer"], "/tags");
    client.put("assets/nobody/tags", &json!({ "tags": [] })).await.problem(404);
    client.get("assets/nobody/tags").await.problem(404);
    assert_eq!(client.get(path).await.expect(200), json!({ "tags": ["hall-2"] }));
    tag(client, "a", &[]).await;
    assert_eq!(client.get("tags").await.expect(200)["items"], json!([]));
}

#[tokio::test]
async fn tags_are_deleted_with_their_rig() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    tag(client, "a", &["hall-2"]).await;
    client.delete("assets/a").await.expect(204);
    assert_eq!(client.get("tags").await.expect(200)["items"], json!([]));
    client.asset("a").await;
    assert_eq!(client.get("assets/a/tags").await.expect(200), json!({ "tags": [] }));
}

#[tokio::test]
async fn a_rule_may_name_a_tag() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    let hook = json!({ "name": "hook", "webhook": { "url": "https://hooks.example/" } });
    let channel = client.post("notifications/channels", &hook).await.expect(201);
    let mut rule = json!({ "name": "r", "channel": channel["id"], "tag": "hall 2" });
    let problem = client.post("notifications/rules", &rule).await.problem(422);
    assert_eq!(problem["pointer"], "/tag");
    rule["tag"] = json!("hall-2");
    let made = client.post("notifications/rules", &rule).await.expect(201);
    assert_eq!(made["tag"], "hall-2");
}
