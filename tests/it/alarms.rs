//! The alarms of the fleet: faults, lost communication, mutes, and what to do.

use crate::support::{
    Client, Events, ServiceFixture, eventually, hours_from_now, registration, rig,
};
use serde_json::{Value, json};

async fn alarms(client: &Client, query: &str) -> Vec<Value> {
    let page = client.get(&format!("alarms{query}")).await.expect(200);
    page["items"].as_array().unwrap().clone()
}

/// Asset and code of each alarm.
fn keys(alarms: &[Value]) -> Vec<(String, String)> {
    let word = |alarm: &Value, key: &str| alarm[key].as_str().unwrap().to_owned();
    let mut keys: Vec<_> = alarms.iter().map(|a| (word(a, "asset"), word(a, "code"))).collect();
    keys.sort();
    keys
}

/// A service with a rig that fails, and one that failed and passes again.
async fn with_faults() -> ServiceFixture {
    let fixture = ServiceFixture::start().await;
    for asset in ["failing", "repaired"] {
        fixture.client.asset(asset).await;
        fixture.client.telemetry(asset, Some("sick"), &rig(2000, 300)).await;
    }
    fixture.client.end("repaired", "sick").await;
    fixture.client.telemetry("repaired", Some("well"), &rig(6000, 6000)).await;
    fixture
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_list_tells_what_fails_now_from_what_is_on_record() {
    let mut fixture = with_faults().await;
    let failing = alarms(&fixture.client, "?state=failing&code=x_servo").await;
    assert_eq!(keys(&failing), [("failing".to_owned(), "x_servo".to_owned())]);
    let on_record = alarms(&fixture.client, "?state=on_record&code=x_servo").await;
    assert_eq!(keys(&on_record), [("repaired".to_owned(), "x_servo".to_owned())]);
    let [alarm] = &failing[..] else { unreachable!() };
    assert_eq!((&alarm["status"], &alarm["failing"]), (&json!("confirmed"), &json!(true)));
    assert_eq!(alarm["evidence"], json!({ "state": "complete", "reason": null }));
    let fault = fixture.client.get("assets/failing/faults/x_servo").await.expect(200);
    assert_eq!(alarm["since"], fault["last_occurrence"]["noted_at"]);
    // The time range is of the last change.
    let at = alarm["changed_at"].as_str().unwrap();
    let within = format!("?asset=failing&code=x_servo&from={at}&to={at}");
    assert_eq!(alarms(&fixture.client, &within).await, failing);
    assert_eq!(alarms(&fixture.client, "?to=2001-01-01T00:00:00Z").await, [] as [Value; 0]);
    assert_eq!(alarms(&fixture.client, "?from=2999-01-01T00:00:00Z").await, [] as [Value; 0]);
    fixture.client.get("alarms?from=yesterday").await.problem(400);
    fixture.client.get("alarms?state=broken").await.problem(400);
    // What came before a restart is there, page by page.
    let all = alarms(&fixture.client, "?state=all").await;
    fixture.restart().await;
    let (mut paged, mut cursor) = (Vec::new(), String::new());
    loop {
        let path = format!("alarms?state=all&limit=1{cursor}");
        let page = fixture.client.get(&path).await.expect(200);
        paged.extend(page["items"].as_array().unwrap().clone());
        let Some(next) = page["next"].as_str() else { break };
        cursor = format!("&cursor={next}");
    }
    assert_eq!(paged, all);
    assert!(all.len() >= 2);
}

/// A new session does not know yet what an earlier one has found.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_failure_of_an_earlier_session_is_not_tested_in_a_new_one() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("bench").await;
    client.telemetry("bench", Some("sick"), &rig(2000, 300)).await;
    let told = async || {
        let alarms = alarms(client, "?asset=bench&code=x_servo").await;
        let fleet = client.get("fleet").await.expect(200);
        let faults = fleet["items"][0]["faults"].as_array().unwrap();
        let fault = faults.iter().find(|fault| fault["code"] == "x_servo").unwrap().clone();
        [&alarms[0], &fault].map(|told| (told["failing"].clone(), told["tested"].clone()))
    };
    assert_eq!(told().await, [(json!(true), json!(true)), (json!(true), json!(true))]);
    let open =
        async || alarms(client, "?asset=bench&code=x_servo").await[0]["session_open"].clone();
    assert_eq!(open().await, true);
    client.end("bench", "sick").await;
    assert_eq!(open().await, false);
    client.telemetry("bench", Some("new"), &rig(20, 6000)).await;
    assert_eq!(told().await, [(json!(true), json!(false)), (json!(true), json!(false))]);
    assert_eq!(open().await, true);
}

/// Without a calibration, a fault of a servo is suspected only.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn suspected_faults_are_not_among_the_failing_ones() {
    let fixture = with_faults().await;
    let client = &fixture.client;
    let mut unlearnt = registration("suspect");
    unlearnt.as_object_mut().unwrap().remove("calibration");
    client.post("assets", &unlearnt).await.expect(201);
    client.telemetry("suspect", Some("sick"), &rig(2000, 300)).await;
    let suspected = alarms(client, "?state=suspected&code=x_servo").await;
    assert_eq!(keys(&suspected), [("suspect".to_owned(), "x_servo".to_owned())]);
    let told = (&suspected[0]["status"], &suspected[0]["failing"]);
    assert_eq!(told, (&json!("pending"), &json!(true)));
    let failing = alarms(client, "?state=failing&code=x_servo").await;
    assert_eq!(keys(&failing), [("failing".to_owned(), "x_servo".to_owned())]);
    assert_eq!(alarms(client, "?state=active&code=x_servo").await.len(), 3);
}

/// What failed when its data stopped is not known to fail now.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_alarms_and_faults_of_a_silent_rig_tell_since_when_it_is_silent() {
    let fixture = ServiceFixture::start_with(|config| {
        config.communication.lost_after_s = 1;
        config.communication.back_after_s = 0;
    })
    .await;
    let client = &fixture.client;
    for asset in ["a", "b"] {
        client.asset(asset).await;
    }
    let samples = rig(9000, 300);
    client.telemetry("b", Some("s"), &rig(2000, 300)).await;
    client.end("b", "s").await;
    client.telemetry("a", Some("s"), &samples[..2000]).await;
    let path = "assets/a/faults";
    let told = async || {
        let alarm = alarms(client, "?asset=a&code=x_servo").await.remove(0);
        let fault = client.get(&format!("{path}/x_servo")).await.expect(200);
        let listed = client.get(path).await.expect(200)["items"].clone();
        let listed = listed.as_array().unwrap().iter().find(|f| f["code"] == "x_servo").unwrap();
        [&alarm, &fault, listed].map(|told| told["communication_lost_since"].clone())
    };
    let silent = "?asset=a&code=communication_lost&state=failing";
    let lost = eventually(async || alarms(client, silent).await.pop()).await;
    assert_eq!(lost["since"], lost["communication_lost_since"]);
    assert_eq!(told().await, [&lost["since"]; 3].map(Value::clone));
    let ended = alarms(client, "?asset=b&code=x_servo").await.remove(0);
    assert_eq!(ended["communication_lost_since"], Value::Null);
    // One batch may be followed by the next silence before anybody looks.
    let sent = std::cell::Cell::new(2000);
    eventually(async || {
        let next = (sent.get() + 10).min(samples.len());
        client.telemetry("a", Some("s"), &samples[sent.replace(next)..next]).await;
        let again = told().await;
        again.iter().all(|since| *since != lost["since"]).then_some(())
    })
    .await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn several_alarms_are_acknowledged_at_once() {
    let fixture = with_faults().await;
    let client = &fixture.client;
    let wanted = json!({ "alarms": [
        { "asset": "failing", "code": "x_servo" },
        { "asset": "repaired", "code": "x_servo" },
        { "asset": "nobody", "code": "x_servo" },
        { "asset": "failing", "code": "communication_lost" },
    ] });
    let answer = client.post("alarms/acknowledge?by=ann", &wanted).await.expect(200);
    let items = answer["items"].as_array().unwrap();
    assert_eq!(items[0]["acknowledged"], true, "{answer}");
    for (item, why) in [(&items[2], "nobody"), (&items[3], "no current occurrence")] {
        assert_eq!(item["acknowledged"], false);
        assert!(item["reason"].as_str().unwrap().contains(why), "{answer}");
    }
    let taken = alarms(client, "?acknowledged=true&code=x_servo&state=failing").await;
    assert_eq!(taken[0]["acknowledgement"]["by"], "ann");
    assert_eq!(alarms(client, "?acknowledged=false&code=x_servo&state=failing").await.len(), 0);
    client.post("alarms/acknowledge", &json!({ "alarms": [] })).await.problem(422);
    let alarm = json!({ "asset": "a", "code": "x_servo" });
    let many = json!({ "alarms": vec![alarm; 501] });
    client.post("alarms/acknowledge", &many).await.problem(422);
}

/// Neither a clear nor the deletion of the recording hides what was found.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn missing_evidence_has_a_reason_and_a_clear_removes_none() {
    let fixture = with_faults().await;
    let client = &fixture.client;
    let path = "assets/failing/faults/x_servo";
    let evidence = |history: Value| -> Vec<Value> {
        let items = history["items"].as_array().unwrap().clone();
        items.iter().filter(|e| e["what"] == "confirmed").map(|e| e["fault"].clone()).collect()
    };
    let before = evidence(client.get(&format!("{path}/history")).await.expect(200));
    assert!(before[0]["evidence"]["x"]["nats"].is_number(), "{before:?}");
    client.delete(&format!("{path}?by=ann")).await.expect(204);
    let after = evidence(client.get(&format!("{path}/history")).await.expect(200));
    assert_eq!(after, before);
    let session = client.session("repaired", "sick").await;
    client.delete(&format!("sessions/{}", session["id"].as_str().unwrap())).await.expect(204);
    let alarm = &alarms(client, "?asset=repaired&code=x_servo").await[0];
    assert_eq!(alarm["evidence"]["state"], "partial", "{alarm}");
    assert!(alarm["evidence"]["reason"].as_str().unwrap().contains("deleted"), "{alarm}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_muted_monitor_is_not_tested_and_still_records() {
    let mut fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    let path = "assets/a/mutes/x_servo";
    let mute = json!({ "reason": "new horn", "until": hours_from_now(9000) });
    let problem = client.put(path, &mute).await.problem(422);
    assert_eq!(problem["pointer"], "/until", "longer than a year");
    for (key, value) in [("until", "2001-01-01T00:00:00Z"), ("until", "soon"), ("reason", "")] {
        let mut wrong = json!({ "reason": "new horn", "until": hours_from_now(1) });
        wrong[key] = json!(value);
        assert_eq!(client.put(path, &wrong).await.problem(422)["pointer"], format!("/{key}"));
    }
    let mute = json!({ "reason": "new horn", "until": hours_from_now(1) });
    client.put("assets/a/mutes/z_servo", &mute).await.problem(404);
    client.put("assets/nobody/mutes/x_servo", &mute).await.problem(404);
    client.put(&format!("{path}?by=ann"), &mute).await.expect(200);
    client.telemetry("a", Some("s"), &rig(2000, 300)).await;
    fixture.restart().await;
    let client = &fixture.client;
    let state = client.get("assets/a/state").await.expect(200);
    let monitors = state["monitors"].as_array().unwrap();
    let of = |code: &str| monitors.iter().find(|m| m["code"] == code).unwrap();
    assert_eq!(of("x_servo")["muted"]["by"], "ann");
    assert_eq!(of("x_servo")["muted"]["reason"], "new horn");
    assert_eq!(of("y_servo")["muted"], Value::Null);
    let fleet = client.get("fleet").await.expect(200);
    assert_eq!(fleet["items"][0]["muted"][0]["code"], "x_servo");
    let alarm = &alarms(client, "?code=x_servo").await[0];
    assert_eq!((&alarm["failing"], &alarm["muted"]["by"]), (&json!(true), &json!("ann")));
    assert_eq!(client.get("assets/a/mutes").await.expect(200)["items"][0]["by"], "ann");
    client.delete(path).await.expect(204);
    assert_eq!(client.get("assets/a/mutes").await.expect(200)["items"], json!([]));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_rig_that_falls_silent_is_an_alarm_until_its_data_are_back() {
    let mut fixture = ServiceFixture::start_with(|config| {
        config.communication.lost_after_s = 1;
        config.communication.back_after_s = 0;
    })
    .await;
    let client = fixture.client.clone();
    for asset in ["a", "never", "ended"] {
        client.asset(asset).await;
    }
    let stream = client.request(reqwest::Method::GET, "events?asset=a").send().await.unwrap();
    let mut events = Events::new(stream);
    assert_eq!(events.any().await.0, "begin");
    client.post("assets/never/sessions", &json!({ "name": "s" })).await.expect(201);
    client.telemetry("ended", Some("s"), &rig(100, 100)).await;
    client.end("ended", "s").await;
    let samples = rig(1000, 1000);
    client.telemetry("a", Some("s"), &samples[..100]).await;
    let (kind, lost) = events.any().await;
    assert_eq!((kind.as_str(), &lost["type"]), ("communication", &json!("communication")));
    assert_eq!(
        (&lost["code"], &lost["status"]),
        (&json!("communication_lost"), &json!("confirmed"))
    );
    assert_eq!((&lost["asset"], &lost["session"]), (&json!("a"), &json!("s")));
    let alarm = alarms(&client, "?state=failing").await;
    assert_eq!(keys(&alarm), [("a".to_owned(), "communication_lost".to_owned())]);
    assert_eq!(alarm[0]["since"], lost["since"]);
    let wanted = json!({ "alarms": [{ "asset": "a", "code": "communication_lost" }] });
    let answer = client.post("alarms/acknowledge?by=ann", &wanted).await.expect(200);
    assert_eq!(answer["items"][0]["acknowledged"], true, "{answer}");
    // It is known after a restart, and is not a second event.
    fixture.restart().await;
    let client = fixture.client.clone();
    let fleet = client.get("fleet").await.expect(200);
    assert_eq!(fleet["items"][0]["communication_lost_since"], lost["since"]);
    let alarm = alarms(&client, "?code=communication_lost").await;
    assert_eq!(alarm[0]["acknowledgement"]["by"], "ann");
    let path = format!("events?asset=a&after={}", lost["id"]);
    let stream = client.request(reqwest::Method::GET, &path).send().await.unwrap();
    let mut events = Events::new(stream);
    assert_eq!(events.any().await.0, "begin");
    client.telemetry("a", Some("s"), &samples[100..200]).await;
    let (_, back) = events.any().await;
    assert_eq!((&back["status"], &back["since"]), (&json!("passed"), &lost["since"]), "{back}");
    assert!(back["id"].as_i64() > lost["id"].as_i64());
    // Null, or the time of the next silence.
    let fleet = client.get("fleet").await.expect(200);
    assert_ne!(fleet["items"][0]["communication_lost_since"], lost["since"]);
    let metrics = eventually(async || {
        let text = client.get("/metrics").await.text;
        text.contains("offbd_communication_lost 1").then_some(text)
    })
    .await;
    assert!(!metrics.is_empty(), "the second silence is the next occurrence");
    let alarm = eventually(async || alarms(&client, "?state=failing").await.pop()).await;
    assert_eq!((&alarm["occurrences"], &alarm["acknowledgement"]), (&json!(2), &Value::Null));
    client.end("a", "s").await;
    let (_, lost) = events.any().await;
    assert_eq!(lost["status"], "confirmed");
    let (_, ended) = events.any().await;
    assert!(ended["summary"].as_str().unwrap().contains("ended"), "{ended}");
}

#[tokio::test]
async fn every_alarm_has_advice_and_the_owner_adds_notes() {
    let mut fixture = ServiceFixture::start().await;
    let note = json!({ "text": "Spare horns are in the drawer.\nAsk Ann." });
    let path = "advice/x_servo/note?by=ann";
    let kept = fixture.client.put(path, &note).await.expect(200);
    assert_eq!((&kept["text"], &kept["by"]), (&note["text"], &json!("ann")));
    fixture.client.put("advice/z_servo/note", &note).await.problem(404);
    let long = json!({ "text": "a".repeat(2001) });
    assert_eq!(fixture.client.put(path, &long).await.problem(422)["pointer"], "/text");
    fixture.restart().await;
    let advice = fixture.client.get("advice").await.expect(200);
    assert_eq!(advice["notes"], json!([kept]));
    let dead = advice["items"].as_array().unwrap();
    let dead = dead.iter().find(|a| a["code"] == "x_servo" && a["kind"] == "dead").unwrap();
    assert!(dead["checks"][0].as_str().unwrap().contains("power"), "{dead}");
    fixture.client.put(path, &json!({ "text": " " })).await.expect(200);
    assert_eq!(fixture.client.get("advice").await.expect(200)["notes"], json!([]));
}
