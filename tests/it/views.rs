//! What the page shows: the fleet at a glance, traces, and what happened when.

use crate::support::{Bench, rig};
use futures_util::StreamExt;
use serde_json::{Value, json};
use tokio_tungstenite::connect_async;

fn numbers(column: &Value) -> Vec<Option<f64>> {
    column.as_array().unwrap().iter().map(Value::as_f64).collect()
}

#[tokio::test]
async fn the_fleet_at_a_glance() {
    let mut bench = Bench::start().await;
    let client = bench.client.clone();
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
    assert_eq!(b["lag_s"], 0.0, "the first batch is the promptest so far");
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

    // A batch that comes no later, with data that are older, lags.
    client.telemetry("b", Some("s"), &rig(10, 10)).await;
    let lag = client.get("fleet").await.expect(200)["items"][1]["lag_s"].as_f64().unwrap();
    assert!(lag > 19.0, "{lag}");

    // After a restart the last that is known is the session's opening.
    bench.restart().await;
    let after = bench.client.get("fleet").await.expect(200)["items"][1].clone();
    assert_eq!(after["lag_s"], Value::Null);
    let opened = after["last_seen"].as_str().unwrap().to_owned();
    assert!(opened <= seen, "{opened} is not after {seen}");
    assert_eq!(after["faults"], faults);
}

#[tokio::test]
async fn what_happened_to_a_code_newest_first() {
    let bench = Bench::start().await;
    let client = &bench.client;
    client.asset("a").await;
    client.telemetry("a", Some("s"), &rig(2000, 300)).await;
    let at = "assets/a/faults/x_servo";
    client.post(&format!("{at}/acknowledge?by=ada"), &Value::Null).await.expect(200);
    client.delete(&format!("{at}?by=bob")).await;
    let page = client.get(&format!("{at}/history")).await.expect(200);
    let items = page["items"].as_array().unwrap();
    let said = |i: usize| (items[i]["what"].as_str().unwrap(), items[i]["by"].as_str());
    let whats: Vec<_> = (0..items.len()).map(said).collect();
    let acts = [("clear", Some("bob")), ("acknowledge", Some("ada"))];
    assert!(acts.iter().all(|act| whats.contains(act)), "{whats:?}");
    assert_eq!(whats[whats.len() - 2..], [("confirmed", None), ("pending", None)]);
    assert_eq!(items.last().unwrap()["fault"]["code"], "x_servo");
    let ids: Vec<_> = items.iter().map(|item| item["id"].as_i64().unwrap()).collect();
    assert!(ids.is_sorted_by(|a, b| a > b), "{ids:?}");

    // Page by page it is the same.
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
async fn a_trace_shows_what_was_judged() {
    let bench = Bench::start().await;
    let client = &bench.client;
    client.asset("a").await;
    client.telemetry("a", Some("s"), &rig(2000, 300)).await;
    let id = client.end("a", "s").await["id"].as_str().unwrap().to_owned();
    let all = client.get(&format!("sessions/{id}/trace")).await.expect(200);
    let n = all["t_s"].as_array().unwrap().len();
    assert!(n > 1900, "{n} moments");
    let column = |trace: &Value, name: &str| numbers(&trace["x"][name]);
    assert!(
        ["command_rad", "position_m", "measured_m_s2", "twin_m_s2", "limit_m_s2"]
            .iter()
            .all(|name| column(&all, name).len() == n)
    );

    // Where the fault line says that measured and twin part, the trace does.
    let lines = client.get(&format!("sessions/{id}/faults")).await.expect(200);
    let line = &lines["items"][0];
    let times = numbers(&all["t_s"]);
    let i = times.iter().position(|t| *t == line["t_s"].as_f64()).unwrap();
    for name in ["measured_m_s2", "twin_m_s2", "limit_m_s2"] {
        let (drawn, told) = (column(&all, name)[i].unwrap(), line["evidence"]["x"][name].as_f64());
        // Seven digits are drawn.
        assert!((drawn - told.unwrap()).abs() < 1e-6, "{name}: {drawn}, {told:?}");
    }

    let part = client.get(&format!("sessions/{id}/trace?from_s=5&to_s=6")).await.expect(200);
    let times = numbers(&part["t_s"]);
    assert!(times.iter().all(|t| (5.0..=6.0).contains(&t.unwrap())) && times.len() > 90);
    let few = client.get(&format!("sessions/{id}/trace?points=50")).await.expect(200);
    assert!((40..=50).contains(&few["t_s"].as_array().unwrap().len()));
    let textbook = client.get(&format!("sessions/{id}/trace?profile=textbook")).await.expect(200);
    assert_eq!(column(&textbook, "limit_m_s2")[n / 2], Some(0.01));
    client.get(&format!("sessions/{id}/trace?profile=none")).await.problem(422);
    client.get("sessions/none/trace").await.problem(404);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_watcher_is_told_every_moment_once() {
    let bench = Bench::start().await;
    let client = &bench.client;
    client.asset("a").await;
    let url = format!("ws://{}/api/v1/assets/a/stream?state=50&trace=true", client.address);
    let (mut socket, _) = connect_async(url).await.unwrap();
    let samples = rig(600, 600);
    client.telemetry("a", Some("s"), &samples[..100]).await;
    let mut told: Vec<f64> = Vec::new();
    let mut sent = false;
    while told.last().is_none_or(|t| *t < samples[590].t_s) {
        let frame = tokio::time::timeout(crate::support::DEADLINE, socket.next()).await;
        let frame = frame.unwrap().unwrap().unwrap();
        let Ok(text) = frame.to_text() else { continue };
        let Ok(frame) = serde_json::from_str::<Value>(text) else { continue };
        told.extend(numbers(&frame["trace"]["t_s"]).into_iter().flatten());
        // Once a state has come, somebody watches: from here on nothing is lost.
        if !sent && frame["samples"] == 100 {
            client.telemetry("a", Some("s"), &samples[100..]).await;
            sent = true;
        }
    }
    assert!(told.is_sorted_by(|a, b| a < b), "each once, in order");
    assert!(told.len() > 480, "{} moments", told.len());
}
