//! A rig that learns by itself: from its registration over the offer and somebody's
//! word that it was healthy to a calibration that later sessions refine.

use crate::support::{Bench, Client, csv, eventually};
use offbd_core::vocabulary::Sample;
use offbd_lab::simulation::{Disturbances, Preset, Reference, SimulatedRig};
use serde_json::{Value, json};

/// A session of the simulated rig, with a fault as on the command line.
fn session(seed: u64, seconds: usize, fault: Option<&str>) -> Vec<Sample> {
    let model = Preset::Chapter.model().unwrap();
    let mut rig =
        SimulatedRig::new(model, Reference::Lissajous, Disturbances::default(), seed).unwrap();
    fault.into_iter().for_each(|fault| rig.inject(fault.parse().unwrap()));
    (0..seconds * 100).map(|_| rig.next_sample()).collect()
}

/// Registers an asset by its name alone.
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

/// How far the rig is, once `done` says so.
async fn once(client: &Client, asset: &str, done: impl Fn(&Value) -> bool) -> Value {
    eventually(|| async { Some(learning(client, asset).await).filter(&done) }).await
}

async fn once_offered(client: &Client, asset: &str) -> Value {
    once(client, asset, |view| view["state"] == "offered").await
}

async fn post(client: &Client, asset: &str, act: &str) -> crate::support::Answer {
    client.post(&format!("assets/{asset}/learning/{act}"), &Value::Null).await
}

async fn calibration_id(client: &Client, asset: &str) -> Value {
    client.get(&format!("assets/{asset}")).await.expect(200)["calibration"]["id"].clone()
}

fn names(view: &Value) -> Vec<&str> {
    let sessions = view["sessions"].as_array().unwrap();
    sessions.iter().map(|session| session["name"].as_str().unwrap()).collect()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn from_registration_to_a_refined_calibration_without_a_command() {
    let mut bench = Bench::start().await;
    register(&bench.client, "new").await;
    let begun = learning(&bench.client, "new").await;
    assert_eq!((&begun["state"], &begun["x_s"]), (&json!("gathering"), &Value::Null));

    // The seconds rise while it streams, and a restart forgets none.
    let first = session(1, 70, None);
    let mut seconds = 0.0;
    for (i, samples) in first[..4000].chunks(1000).enumerate() {
        bench.client.telemetry("new", Some("first"), samples).await;
        let view = learning(&bench.client, "new").await;
        let x_s = view["x_s"].as_f64().unwrap();
        assert!(x_s > seconds, "batch {i}: {view}");
        seconds = x_s;
    }
    let before = learning(&bench.client, "new").await;
    bench.restart().await;
    assert_eq!(learning(&bench.client, "new").await, before);

    // It is learnt and offered before the session has ended.
    for samples in first[4000..].chunks(1000) {
        bench.client.telemetry("new", Some("first"), samples).await;
    }
    let offered = once_offered(&bench.client, "new").await;
    assert_eq!((names(&offered), &offered["n_sessions"]), (vec!["first"], &json!(1)));
    assert_eq!(calibration_id(&bench.client, "new").await, Value::Null, "nobody has said yes");
    bench.restart().await;
    let client = bench.client.clone();
    assert_eq!(learning(&client, "new").await, offered);
    let state = client.get("assets/new/state").await.expect(200);
    assert_eq!(state["learning"]["state"], "offered");
    let fleet = client.get("fleet").await.expect(200);
    assert_eq!(fleet["items"][0]["learning"], "offered");

    // Somebody says yes; the open session goes on as it began.
    let learnt = post(&client, "new", "accept").await.expect(200);
    assert_eq!((&learnt["state"], &learnt["n_sessions"]), (&json!("learnt"), &json!(1)));
    assert_eq!((&learnt["by_itself"], &learnt["refines"]), (&json!(true), &json!(true)));
    assert!(learnt["summary"].as_str().unwrap().contains("judged without it"), "{learnt}");
    let once_learnt = calibration_id(&client, "new").await;
    assert_ne!(once_learnt, Value::Null);
    post(&client, "new", "accept").await.problem(409);
    post(&client, "new", "discard").await.problem(409);
    client.end("new", "first").await;

    // What it finds now it confirms, and a faulty session teaches nothing.
    let sick = import(&client, "new", "sick", &session(2, 60, Some("x_servo:dead@20"))).await;
    assert_eq!(sick["verdict"]["faults"], json!(["x_servo"]));
    assert_eq!(learning(&client, "new").await["n_sessions"], 1);
    assert_eq!(calibration_id(&client, "new").await, once_learnt);

    // Later healthy ones do.
    import(&client, "new", "second", &session(3, 40, None)).await;
    let refined = once(&client, "new", |view| view["n_sessions"] == 2).await;
    assert_eq!((&refined["state"], names(&refined)), (&json!("learnt"), vec!["first", "second"]));
    // What is seen of a rig may not be durable yet.
    let changed = async || calibration_id(&client, "new").await != once_learnt;
    eventually(|| async { changed().await.then_some(()) }).await;
    bench.restart().await;
    assert_eq!(learning(&bench.client, "new").await, refined);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_was_discarded_is_forgotten() {
    let bench = Bench::start().await;
    let client = &bench.client;
    register(client, "odd").await;
    import(client, "odd", "unhealthy", &session(1, 70, None)).await;
    once_offered(client, "odd").await;
    let view = post(client, "odd", "discard").await.expect(200);
    assert_eq!((&view["state"], names(&view)), (&json!("gathering"), vec![]));
    assert_eq!((&view["x_s"], &view["calibration"]), (&Value::Null, &Value::Null));
    post(client, "odd", "accept").await.problem(409);

    import(client, "odd", "short", &session(2, 35, None)).await;
    assert_eq!(learning(client, "odd").await["state"], "gathering");
    import(client, "odd", "more", &session(3, 35, None)).await;
    let offered = once_offered(client, "odd").await;
    assert_eq!(names(&offered), ["short", "more"]);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_faulty_session_does_not_teach_nor_does_a_deleted_one() {
    let bench = Bench::start().await;
    let client = &bench.client;
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
async fn a_calibration_that_somebody_made_is_not_replaced() {
    let bench = Bench::start().await;
    let client = &bench.client;
    client.asset("made").await;
    let by_hand = calibration_id(client, "made").await;
    for name in ["one", "two"] {
        import(client, "made", name, &crate::support::rig(7000, usize::MAX)).await;
    }
    let view = learning(client, "made").await;
    assert_eq!((&view["state"], &view["by_itself"]), (&json!("learnt"), &json!(false)));
    assert_eq!(calibration_id(client, "made").await, by_hand);
    let made = client.get("assets/made/calibrations").await.expect(200);
    assert_eq!(made["items"], json!([]), "nothing was learnt in the background");
    assert_eq!(client.get("assets/made/state").await.expect(200)["learning"], Value::Null);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_refusal_is_told_and_another_description_is_tried_at_once() {
    let bench = Bench::start().await;
    let client = &bench.client;
    register(client, "flipped").await;
    let flipped: Vec<Sample> = session(1, 70, None)
        .into_iter()
        .map(|sample| Sample { y_m: sample.y_m.map(|y| -y), ..sample })
        .collect();
    import(client, "flipped", "first", &flipped).await;
    let refused = once(client, "flipped", |view| view["refused"].is_string()).await;
    assert_eq!(refused["state"], "gathering");
    assert!(refused["refused"].as_str().unwrap().contains("set the sign"), "{refused}");
    assert!(refused["summary"].as_str().unwrap().contains("set the sign"), "{refused}");
    assert!(refused["wanted_s"].as_f64().unwrap() > 90.0, "half as much again: {refused}");

    let asset = json!({ "name": "flipped", "axes": { "y_sign": -1 } });
    client.put("assets/flipped", &asset).await.expect(200);
    once_offered(client, "flipped").await;
}
