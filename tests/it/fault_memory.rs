//! The fault memory over the API: it is complete across sessions and restarts, and every
//! change is an event.

use crate::support::{Client, Events, ServiceFixture, connection, rig, url};
use offbd_core::vocabulary::Sample;
use serde_json::{Value, json};
use sqlx::Executor;

async fn fault(client: &Client, asset: &str, code: &str) -> Value {
    client.get(&format!("assets/{asset}/faults/{code}")).await.expect(200)
}

/// The weight of a kind changes while its fault lasts: everywhere it is the present one.
#[tokio::test]
async fn a_session_and_its_fault_give_a_kind_the_same_weight() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    client.telemetry("a", Some("s"), &rig(1500, 300)).await;
    let session = client.end("a", "s").await;
    let of_session = session["verdict"]["monitors"][0].clone();
    let faults = client.get("assets/a/faults?status=all").await.expect(200);
    let faults = faults["items"].as_array().unwrap();
    let of_fault = faults.iter().find(|fault| fault["code"] == "x_servo").unwrap();
    assert_eq!(of_session["code"], "x_servo");
    assert_eq!(of_session["candidates"], of_fault["candidates"], "{session}\n{of_fault}");
    let kinds = of_session["kinds"].as_array().unwrap();
    let last = &kinds[kinds.len() - 1];
    let candidates = of_fault["candidates"].as_array().unwrap();
    let present = candidates.iter().find(|candidate| candidate["kind"] == last["kind"]).unwrap();
    assert_eq!(last["weight"], present["weight"], "{of_session}");
}

#[tokio::test]
async fn the_version_of_sovd_leads_to_the_rigs() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    let info = client.get("/sovd/version-info").await.expect(200);
    let root = client.get(info["sovd_info"][0]["base_uri"].as_str().unwrap()).await.expect(200);
    let components = client.get(root["components"].as_str().unwrap()).await.expect(200);
    let rig = client.get(components["items"][0]["href"].as_str().unwrap()).await.expect(200);
    assert_eq!(rig["id"], "a");
}

/// The adapter for SOVD names the recording of a fault as long as there is one.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_fault_of_sovd_refers_to_its_recording() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    client.telemetry("a", Some("first"), &rig(1500, 300)).await;
    client.end("a", "first").await;
    client.telemetry("a", Some("last"), &rig(1500, 300)).await;
    client.end("a", "last").await;
    let fault = "/sovd/v1/components/a/faults/x_servo";
    let snapshots = async || {
        let detail = client.get(fault).await.expect(200);
        detail["environment_data"]["snapshots"].as_array().unwrap().clone()
    };
    let [frame, recording] = &snapshots().await[..] else { panic!("two snapshots") };
    assert_eq!(frame["type"], "freeze_frame");
    assert_eq!((&recording["type"], &recording["name"]), (&json!("recording"), &json!("last")));
    let csv = client.get(recording["bulk_data_uri"].as_str().unwrap()).await;
    assert_eq!((csv.status.as_u16(), csv.text.lines().count()), (200, 1501));
    let id = client.session("a", "last").await["id"].as_str().unwrap().to_owned();
    client.delete(&format!("sessions/{id}")).await.expect(204);
    assert_eq!(snapshots().await, std::slice::from_ref(frame));
}

/// The adapter for SOVD has no pages, and says where the rest is.
#[tokio::test]
async fn the_recordings_of_sovd_name_the_list_of_older_ones() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    client.telemetry("a", Some("s"), &rig(10, 10)).await;
    client.end("a", "s").await;
    let path = "/sovd/v1/components/a/bulk-data/recordings";
    let all = client.get(path).await.expect(200);
    assert_eq!((all["items"].as_array().unwrap().len(), all.get("x-offbd-next")), (1, None));
    let more = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < 503)
        INSERT INTO session (id, asset, name, state, opened_at, ended_at, setup, baseline,
            n_samples, n_rejected, verdict, verdict_hash)
        SELECT s.id || '-' || CAST(n.i AS TEXT), s.asset, s.name || CAST(n.i AS TEXT), s.state,
            s.opened_at, s.ended_at, s.setup, s.baseline, s.n_samples, s.n_rejected, s.verdict,
            s.verdict_hash FROM session s, n";
    fixture.store().await.execute(more).await.unwrap();
    let latest = client.get(path).await.expect(200);
    assert_eq!(latest["items"].as_array().unwrap().len(), 500);
    let rest = client.get(latest["x-offbd-next"].as_str().unwrap()).await.expect(200);
    assert_eq!((rest["items"].as_array().unwrap().len(), &rest["next"]), (4, &Value::Null));
}

/// Returns the fault without the key that depends on the wall clock.
fn without_changed_at(fault: &Value) -> Value {
    let mut fault = fault.clone();
    fault.as_object_mut().unwrap().remove("changed_at");
    fault
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_fault_record_is_complete_and_unchanged_after_a_restart() {
    let mut fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    fixture.client.telemetry("a", Some("s"), &rig(2000, 300)).await;
    let session = fixture.client.session("a", "s").await;
    let x = fault(&fixture.client, "a", "x_servo").await;
    assert_eq!(x["status_byte"], "2F");
    let bits = &x["status_bits"];
    for (bit, set) in [
        ("test_failed", true),
        ("confirmed", true),
        ("test_not_completed_since_last_clear", false),
        ("warning_indicator_requested", false),
    ] {
        assert_eq!(bits[bit], set, "{bit}: {bits}");
    }
    assert_eq!((&x["occurrences"], &x["failed_cycles"]), (&json!(1), &json!(1)));
    assert_eq!(x["first_onset_s"], x["last_onset_s"]);
    assert!((2.5..6.0).contains(&x["first_onset_s"].as_f64().unwrap()), "{x}");
    assert_eq!(x["first_occurrence"], x["last_occurrence"]);
    assert_eq!(x["last_occurrence"]["session"], "s");
    assert_eq!(x["last_occurrence"]["session_id"], session["id"]);
    assert_eq!((&x["healing_counter"], &x["healing_cycles"]), (&json!(0), &json!(3)));
    assert_eq!((&x["aging_counter"], &x["aging_cycles"]), (&json!(0), &json!(40)));
    assert_eq!((&x["acknowledgement"], &x["cleared"]), (&Value::Null, &Value::Null));
    assert_eq!((&x["monitor"]["counter"], &x["monitor"]["code"]), (&json!(127), &json!("x_servo")));
    assert_eq!(x["monitor"]["complete_this_cycle"], true);
    let path = "assets/a/faults/x_servo/acknowledge?by=";
    fixture.client.post(&format!("{path}ann"), &Value::Null).await.expect(200);
    let again = fixture.client.post(&format!("{path}bob"), &Value::Null).await.expect(200);
    assert_eq!(again["acknowledgement"]["by"], "ann", "only the first acknowledgement counts");
    let before = fault(&fixture.client, "a", "x_servo").await;
    fixture.restart().await;
    let after = fault(&fixture.client, "a", "x_servo").await;
    assert_eq!(
        after["monitor"],
        Value::Null,
        "no engine is loaded, and none is stored since the acknowledgement"
    );
    assert_eq!(after["session_open"], true);
    fixture.client.load("a").await;
    assert_eq!(fault(&fixture.client, "a", "x_servo").await, before);
    for (key, value) in before.as_object().unwrap().iter().filter(|(key, _)| *key != "monitor") {
        assert_eq!(&after[key], value, "{key}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn in_use_counts_are_updated_per_session_and_survive_clearing() {
    let mut fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    // A minute with a moving ball; 0.3 s, which is shorter than the 0.4 s that the
    // confirmation of any fault takes; and a minute without a ball.
    let unseen: Vec<Sample> =
        rig(6000, 6000).iter().map(|s| Sample { x_m: None, y_m: None, ..*s }).collect();
    for (name, samples) in [("one", &rig(6000, 6000)), ("two", &rig(30, 30)), ("three", &unseen)] {
        fixture.client.telemetry("a", Some(name), samples).await;
        fixture.client.end("a", name).await;
    }
    let ratio = |fault: &Value| {
        let in_use = &fault["in_use"];
        let count = |key: &str| in_use[key].as_u64().unwrap();
        let counts = ["operation_cycles", "cycles_with_data", "cycles_judged"].map(count);
        (counts, in_use["ratio"].as_f64())
    };
    let x = fault(&fixture.client, "a", "x_servo").await;
    assert_eq!(ratio(&x), ([3, 1, 1], Some(1.0)));
    assert_eq!((&x["monitor"], &x["session_open"]), (&Value::Null, &json!(false)));
    let sensor = fault(&fixture.client, "a", "sensor").await;
    assert_eq!(ratio(&sensor), ([3, 2, 1], Some(0.5)), "nobody may have put the ball down");
    fixture.client.delete("assets/a/faults/x_servo?by=ann").await.expect(204);
    fixture.restart().await;
    let x = fault(&fixture.client, "a", "x_servo").await;
    assert_eq!(ratio(&x), ([3, 1, 1], Some(1.0)));
    assert_eq!((&x["status_byte"], &x["cleared"]["by"]), (&json!("50"), &json!("ann")));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_failure_in_a_later_session_is_a_new_occurrence_and_resets_healing() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    client.telemetry("a", Some("sick"), &rig(2000, 300)).await;
    client.end("a", "sick").await;
    let sick = fault(client, "a", "x_servo").await;
    client.telemetry("a", Some("well"), &rig(6000, 6000)).await;
    client.end("a", "well").await;
    let well = fault(client, "a", "x_servo").await;
    assert_eq!((&well["status"], &well["healing_counter"]), (&json!("confirmed"), &json!(1)));
    assert_eq!(well["freeze_frame"], sick["freeze_frame"]);
    client.telemetry("a", Some("sick again"), &rig(2000, 600)).await;
    let again = fault(client, "a", "x_servo").await;
    assert_eq!((&again["occurrences"], &again["healing_counter"]), (&json!(2), &json!(0)));
    assert_eq!(again["first_occurrence"], sick["first_occurrence"]);
    assert_eq!(again["last_occurrence"]["session"], "sick again");
    assert_eq!(again["first_onset_s"], sick["first_onset_s"]);
    assert!(again["last_onset_s"].as_f64() > again["first_onset_s"].as_f64());
    assert_ne!(again["freeze_frame"], sick["freeze_frame"]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_code_cleared_while_no_session_is_open_is_an_event() {
    let mut fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    fixture.client.telemetry("a", Some("s"), &rig(2000, 300)).await;
    fixture.client.end("a", "s").await;
    let stream = fixture.client.request(reqwest::Method::GET, "events?asset=a").send().await;
    let mut live = Events::new(stream.unwrap());
    fixture.client.delete("assets/a/faults/sensor?by=ann").await.expect(204);
    fixture.client.delete("assets/a/faults/x_servo?by=ann").await.expect(204);
    let cleared = live.next().await;
    assert_eq!((&cleared["type"], &cleared["asset"]), (&json!("fault"), &json!("a")));
    assert_eq!(cleared["code"], "x_servo", "clearing the sensor changed nothing");
    assert_eq!((&cleared["status"], &cleared["status_byte"]), (&json!("cleared"), &json!("50")));
    for key in ["session", "session_id", "t_s"] {
        assert_eq!(cleared.get(key), Some(&Value::Null), "{key}");
    }
    assert_eq!(cleared["by"], "ann");
    fixture.client.delete("assets/a/faults/x_servo?by=bob").await.expect(204);
    fixture.restart().await;
    // A subscriber that was away gets the event once, in its order.
    let after = cleared["id"].as_i64().unwrap() - 1;
    let path = format!("events?asset=a&after={after}");
    let stream = fixture.client.request(reqwest::Method::GET, &path).send().await;
    let mut missed = Events::new(stream.unwrap());
    assert_eq!(missed.next().await, cleared);
    fixture.client.telemetry("a", Some("t"), &rig(2000, 300)).await;
    assert_eq!(missed.next().await["session"], "t", "clearing a cleared code is not an event");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_fault_names_the_calibration_and_the_settings_that_judged_it() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    let judged = |asset: Value| {
        let client = client.clone();
        async move {
            let name = asset["name"].as_str().unwrap().to_owned();
            client.post("assets", &asset).await.expect(201);
            client.telemetry(&name, Some("s"), &rig(2000, 300)).await;
            let fault = fault(&client, &name, "x_servo").await;
            without_changed_at(&fault)["last_occurrence"].clone()
        }
    };
    let plain = judged(json!({"name": "plain"})).await;
    assert_eq!(plain["calibration_id"], Value::Null);
    let same = judged(json!({"name": "same"})).await;
    assert_eq!(same["settings_id"], plain["settings_id"]);
    let slow = judged(json!({"name": "slow", "diagnostics": {"debounce_s": 1.0}})).await;
    assert_ne!(slow["settings_id"], plain["settings_id"]);
    let axis = json!({"gain": 1.0, "dead_time_s": 0.04, "lag_s": 0.06, "level_rad": 0.0,
        "noise_m": 2e-4, "breakaway_rad": 0.001, "residual_m_s2": 0.02});
    let learnt = json!({"made_at": "2026-01-01T00:00:00Z", "data_sha256": "00", "samples": 1,
        "duration_s": 1.0, "x": axis, "y": axis});
    let calibrated = judged(json!({"name": "learnt", "calibration": learnt})).await;
    let asset = client.get("assets/learnt").await.expect(200);
    assert_eq!(calibrated["calibration_id"], asset["calibration"]["id"]);
    assert_eq!(calibrated["settings_id"], plain["settings_id"]);
    // The events have the same ids.
    let stream = client.request(reqwest::Method::GET, "events?asset=learnt&after=0").send().await;
    let event = Events::new(stream.unwrap()).next().await;
    assert_eq!(event["calibration_id"], calibrated["calibration_id"]);
    assert_eq!(event["settings_id"], calibrated["settings_id"]);
}

/// Returns a column of a recording.
fn column<'a>(recording: &'a Value, name: &str) -> &'a Vec<Value> {
    recording["columns"][name].as_array().unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_recording_of_a_fault_equals_what_was_judged() {
    let mut fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    // Without sequence numbers, samples wait for earlier ones, also the last ones.
    let samples: Vec<Sample> = rig(3000, 1500).iter().map(|s| Sample { seq: None, ..*s }).collect();
    let events = fixture.client.request(reqwest::Method::GET, "events?asset=a&after=0");
    let mut events = Events::new(events.send().await.unwrap());
    fixture.client.telemetry("a", Some("s"), &samples[..2200]).await;
    let path = "assets/a/faults/x_servo/recording";
    let early = fixture.client.get(path).await.expect(200);
    assert_eq!(early["complete"], false, "the session is open");
    fixture.client.telemetry("a", Some("s"), &samples[2200..]).await;
    fixture.client.end("a", "s").await;
    fixture.restart().await;
    let client = &fixture.client;
    let recording = client.get(path).await.expect(200);
    assert_eq!((&recording["complete"], &recording["session"]), (&json!(true), &json!("s")));
    let time = |name: &str| recording[name].as_f64().unwrap();
    assert!(time("onset_s") < time("failed_s") && time("failed_s") < time("confirmed_s"));
    assert_eq!(time("from_s"), time("onset_s") - 10.0);
    assert_eq!(time("to_s"), time("confirmed_s") + 10.0);
    let within = |s: &&Sample| (time("from_s")..=time("to_s")).contains(&s.t_s);
    let wanted: Vec<&Sample> = samples.iter().filter(within).collect();
    let sent = |of: fn(&Sample) -> Option<f64>| wanted.iter().map(|s| json!(of(s))).collect();
    let sent: [Vec<Value>; 3] = [sent(|s| Some(s.t_s)), sent(|s| s.cmd_qy_rad), sent(|s| s.x_m)];
    for (name, sent) in ["t_s", "cmd_qy_rad", "x_m"].iter().zip(&sent) {
        assert_eq!(column(&recording, name), sent, "{name}");
    }
    let n_early = column(&early, "t_s").len();
    assert_eq!(column(&early, "x_twin_m_s2")[..], column(&recording, "x_twin_m_s2")[..n_early]);
    // The rows at the times of the events have the evidence of the events.
    for _ in 0..2 {
        let event = loop {
            let event = events.next().await;
            if event["code"] == "x_servo" {
                break event;
            }
        };
        let at = sent[0].iter().position(|t_s| *t_s == event["t_s"]).unwrap();
        let seen = &event["evidence"]["x"];
        for name in ["measured_m_s2", "twin_m_s2", "residual_m_s2", "limit_m_s2", "enabled"] {
            assert_eq!(column(&recording, &format!("x_{name}"))[at], seen[name], "{name}");
        }
        let number = |name: &str| seen[name].as_f64().unwrap();
        let beyond = number("residual_m_s2").abs() > number("limit_m_s2");
        assert!(beyond || number("nats") >= 10.0, "{seen}");
    }
    let request = client.request(reqwest::Method::GET, &format!("{path}?before_s=0&after_s=1"));
    let csv = client.send(request.header("accept", "text/csv")).await;
    assert_eq!(csv.headers["content-type"], "text/csv; charset=utf-8");
    let mut lines = csv.text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    assert_eq!(header.len(), recording["columns"].as_object().unwrap().len());
    let n =
        wanted.iter().filter(|s| (time("onset_s")..=time("confirmed_s") + 1.0).contains(&s.t_s));
    assert_eq!(lines.clone().count(), n.count());
    let first: Vec<&str> = lines.next().unwrap().split(',').collect();
    let at = wanted.iter().position(|s| s.t_s == first[0].parse::<f64>().unwrap()).unwrap();
    for (name, cell) in header.iter().zip(first) {
        let value = &column(&recording, name)[at];
        assert_eq!(if value.is_null() { String::new() } else { value.to_string() }, cell, "{name}");
    }
    assert_eq!(
        client.get(&format!("{path}?before_s=61")).await.problem(400)["parameter"],
        "before_s"
    );
    assert_eq!(
        client.get("assets/a/faults/sensor/recording").await.problem(404)["type"],
        "urn:offbd:problem:no-recording"
    );
    let session = client.session("a", "s").await;
    client.delete(&format!("sessions/{}", session["id"].as_str().unwrap())).await.expect(204);
    client.get(path).await.problem(404);
}

/// The failure is found regardless of the number of earlier transitions of other codes.
#[tokio::test(flavor = "multi_thread")]
async fn a_recording_is_found_after_ten_thousand_other_transitions() {
    let fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    fixture.client.telemetry("a", Some("s"), &rig(1500, 500)).await;
    fixture.client.end("a", "s").await;
    let path = "assets/a/faults/x_servo/recording";
    let before = fixture.client.get(path).await.expect(200);
    let mut store = connection(&url(fixture.data.path())).await;
    for statement in [
        "UPDATE transition SET ordinal = ordinal + 20000",
        "WITH RECURSIVE count (n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM count WHERE n < 10001)
         INSERT INTO transition (id, asset, session, ordinal, t_s, code, status, at, document)
         SELECT -n, asset, session, n, t_s, 'sensor', status, at, document
         FROM count, (SELECT * FROM transition ORDER BY id LIMIT 1) AS first",
    ] {
        sqlx::query(statement).execute(&mut store).await.unwrap();
    }
    assert_eq!(fixture.client.get(path).await.expect(200), before);
}

/// Who acknowledged a fault is known for as long as the asset, also if the acknowledgement
/// changed no status and its session is deleted.
#[tokio::test]
async fn actions_of_people_outlive_the_recording() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    client.telemetry("a", Some("s"), &rig(1500, 500)).await;
    let acknowledge = "assets/a/faults/x_servo/acknowledge?by=";
    for person in ["ann", "bob"] {
        client.post(&format!("{acknowledge}{person}"), &json!(null)).await.expect(200);
    }
    let id = client.end("a", "s").await["id"].as_str().unwrap().to_owned();
    client.delete(&format!("sessions/{id}")).await.expect(204);
    let history = client.get("assets/a/faults/x_servo/history").await.expect(200);
    let entries = history["items"].as_array().unwrap();
    let acts: Vec<_> = entries.iter().map(|entry| (&entry["by"], &entry["session_id"])).collect();
    assert_eq!(acts, [(&json!("bob"), &json!(null)), (&json!("ann"), &json!(null))]);
}
