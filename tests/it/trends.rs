//! Warnings of drift: sessions of a simulated rig whose servo weakens from session to session,
//! observed through every operation that shows it.

use crate::support::{Client, ServiceFixture, csv, eventually};
use offbd_core::vocabulary::Sample;
use offbd_lab::simulation::{Disturbances, Preset, Reference, SimulatedRig};
use serde_json::{Value, json};

const SESSIONS: u64 = 12;

/// Returns a session of the simulated rig; `fault` has the syntax of the command line.
fn session(seed: u64, seconds: usize, fault: Option<&str>) -> Vec<Sample> {
    let model = Preset::Chapter.model().unwrap();
    let mut rig =
        SimulatedRig::new(model, Reference::Lissajous, Disturbances::default(), seed).unwrap();
    fault.into_iter().for_each(|fault| rig.inject(fault.parse().unwrap()));
    (0..seconds * 100).map(|_| rig.next_sample()).collect()
}

/// Returns session `i` of a rig whose x servo loses 1.2 % of its gain per session.
fn weakening(i: u64) -> Vec<Sample> {
    let gain = format!("x_servo:gain={}@0", 1.0 - 0.012 * i as f64);
    session(100 + i, 60, (i > 0).then_some(gain.as_str()))
}

async fn import(client: &Client, asset: &str, name: &str, samples: &[Sample]) -> Value {
    let path = format!("assets/{asset}/sessions/import?name={name}");
    client.post_text(&path, "text/csv", csv(samples)).await.expect(201)["session"].clone()
}

/// Registers `asset` and calibrates it with a healthy session.
async fn register_and_learn(client: &Client, asset: &str) {
    client.post("assets", &json!({ "name": asset })).await.expect(201);
    learn(client, asset, 1).await;
}

async fn learn(client: &Client, asset: &str, seed: u64) {
    let name = format!("healthy-{seed}");
    let healthy = import(client, asset, &name, &session(seed, 120, None)).await;
    learn_from(client, asset, &healthy).await;
}

/// Calibrates `asset` with `session` and uses the result.
async fn learn_from(client: &Client, asset: &str, session: &Value) {
    let calibrations = format!("assets/{asset}/calibrations");
    let job = client.post(&calibrations, &json!({ "sessions": [session["id"]] })).await.expect(202);
    let path = format!("{calibrations}/{}", job["id"].as_str().unwrap());
    eventually(|| async { (client.get(&path).await.expect(200)["state"] == "done").then_some(()) })
        .await;
    client.post(&format!("{path}/activate"), &Value::Null).await.expect(200);
}

async fn trends(client: &Client, asset: &str) -> Value {
    client.get(&format!("assets/{asset}/trends")).await.expect(200)
}

fn warnings(trends: &Value) -> Vec<&Value> {
    let all = trends["trends"].as_array().unwrap().iter().map(|trend| &trend["warning"]);
    all.filter(|warning| !warning.is_null()).collect()
}

/// Returns the warnings of `asset` in the fleet.
async fn fleet_warnings(client: &Client, asset: &str) -> Value {
    let fleet = client.get("fleet").await.expect(200);
    let items = fleet["items"].as_array().unwrap();
    items.iter().find(|entry| entry["asset"] == asset).unwrap()["warnings"].clone()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_weakening_servo_has_a_warning_before_its_fault_is_confirmed() {
    let mut fixture = ServiceFixture::start().await;
    let client = fixture.client.clone();
    register_and_learn(&client, "weak").await;
    let mut warned_at = None;
    for i in 0..SESSIONS {
        let ended = import(&client, "weak", &format!("s{i}"), &weakening(i)).await;
        assert_eq!(ended["verdict"]["faults"], json!([]), "session {i} has no fault yet");
        if fleet_warnings(&client, "weak").await != json!([]) {
            warned_at = warned_at.or(Some(i));
        }
    }
    let view = trends(&client, "weak").await;
    let [warning] = &warnings(&view)[..] else { panic!("one parameter drifts: {view}") };
    assert_eq!((&warning["code"], &warning["command"]), (&json!("x_servo"), &json!("qy")));
    assert_eq!((&warning["axis"], &warning["parameter"]), (&json!("x"), &json!("gain")));
    assert_eq!(fleet_warnings(&client, "weak").await, json!([warning]));
    assert!(warned_at.is_some_and(|at| at < SESSIONS), "{warned_at:?}");

    // The series has the same estimates.
    let series = client.get("assets/weak/series").await.expect(200);
    let gains = |rows: &Value, gain: fn(&Value) -> &Value| -> Vec<Value> {
        rows.as_array().unwrap().iter().map(|row| gain(row).clone()).collect()
    };
    let residual = |row: &Value| row["residual_x_m_s2"].as_f64().unwrap();
    let rows = series["rows"].as_array().unwrap();
    let (first, last) = (residual(&rows[1]), residual(rows.last().unwrap()));
    assert!(0.0 < first && first < last, "a weaker servo leaves more unexplained: {first}, {last}");
    let of_series = gains(&series["rows"], |row| &row["gain_x"]);
    assert!(of_series.iter().filter(|gain| gain.is_number()).count() as u64 >= SESSIONS);
    let of_points = gains(&view["points"], |point| &point["x"]["gain"]);
    assert_eq!(of_series[of_series.len() - of_points.len()..], of_points);

    // The confidence interval contains the injected slope. At 1.2 % per session, the limit
    // of 0.3 is reached after 25 sessions, of which 12 are over.
    let gain = &view["trends"][0];
    let number = |key: &str| gain[key].as_f64().unwrap();
    assert!((number("slope_low")..number("slope_high")).contains(&-0.012), "{gain}");
    assert!(number("slope_high") < 0.0, "{gain}");
    let left = warning["sessions_left"].as_f64().unwrap();
    assert!((8.0..=20.0).contains(&left), "{left}");
    assert!((number("limit_low") - (number("nominal") - 0.3)).abs() < 1e-12);

    // A large loss of gain is a fault.
    let broken =
        import(&client, "weak", "broken", &session(7, 60, Some("x_servo:gain=0.5@20"))).await;
    assert_eq!(broken["verdict"]["faults"], json!(["x_servo"]));

    // Estimates and trends survive a restart and are deleted with their sessions.
    let before = trends(&client, "weak").await;
    fixture.restart().await;
    let client = &fixture.client;
    assert_eq!(trends(client, "weak").await, before);
    let points = before["points"].as_array().unwrap();
    let names: Vec<_> = points.iter().map(|p| p["session"].as_str().unwrap()).collect();
    assert_eq!(
        (names.first(), names.last(), names.len()),
        (Some(&"healthy-1"), Some(&"broken"), 14)
    );
    assert_eq!(points[0]["calibration_id"], Value::Null, "the rig was not learnt yet");
    let last = format!("sessions/{}", points[13]["session_id"].as_str().unwrap());
    client.delete(&last).await.expect(204);
    assert_eq!(trends(client, "weak").await["points"].as_array().unwrap().len(), 13);

    // With a new calibration there are no trends yet.
    learn(client, "weak", 2).await;
    assert_eq!(fleet_warnings(client, "weak").await, json!([]));
    let again = trends(client, "weak").await;
    assert_eq!(again["trends"], json!([]));
    assert_ne!(again["calibration_id"], before["calibration_id"]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_healthy_rig_has_no_warning() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    register_and_learn(client, "well").await;
    for i in 0..SESSIONS {
        import(client, "well", &format!("s{i}"), &session(100 + i, 60, None)).await;
        assert_eq!(fleet_warnings(client, "well").await, json!([]), "session {i}");
    }
    let view = trends(client, "well").await;
    assert_eq!(view["trends"].as_array().unwrap().len(), 6, "three parameters of two axes");
    assert!(warnings(&view).is_empty(), "{view}");
    assert_eq!(view["trends"][0]["sessions"], SESSIONS);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn without_a_calibration_there_are_estimates_but_no_trends() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.post("assets", &json!({ "name": "new" })).await.expect(201);
    assert_eq!(
        trends(client, "new").await,
        json!({
            "asset": "new", "calibration_id": null, "points": [], "trends": [],
        })
    );
    import(client, "new", "short", &session(1, 5, None)).await;
    import(client, "new", "long", &session(2, 40, None)).await;
    let view = trends(client, "new").await;
    let points = view["points"].as_array().unwrap();
    assert_eq!(points.len(), 1, "five seconds are too few: {view}");
    assert_eq!((&points[0]["session"], &points[0]["samples"]), (&json!("long"), &json!(4000)));
    assert!(points[0]["x"]["gain_error"].as_f64().unwrap() > 0.0);
    assert_eq!(view["trends"], json!([]));
    client.get("assets/nobody/trends").await.problem(404);
}

/// The root mean square of measured minus predicted acceleration along x while it is judged.
fn residual_of(trace: &Value) -> f64 {
    let column = |name: &str| trace["x"][name].as_array().unwrap().iter();
    let pairs = column("measured_m_s2").zip(column("twin_m_s2")).zip(column("enabled"));
    let squares: Vec<f64> = pairs
        .filter(|(_, enabled)| **enabled == json!(true))
        .filter_map(|((measured, twin), _)| Some(measured.as_f64()? - twin.as_f64()?))
        .map(|residual| residual * residual)
        .collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_trace_with_another_calibration_shows_its_fit_and_stores_nothing() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.post("assets", &json!({ "name": "bench" })).await.expect(201);
    // A servo that answers four fifths of its command: the twin of its description does not.
    let weak = Some("x_servo:gain=0.8@0");
    let taught = import(client, "bench", "taught", &session(5, 120, weak)).await;
    learn_from(client, "bench", &taught).await;
    let recorded = import(client, "bench", "s", &session(6, 60, weak)).await;
    let path = format!("sessions/{}", recorded["id"].as_str().unwrap());
    let trace = async |query: &str| client.get(&format!("{path}/trace?points=20000{query}")).await;
    let as_recorded = trace("").await.expect(200);
    let jobs = client.get("assets/bench/calibrations").await.expect(200);
    let job = &jobs["items"][0];
    for id in [&job["id"], &job["calibration"]["id"]] {
        let again = trace(&format!("&calibration={}", id.as_str().unwrap())).await.expect(200);
        assert_eq!(again, as_recorded, "the calibration in use");
    }
    let without = trace("&calibration=none").await.expect(200);
    assert!(residual_of(&without) > residual_of(&as_recorded), "learning improves the fit");
    // The trace has every moment, and the residual that the session keeps is theirs.
    assert_eq!(as_recorded["stride"], 1);
    let kept = recorded["verdict"]["residual_x_m_s2"].as_f64().unwrap();
    assert!((kept / residual_of(&as_recorded) - 1.0).abs() < 0.01, "{kept}");
    let problem = trace("&calibration=other").await.problem(404);
    assert!(problem["detail"].as_str().unwrap().contains("other"), "{problem}");
    assert_eq!(client.get(&path).await.expect(200), recorded);
}
