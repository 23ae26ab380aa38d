//! Automatic calibration of a rig: from its registration, through the offer and its acceptance
//! by a person, to a calibration that later sessions refine.

use crate::support::{Client, ServiceFixture, csv, eventually};
use offbd_core::vocabulary::Sample;
use offbd_lab::simulation::{Disturbances, Preset, Reference, SimulatedRig};
use serde_json::{Value, json};

/// Returns a session of the simulated rig; `fault` has the syntax of the command line.
fn session(seed: u64, seconds: usize, fault: Option<&str>) -> Vec<Sample> {
    let model = Preset::Chapter.model().unwrap();
    let mut rig =
        SimulatedRig::new(model, Reference::Lissajous, Disturbances::default(), seed).unwrap();
    fault.into_iter().for_each(|fault| rig.inject(fault.parse().unwrap()));
    (0..seconds * 100).map(|_| rig.next_sample()).collect()
}

/// Registers an asset with only a name.
async fn register(client: &Client, asset: &str) {
    client.post("assets", &json!({ "name": asset })).await.expect(201);
}

async fn import(client: &Client, asset: &str, name: &str, samples: &[Sample]) -> Value {
    let path = format!("assets/{asset}/sessions/import?name={name}");
    client.post_text(&path, "text/csv", csv(samples)).await.expect(201)["session"].clone()
}

async fn learning(client: &Client, asset: &str) -> Value {
    client.get(&format!("assets/{asset}/learning")).await.expect(200)
}

/// Waits until `done` and returns the progress of learning.
async fn wait_until(client: &Client, asset: &str, done: impl Fn(&Value) -> bool) -> Value {
    eventually(|| async { Some(learning(client, asset).await).filter(&done) }).await
}

async fn wait_until_offered(client: &Client, asset: &str) -> Value {
    wait_until(client, asset, |view| view["state"] == "offered").await
}

async fn post(client: &Client, asset: &str, action: &str) -> crate::support::Answer {
    client.post(&format!("assets/{asset}/learning/{action}"), &Value::Null).await
}

async fn calibration_id(client: &Client, asset: &str) -> Value {
    client.get(&format!("assets/{asset}")).await.expect(200)["calibration"]["id"].clone()
}

/// Who made and who activated each calibration of `new`, the newest first.
async fn makers(client: &Client) -> Vec<[Value; 2]> {
    let page = client.get("assets/new/calibrations").await.expect(200);
    let of = |job: &Value| [job["made_by"].clone(), job["activated_by"].clone()];
    page["items"].as_array().unwrap().iter().map(of).collect()
}

fn names(view: &Value) -> Vec<&str> {
    let sessions = view["sessions"].as_array().unwrap();
    sessions.iter().map(|session| session["name"].as_str().unwrap()).collect()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_rig_is_learnt_automatically_and_refined_by_later_sessions() {
    let mut fixture = ServiceFixture::start().await;
    register(&fixture.client, "new").await;
    let begun = learning(&fixture.client, "new").await;
    assert_eq!((&begun["state"], &begun["x_s"]), (&json!("gathering"), &Value::Null));

    // The usable motion grows while samples arrive, and a restart does not lose any.
    let first = session(1, 70, None);
    let mut seconds = 0.0;
    for (i, samples) in first[..4000].chunks(1000).enumerate() {
        fixture.client.telemetry("new", Some("first"), samples).await;
        let view = learning(&fixture.client, "new").await;
        let x_s = view["x_s"].as_f64().unwrap();
        assert!(x_s > seconds, "batch {i}: {view}");
        seconds = x_s;
    }
    let before = learning(&fixture.client, "new").await;
    fixture.restart().await;
    assert_eq!(learning(&fixture.client, "new").await, before);

    // A calibration is offered before the session has ended.
    for samples in first[4000..].chunks(1000) {
        fixture.client.telemetry("new", Some("first"), samples).await;
    }
    let offered = wait_until_offered(&fixture.client, "new").await;
    assert_eq!((names(&offered), &offered["n_sessions"]), (vec!["first"], &json!(1)));
    assert_eq!(calibration_id(&fixture.client, "new").await, Value::Null, "not accepted yet");
    fixture.restart().await;
    let client = fixture.client.clone();
    assert_eq!(learning(&client, "new").await, offered);
    let state = client.get("assets/new/state").await.expect(200);
    assert_eq!(state["learning"]["state"], "offered");
    let fleet = client.get("fleet").await.expect(200);
    assert_eq!(fleet["items"][0]["learning"], "offered");

    // A person accepts it; the open session continues without it.
    let learnt = post(&client, "new", "accept?by=ann").await.expect(200);
    assert_eq!((&learnt["state"], &learnt["n_sessions"]), (&json!("learnt"), &json!(1)));
    assert_eq!((&learnt["by_itself"], &learnt["refines"]), (&json!(true), &json!(true)));
    assert!(learnt["summary"].as_str().unwrap().contains("does not use it"), "{learnt}");
    let first_learnt = calibration_id(&client, "new").await;
    assert_ne!(first_learnt, Value::Null);
    assert_eq!(makers(&client).await, [[json!("offbd"), json!("ann")]]);
    post(&client, "new", "accept").await.problem(409);
    post(&client, "new", "discard").await.problem(409);
    client.end("new", "first").await;

    // Faults are now confirmed, and a faulty session is not learnt from.
    let sick = import(&client, "new", "sick", &session(2, 60, Some("x_servo:dead@20"))).await;
    assert_eq!(sick["verdict"]["faults"], json!(["x_servo"]));
    assert_eq!(learning(&client, "new").await["n_sessions"], 1);
    assert_eq!(calibration_id(&client, "new").await, first_learnt);

    // Later healthy sessions are.
    import(&client, "new", "second", &session(3, 40, None)).await;
    let refined = wait_until(&client, "new", |view| view["n_sessions"] == 2).await;
    assert_eq!((&refined["state"], names(&refined)), (&json!("learnt"), vec!["first", "second"]));
    // What a query returns may not be durable yet.
    let changed = async || calibration_id(&client, "new").await != first_learnt;
    eventually(|| async { changed().await.then_some(()) }).await;
    fixture.restart().await;
    assert_eq!(learning(&fixture.client, "new").await, refined);
    assert_eq!(makers(&fixture.client).await[0], [json!("offbd"), json!("offbd")]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn discarded_sessions_are_not_used_again() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    register(client, "odd").await;
    import(client, "odd", "unhealthy", &session(1, 70, None)).await;
    wait_until_offered(client, "odd").await;
    let view = post(client, "odd", "discard").await.expect(200);
    assert_eq!((&view["state"], names(&view)), (&json!("gathering"), vec![]));
    assert_eq!((&view["x_s"], &view["calibration"]), (&Value::Null, &Value::Null));
    post(client, "odd", "accept").await.problem(409);

    import(client, "odd", "short", &session(2, 35, None)).await;
    assert_eq!(learning(client, "odd").await["state"], "gathering");
    import(client, "odd", "more", &session(3, 35, None)).await;
    let offered = wait_until_offered(client, "odd").await;
    assert_eq!(names(&offered), ["short", "more"]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn faulty_and_deleted_sessions_are_not_learnt_from() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    register(client, "faulty").await;
    let frozen = session(1, 70, Some("sensor:freeze@50"));
    let frozen = import(client, "faulty", "frozen", &frozen).await;
    assert_eq!(frozen["verdict"]["faults"], json!(["sensor"]));
    let view = learning(client, "faulty").await;
    assert_eq!((names(&view), &view["x_s"]), (vec![], &Value::Null), "{view}");

    let healthy = import(client, "faulty", "healthy", &session(2, 30, None)).await;
    let view = learning(client, "faulty").await;
    assert_eq!(names(&view), ["healthy"]);
    client.delete(&format!("sessions/{}", healthy["id"].as_str().unwrap())).await.expect(204);
    assert_eq!(names(&learning(client, "faulty").await), [""; 0]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_calibration_made_by_a_person_is_not_replaced() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("made").await;
    let by_hand = calibration_id(client, "made").await;
    for name in ["one", "two"] {
        import(client, "made", name, &crate::support::rig(7000, usize::MAX)).await;
    }
    let view = learning(client, "made").await;
    assert_eq!((&view["state"], &view["by_itself"]), (&json!("learnt"), &json!(false)));
    assert_eq!(calibration_id(client, "made").await, by_hand);
    let made = client.get("assets/made/calibrations").await.expect(200);
    assert_eq!(made["items"], json!([]), "no automatic calibration");
    assert_eq!(client.get("assets/made/state").await.expect(200)["learning"], Value::Null);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_failed_calibration_is_explained_and_a_changed_asset_file_retried_at_once() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    register(client, "flipped").await;
    let flipped: Vec<Sample> = session(1, 70, None)
        .into_iter()
        .map(|sample| Sample { y_m: sample.y_m.map(|y| -y), ..sample })
        .collect();
    import(client, "flipped", "first", &flipped).await;
    let refused = wait_until(client, "flipped", |view| view["refused"].is_string()).await;
    assert_eq!(refused["state"], "gathering");
    assert!(refused["refused"].as_str().unwrap().contains("set the sign"), "{refused}");
    assert!(refused["summary"].as_str().unwrap().contains("set the sign"), "{refused}");
    assert!(refused["wanted_s"].as_f64().unwrap() > 90.0, "half as much again: {refused}");

    let asset = json!({ "name": "flipped", "axes": { "y_sign": -1 } });
    client.put("assets/flipped", &asset).await.expect(200);
    wait_until_offered(client, "flipped").await;
}
