//! Other limits and debounce times, tried on a recorded session.

use crate::support::{Client, ServiceFixture, eventually, rig};
use serde_json::{Value, json};

/// The number of alarms of each monitor, in the order of the codes.
fn alarms(trial: &Value) -> Vec<usize> {
    let monitors = trial["monitors"].as_array().unwrap();
    monitors.iter().map(|monitor| monitor["alarms"].as_u64().unwrap() as usize).collect()
}

/// How often fault lines tell of the x servo that its failure begins to be confirmed.
fn confirmed(lines: &Value) -> usize {
    let of_servo = lines.as_array().unwrap().iter().filter(|line| line["code"] == "x_servo");
    let is_alarm = |line: &Value| line["status_byte"] == "2F";
    let states = std::iter::once(false).chain(of_servo.map(is_alarm)).collect::<Vec<_>>();
    states.windows(2).filter(|pair| !pair[0] && pair[1]).count()
}

/// Records a session in which the x servo fails, and returns its id.
async fn recorded(client: &Client) -> String {
    client.asset("a").await;
    client.telemetry("a", Some("s"), &rig(2000, 300)).await;
    client.end("a", "s").await["id"].as_str().unwrap().to_owned()
}

/// Returns the fault lines of a replay with `settings`.
async fn replayed(client: &Client, id: &str, settings: &Value) -> Value {
    let job = client.post(&format!("sessions/{id}/replays"), settings).await.expect(202);
    let path = format!("replays/{}", job["id"].as_str().unwrap());
    let done = eventually(|| async {
        let replay = client.get(&path).await.expect(200);
        (replay["state"] == "done").then_some(replay)
    })
    .await;
    done["result"]["faults"].clone()
}

#[tokio::test]
async fn a_trial_counts_what_the_session_and_a_replay_find() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    let id = recorded(client).await;
    let found = client.get(&format!("sessions/{id}/faults")).await.expect(200);
    let path = format!("sessions/{id}/trial");
    let as_set = client.get(&path).await.expect(200);
    assert_eq!(alarms(&as_set)[0], confirmed(&found["items"]), "{as_set}");
    assert!(alarms(&as_set)[0] > 0);

    // The same debounce for every monitor is the setting of the rig.
    for debounce in ["0", "0.3", "2"] {
        let all = ["x_servo", "y_servo", "stuck_ball", "sensor"]
            .map(|code| format!("{code}_debounce_s={debounce}"));
        let tried = client.get(&format!("{path}?{}", all.join("&"))).await.expect(200);
        let settings = json!({ "debounce_s": debounce.parse::<f64>().unwrap() });
        let lines = replayed(client, &id, &settings).await;
        assert_eq!(alarms(&tried)[0], confirmed(&lines), "{debounce} s: {tried}");
    }
}

#[tokio::test]
async fn wider_limits_and_longer_debounce_raise_fewer_alarms_and_store_nothing() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    let id = recorded(client).await;
    let session = client.get(&format!("sessions/{id}")).await.expect(200);
    let path = format!("sessions/{id}/trial");
    let wide = client.get(&format!("{path}?x_servo_limit=1000")).await.expect(200);
    let patient = client.get(&format!("{path}?x_servo_debounce_s=60")).await.expect(200);
    assert_eq!((alarms(&wide)[0], alarms(&patient)[0]), (0, 0), "{wide}, {patient}");
    assert!(patient["monitors"][0]["thresholds"]["fail_s"].as_f64().unwrap() >= 60.0);
    let narrow = client.get(&format!("{path}?profile=textbook&x_servo_limit=1")).await.expect(200);
    let relaxed = client.get(&format!("{path}?profile=textbook&x_servo_limit=1000")).await;
    assert!(alarms(&narrow)[0] > alarms(&relaxed.expect(200))[0], "{narrow}");
    let times = narrow["monitors"][0]["alarms_t_s"].as_array().unwrap();
    assert!(times.is_sorted_by(|a, b| a.as_f64() < b.as_f64()));
    assert_eq!(client.get(&format!("sessions/{id}")).await.expect(200), session);
}

#[tokio::test]
async fn an_invalid_setting_is_named() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    let id = recorded(client).await;
    for (query, parameter) in [
        ("x_servo_limit=0", "x_servo_limit"),
        ("y_servo_limit=nan", "y_servo_limit"),
        ("sensor_debounce_s=61", "sensor_debounce_s"),
        ("sensor_limit=2", "sensor_limit"),
        ("profile=odd", "profile"),
    ] {
        let problem = client.get(&format!("sessions/{id}/trial?{query}")).await.problem(400);
        assert_eq!(problem["parameter"], parameter, "{query}: {problem}");
    }
    client.get("sessions/none/trial").await.problem(404);
}
