//! The data of the dashboard: the fleet, traces, and the history of a fault.

use crate::support::{ServiceFixture, rig};
use futures_util::StreamExt;
use serde_json::{Value, json};
use tokio_tungstenite::connect_async;

fn numbers(column: &Value) -> Vec<Option<f64>> {
    column.as_array().unwrap().iter().map(Value::as_f64).collect()
}

#[tokio::test]
async fn the_fleet_lists_sessions_faults_and_lag_of_every_asset() {
    let mut fixture = ServiceFixture::start().await;
    let client = fixture.client.clone();
    for name in ["a", "b", "c"] {
        client.asset(name).await;
    }
    client.telemetry("b", Some("s"), &rig(2000, 300)).await;
    let page = client.get("fleet?limit=2").await.expect(200);
    let [a, b] = &page["items"].as_array().unwrap()[..] else { panic!("{page}") };
    assert_eq!((&a["asset"], &a["session"], &a["faults"]), (&json!("a"), &Value::Null, &json!([])));
    assert_eq!((&a["last_seen"], &a["lag_s"]), (&Value::Null, &Value::Null));
    assert_eq!(
        (&b["asset"], &b["session"], &b["samples"]),
        (&json!("b"), &json!("s"), &json!(2000))
    );
    assert_eq!(b["lag_s"], 0.0, "the first batch has the smallest delay so far");
    let seen = b["last_seen"].as_str().unwrap().to_owned();
    let faults = b["faults"].clone();
    let x_servo = faults.as_array().unwrap().iter().find(|f| f["code"] == "x_servo").unwrap();
    assert_eq!(
        (&x_servo["status"], &x_servo["acknowledged"]),
        (&json!("confirmed"), &json!(false))
    );
    let next = format!("fleet?cursor={}", page["next"].as_str().unwrap());
    let last = client.get(&next).await.expect(200);
    assert_eq!((&last["items"][0]["asset"], &last["next"]), (&json!("c"), &Value::Null));

    // A batch with older samples has a lag.
    client.telemetry("b", Some("s"), &rig(10, 10)).await;
    let lag = client.get("fleet").await.expect(200)["items"][1]["lag_s"].as_f64().unwrap();
    assert!(lag > 19.0, "{lag}");

    // After a restart, `last_seen` is the opening of the session.
    fixture.restart().await;
    let after = fixture.client.get("fleet").await.expect(200)["items"][1].clone();
    assert_eq!(after["lag_s"], Value::Null);
    let opened = after["last_seen"].as_str().unwrap().to_owned();
    assert!(opened <= seen, "{opened} is not after {seen}");
    assert_eq!(after["faults"], faults);
}

#[tokio::test]
async fn the_history_of_a_code_is_listed_newest_first() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    client.telemetry("a", Some("s"), &rig(2000, 300)).await;
    let at = "assets/a/faults/x_servo";
    client.post(&format!("{at}/acknowledge?by=ada"), &Value::Null).await.expect(200);
    client.delete(&format!("{at}?by=bob")).await;
    let page = client.get(&format!("{at}/history")).await.expect(200);
    let items = page["items"].as_array().unwrap();
    let entry = |i: usize| (items[i]["what"].as_str().unwrap(), items[i]["by"].as_str());
    let whats: Vec<_> = (0..items.len()).map(entry).collect();
    let acts = [("clear", Some("bob")), ("acknowledge", Some("ada"))];
    assert!(acts.iter().all(|act| whats.contains(act)), "{whats:?}");
    assert_eq!(whats[whats.len() - 2..], [("confirmed", None), ("pending", None)]);
    assert_eq!(items.last().unwrap()["fault"]["code"], "x_servo");
    let ids: Vec<_> = items.iter().map(|item| item["id"].as_i64().unwrap()).collect();
    assert!(ids.is_sorted_by(|a, b| a > b), "{ids:?}");

    // The pages give the same entries.
    let mut paged = Vec::new();
    let mut address = format!("{at}/history?limit=1");
    loop {
        let page = client.get(&address).await.expect(200);
        paged.extend(page["items"].as_array().unwrap().clone());
        let Some(next) = page["next"].as_str() else { break };
        address = format!("{at}/history?limit=1&cursor={next}");
    }
    assert_eq!(paged, *items);
    client.get("assets/a/faults/none/history").await.problem(404);

    let session = client.session("a", "s").await["id"].as_str().unwrap().to_owned();
    let lines = client.get(&format!("sessions/{session}/faults")).await.expect(200);
    let lines = lines["items"].as_array().unwrap();
    assert_eq!(
        (&lines[0]["status"], &lines[1]["status"]),
        (&json!("pending"), &json!("confirmed"))
    );
    client.get("sessions/none/faults").await.problem(404);
}

#[tokio::test]
async fn a_trace_equals_what_was_judged() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    client.telemetry("a", Some("s"), &rig(2000, 300)).await;
    let id = client.end("a", "s").await["id"].as_str().unwrap().to_owned();
    let all = client.get(&format!("sessions/{id}/trace")).await.expect(200);
    let n = all["t_s"].as_array().unwrap().len();
    // Evidence is renewed every 50 ms.
    assert!((380..=400).contains(&n), "{n} moments");
    let column = |trace: &Value, name: &str| numbers(&trace["x"][name]);
    assert!(
        ["command_rad", "position_m", "measured_m_s2", "twin_m_s2", "limit_m_s2"]
            .iter()
            .all(|name| column(&all, name).len() == n)
    );

    // At the time of the fault line, the trace has the evidence of that line.
    let lines = client.get(&format!("sessions/{id}/faults")).await.expect(200);
    let line = &lines["items"][0];
    let times = numbers(&all["t_s"]);
    let i = times.iter().position(|t| *t == line["t_s"].as_f64()).unwrap();
    for name in ["measured_m_s2", "twin_m_s2", "limit_m_s2"] {
        let (drawn, reported) =
            (column(&all, name)[i].unwrap(), line["evidence"]["x"][name].as_f64());
        // A trace is rounded to seven digits.
        assert!((drawn - reported.unwrap()).abs() < 1e-6, "{name}: {drawn}, {reported:?}");
    }

    // Where the line was written, its monitor had reached what its thresholds demand.
    let thresholds = &all["thresholds"];
    assert_eq!(thresholds.as_array().unwrap().len(), 4);
    let servo = &thresholds[0];
    assert_eq!((&servo["code"], &line["code"]), (&json!("x_servo"), &json!("x_servo")));
    let nats = column(&all, "nats")[i].unwrap();
    let counter = column(&all, "counter")[i].unwrap();
    let suspect_nats = servo["suspect_nats"].as_f64().unwrap();
    assert!(counter == 127.0 || nats >= suspect_nats - 1e-5, "{counter}, {nats}, {servo}");
    assert!(servo["confirm_nats"].as_f64().unwrap() > suspect_nats);
    assert_eq!(thresholds[3]["suspect_nats"], Value::Null, "no evidence decides on the sensor");
    assert_eq!(numbers(&all["sensor_counter"]).len(), n);

    let part = client.get(&format!("sessions/{id}/trace?from_s=5&to_s=6")).await.expect(200);
    let times = numbers(&part["t_s"]);
    assert!(times.iter().all(|t| (5.0..=6.0).contains(&t.unwrap())) && times.len() >= 19);
    let few = client.get(&format!("sessions/{id}/trace?points=50")).await.expect(200);
    assert!((40..=50).contains(&few["t_s"].as_array().unwrap().len()));
    let textbook = client.get(&format!("sessions/{id}/trace?profile=textbook")).await.expect(200);
    let limits = column(&textbook, "limit_m_s2");
    assert_eq!(limits[limits.len() / 2], Some(0.01));
    assert_eq!(textbook["thresholds"][0]["suspect_nats"], Value::Null);
    client.get(&format!("sessions/{id}/trace?profile=none")).await.problem(400);
    client.get("sessions/none/trace").await.problem(404);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_stream_with_traces_gets_every_moment_once() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    let url = format!("ws://{}/api/v1/assets/a/stream?state=50&trace=true", client.address);
    let (mut socket, _) = connect_async(url).await.unwrap();
    let samples = rig(600, 600);
    client.telemetry("a", Some("s"), &samples[..100]).await;
    let mut times: Vec<f64> = Vec::new();
    let mut sent = false;
    while times.last().is_none_or(|t| *t < samples[580].t_s) {
        let frame = tokio::time::timeout(crate::support::DEADLINE, socket.next()).await;
        let frame = frame.unwrap().unwrap().unwrap();
        let Ok(text) = frame.to_text() else { continue };
        let Ok(frame) = serde_json::from_str::<Value>(text) else { continue };
        times.extend(numbers(&frame["trace"]["t_s"]).into_iter().flatten());
        // The first state shows that the stream is set up: from now on it gets everything.
        if !sent && frame["samples"] == 100 {
            client.telemetry("a", Some("s"), &samples[100..]).await;
            sent = true;
        }
    }
    assert!(times.is_sorted_by(|a, b| a < b), "every moment once and in order");
    assert!(times.len() > 96, "{} moments", times.len());
}
