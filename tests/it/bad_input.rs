//! Invalid input: the response names the element, valid rows of a batch are kept, and the
//! service continues.

use crate::support::{Client, ServiceFixture, csv, rig};
use reqwest::Method;
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};

const TELEMETRY: &str = "assets/a/telemetry";

async fn service() -> ServiceFixture {
    let fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    fixture
}

/// Checks that the service still accepts a sample.
async fn check_alive(client: &Client) {
    let ack = client.telemetry("a", Some("alive"), &rig(1, 1)).await;
    assert_eq!(ack["accepted"].as_u64().unwrap() + ack["duplicate"].as_u64().unwrap(), 1);
}

#[tokio::test]
async fn an_unknown_resource_gets_404_with_its_name() {
    let fixture = service().await;
    let client = &fixture.client;
    for path in
        ["assets/nobody/state", "assets/nobody", "assets/nobody/faults", "events?asset=nobody"]
    {
        let problem = client.get(path).await.problem(404);
        assert!(problem["detail"].as_str().unwrap().contains("`nobody`"), "{problem}");
    }
    let problem = client.post("assets/nobody/telemetry", &json!({"samples":[]})).await.problem(404);
    assert_eq!(problem["type"], "urn:offbd:problem:unknown-asset");
    client.get("sessions/0").await.problem(404);
    client.get("replays/0").await.problem(404);
    client.get("assets/a/calibrations/0").await.problem(404);
    let problem = client.get("assets/a/faults/z_servo").await.problem(404);
    assert!(problem["detail"].as_str().unwrap().contains("x_servo, y_servo"), "{problem}");
    client.get("/nowhere").await.problem(404);
    let answer = client.send(client.request(Method::PATCH, "assets")).await;
    answer.problem(405);
    assert!(answer.headers.contains_key("allow"), "{:?}", answer.headers);
    check_alive(client).await;
}

#[tokio::test]
async fn an_invalid_asset_file_is_rejected_with_its_pointer() {
    let fixture = service().await;
    let client = &fixture.client;
    for (file, status, pointer) in [
        (json!({"name":"b","ball":{"radius_m":-0.01}}), 422, "/ball/radius_m"),
        (json!({"name":"b","ball":{"radius_m":"big"}}), 422, "/ball/radius_m"),
        (json!({"name":"b","plate":{"diameter_m":0.3,"length_m":0.2}}), 422, "/plate/diameter_m"),
        (json!({"name":"b","servo":{"angle_limit_rad":9}}), 422, "/servo/angle_limit_rad"),
        (json!({"name":"../b"}), 422, "/name"),
        (json!({"name":""}), 422, "/name"),
        (json!({"name":"b","color":"red"}), 422, "/color"),
        (json!({"name":"b","diagnostics":{"profile":"odd"}}), 422, "/diagnostics/profile"),
        (json!([]), 400, ""),
        (json!({}), 422, "/name"),
        (json!({"name":"b","ball":{"mass_kg":null}}), 422, "/ball/mass_kg"),
    ] {
        let problem = client.post("assets", &file).await.problem(status);
        assert_eq!(problem["pointer"], pointer, "{file}: {problem}");
    }
    let answer = client.post_text("assets", "application/json", "{\"name\":").await;
    assert!(answer.problem(400)["detail"].as_str().unwrap().contains("line 1"));
    client.post("assets", &json!({"name":"a"})).await.problem(409);
    client.put("assets/c", &json!({"name":"a"})).await.problem(422);
    let long = format!("{{\"name\":\"{}\"}}", "x".repeat(70_000));
    client.post_text("assets", "application/json", long).await.problem(413);
    check_alive(client).await;
}

#[tokio::test]
async fn a_document_that_is_not_a_batch_is_rejected_with_a_pointer() {
    let fixture = service().await;
    let client = &fixture.client;
    for (kind, body, status, pointer) in [
        ("application/json", "{\"samples\":[{\"t_s\":0}", 400, json!("/samples")),
        ("application/json", "", 400, json!("")),
        ("application/json", "[]", 400, json!("")),
        ("application/json", "{}", 400, json!("/t_s")),
        ("application/json", "{\"samples\":{}}", 400, json!("/samples")),
        ("application/json", "{\"session\":1,\"samples\":[]}", 400, json!("/session")),
        ("application/json", "{\"t_s\":[0,1],\"y_m\":[0]}", 400, json!("/y_m")),
        (
            "application/json",
            "{\"session\":\"\",\"samples\":[{\"t_s\":0}]}",
            422,
            json!("/session"),
        ),
        ("text/csv", "t_s,x_m\n0,0\n", 400, json!("")),
        ("application/xml", "<t_s>0</t_s>", 415, Value::Null),
        ("application/x-www-form-urlencoded", "{\"samples\":[]}", 415, Value::Null),
    ] {
        let problem = client.post_text(TELEMETRY, kind, body).await.problem(status);
        assert_eq!(problem["pointer"], pointer, "{body}: {problem}");
    }
    for (body, pointer) in [
        (&[][..], ""),
        (b"{\"samples\":[]}", ""),
        (b"\x81\xa7samples\xdd\xff\xff\xff\xff", "/samples/0"),
        (b"\x81\xa3t_s\x92\x00", "/t_s/1"),
    ] {
        let request = client.request(Method::POST, TELEMETRY);
        let request = request.header("content-type", "application/msgpack").body(body.to_vec());
        let problem = client.send(request).await.problem(400);
        assert_eq!(problem["pointer"], pointer, "{body:x?}: {problem}");
    }
    let named = r#"{"session":"b","samples":[]}"#;
    let answer = client.post_text("assets/a/telemetry?session=c", "application/json", named).await;
    assert_eq!(answer.problem(422)["pointer"], "/session");
    check_alive(client).await;
}

#[tokio::test]
async fn an_invalid_row_is_rejected_and_the_rest_of_the_batch_accepted() {
    let fixture = service().await;
    let client = &fixture.client;
    let body = r#"{"session":"odd","samples":[{"t_s":0,"x_m":0},{"t_s":"1"},{"t_s":null},{},7,
        {"t_s":NaN},{"t_s":1,"x_m":-Infinity},{"t_s":2,"x_m":1e300},{"t_s":1e300},{"t_s":1e999},
        {"t_s":3,"seq":-4},{"t_s":0.01,"x_m":0}]}"#;
    let ack = client.post_text(TELEMETRY, "application/json", body).await.expect(200);
    let rejected = ack["rejected"].as_array().unwrap();
    let indices: Vec<u64> = rejected.iter().map(|r| r["index"].as_u64().unwrap()).collect();
    assert_eq!(indices, [1, 2, 3, 4, 5, 6, 7, 8, 9, 10], "{ack}");
    assert_eq!(ack["accepted"], 2);
    assert!(rejected.iter().all(|r| !r["reason"].as_str().unwrap().is_empty()));
    assert_eq!(client.recording("a", "odd").await.len(), 2);
    assert_eq!(client.session("a", "odd").await["rejected"], 10);

    let lines = "{\"t_s\":0}\nnot json\n{\"t_s\":0.01}\n";
    let path = "assets/a/telemetry?session=lines";
    let ack = client.post_text(path, "application/x-ndjson", lines).await.expect(200);
    assert_eq!((&ack["accepted"], &ack["rejected"][0]["index"]), (&json!(2), &json!(1)));

    let table = "t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m\n0,0,0,0,0\n1,0,oops,0,0\n0.02,,,,\n";
    let path = "assets/a/telemetry?session=table";
    let ack = client.post_text(path, "text/csv", table).await.expect(200);
    assert_eq!(ack["accepted"], 2);
    assert!(ack["rejected"][0]["reason"].as_str().unwrap().contains("line 3"), "{ack}");
    let lines_as_table = format!("{path}&columns=t_s%3Dtime");
    let refused = client.post_text(&lines_as_table, "application/x-ndjson", lines).await;
    assert_eq!(refused.problem(400)["parameter"], "columns");
}

#[tokio::test]
async fn samples_with_an_implausible_time_are_recorded_but_not_judged() {
    let fixture = service().await;
    let client = &fixture.client;
    let good = rig(300, 300);
    client.telemetry("a", Some("clock"), &good[..200]).await;
    let mut back = good[200];
    (back.t_s, back.seq) = (good[200].t_s - 3600.0, Some(5_000));
    let mut ahead = good[200];
    (ahead.t_s, ahead.seq) = (good[200].t_s + 365.0 * 86_400.0, Some(5_001));
    let ack = client.telemetry("a", Some("clock"), &[back, ahead]).await;
    assert_eq!((&ack["accepted"], ack["late"].as_array().unwrap().len()), (&json!(2), 2), "{ack}");
    let ack = client.telemetry("a", Some("clock"), &good[200..]).await;
    assert_eq!((&ack["accepted"], &ack["late"]), (&json!(100), &json!([])));
    assert_eq!(client.recording("a", "clock").await.len(), 302);
}

#[tokio::test]
async fn an_empty_batch_is_accepted_and_a_huge_one_gets_413() {
    let fixture = ServiceFixture::start_with(|config| {
        config.limits.batch_samples = 50;
        config.limits.batch_bytes = 20_000;
    })
    .await;
    let client = &fixture.client;
    client.asset("a").await;
    let ack = client.post(TELEMETRY, &json!({"samples":[]})).await.expect(200);
    assert_eq!((&ack["accepted"], &ack["session"]), (&json!(0), &Value::Null));
    let many =
        client.post(TELEMETRY, &crate::support::batch(None, &rig(51, 51))).await.problem(413);
    assert!(many["detail"].as_str().unwrap().contains("51"), "{many}");
    client.post_text(TELEMETRY, "application/json", " ".repeat(20_001)).await.problem(413);
    client.post_text(TELEMETRY, "text/csv", csv(&rig(51, 51))).await.problem(413);
    assert_eq!(client.get("sessions").await.expect(200)["items"], json!([]));
    check_alive(client).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_incomplete_request_body_gets_408() {
    let fixture = ServiceFixture::start_with(|config| config.limits.body_timeout_s = 1).await;
    fixture.client.asset("a").await;
    let mut socket = tokio::net::TcpStream::connect(&fixture.client.address).await.unwrap();
    let head = "POST /api/v1/assets/a/telemetry HTTP/1.1\r\nHost: localhost\r\n\
        Content-Type: application/json\r\nContent-Length: 1000\r\n\r\n{\"samples\":[";
    socket.write_all(head.as_bytes()).await.unwrap();
    let mut answer = vec![0; 4096];
    let read = tokio::time::timeout(crate::support::DEADLINE, socket.read(&mut answer)).await;
    let n = read.unwrap().unwrap();
    let answer = String::from_utf8_lossy(&answer[..n]).into_owned();
    assert!(answer.starts_with("HTTP/1.1 408"), "{answer}");
    check_alive(&fixture.client).await;
}

#[tokio::test]
async fn an_import_reports_invalid_rows_and_rejects_other_files() {
    let fixture = service().await;
    let client = &fixture.client;
    let path = "assets/a/sessions/import?name=broken";
    let text = format!("{}9.99,broken\n", csv(&rig(100, 100)));
    let imported = client.post_text(path, "text/csv", text).await.expect(201);
    assert_eq!((&imported["accepted"], &imported["rejected"]), (&json!(100), &json!(1)));
    assert!(imported["rejections"][0]["reason"].as_str().unwrap().contains("line 102"));
    assert_eq!(imported["session"]["state"], "ended");
    client.post_text(path, "text/csv", csv(&rig(10, 10))).await.problem(409);
    let path = "assets/a/sessions/import";
    client.post_text(path, "text/csv", "nothing,here\n1,2\n").await.problem(400);
    client.post_text(path, "application/json", "{}").await.problem(400);
    client.post_text(path, "application/xml", "<a/>").await.problem(415);
    let path = "assets/nobody/sessions/import";
    client.post_text(path, "text/csv", csv(&rig(10, 10))).await.problem(404);
    check_alive(client).await;
}

#[tokio::test]
async fn invalid_parameters_and_request_bodies_are_named() {
    let fixture = service().await;
    let client = &fixture.client;
    for (path, parameter) in [
        ("faults?status=odd", "status"),
        ("faults?sort=odd", "sort"),
        ("faults?cursor=odd", "cursor"),
        ("faults?cursor=é", "cursor"),
        ("sessions?cursor=00", "cursor"),
        ("sessions?state=odd", "state"),
        ("sessions?verdict=odd", "verdict"),
        ("sessions?sort=name", "sort"),
        ("sessions?opened_from=yesterday", "opened_from"),
        ("sessions?opened_from=2026-01-02T00:00:00Z&opened_to=2026-01-01T00:00:00Z", "opened_to"),
        ("assets?cursor=7", "cursor"),
        ("assets?limit=many", "limit"),
        ("assets?limit=0", "limit"),
        ("assets?limit=-1", "limit"),
        ("fleet?limit=501", "limit"),
        ("fleet?has_fault=yes", "has_fault"),
        ("sessions?asett=a", "asett"),
        ("sessions?asset=a&asset=a", "asset"),
        ("faults?acknowledged=1", "acknowledged"),
        ("assets/a?x=1", "x"),
        ("assets/a/state?x", "x"),
        ("/healthz?x=1", "x"),
        ("events?after=last", "after"),
    ] {
        let problem = client.get(path).await.problem(400);
        assert_eq!(problem["parameter"], parameter, "{path}: {problem}");
    }
    client.get("assets/a/stream").await.problem(426);
    let request = client.request(Method::GET, "events").header("last-event-id", "x");
    client.send(request).await.problem(400);
    client.telemetry("a", Some("s"), &rig(10, 10)).await;
    let id = client.session("a", "s").await["id"].as_str().unwrap().to_owned();
    let path = format!("sessions/{id}/telemetry");
    let request = client.request(Method::GET, &path).header("accept", "image/png");
    let problem = client.send(request).await.problem(406);
    assert!(problem["detail"].as_str().unwrap().contains("text/csv"), "{problem}");
    let replays = format!("sessions/{id}/replays");
    let wrong = client.post(&replays, &json!({"profile":"odd"})).await.problem(422);
    assert_eq!(wrong["pointer"], "/profile");
    let wrong = client.post(&replays, &json!({"asset":{"ball":{"mass_kg":-1}}})).await.problem(422);
    assert_eq!(wrong["pointer"], "/asset/ball/mass_kg");
    let wrong = client.post("assets/a/calibrations", &json!({"sessions":["x"]})).await.problem(422);
    assert_eq!(wrong["pointer"], "/sessions/0");
    client.post("assets/a/calibrations", &json!({})).await.problem(422);
    client.post("assets/a/faults/sensor/acknowledge", &Value::Null).await.problem(409);
    for (rest, parameter) in [
        ("telemetry?from_s=9&to_s=1", "to_s"),
        ("telemetry?from_s=nan", "from_s"),
        ("trace?from_s=9&to_s=1", "to_s"),
        ("trace?points=0", "points"),
        ("trace?profile=odd", "profile"),
    ] {
        let problem = client.get(&format!("sessions/{id}/{rest}")).await.problem(400);
        assert_eq!(problem["parameter"], parameter, "{rest}: {problem}");
    }
    check_alive(client).await;
}

#[tokio::test]
async fn a_filter_by_an_unknown_asset_gets_404() {
    let fixture = service().await;
    for path in ["sessions?asset=nobody", "faults?asset=nobody", "events?asset=nobody"] {
        let problem = fixture.client.get(path).await.problem(404);
        assert_eq!(problem["type"], "urn:offbd:problem:unknown-asset", "{path}");
    }
}

/// No answer has a word of the program or its parsers in it.
#[tokio::test]
async fn an_error_speaks_of_the_document_and_not_of_the_program() {
    let fixture = service().await;
    let client = &fixture.client;
    let stretch = json!({"sessions":[{"session":"x","from_s":"0","to_s":1}]});
    let mut problems = Vec::new();
    for (path, body) in [
        ("assets", json!({"name":7})),
        ("assets", json!({"name":"b","ball":7})),
        ("assets", json!({"name":"b","ball":{"mass_kg":null}})),
        ("assets", json!({"name":"b","axes":{"x":{"sign":"plus"}}})),
        ("assets", json!({"name":"b","diagnostics":{"profile":7}})),
        ("assets/a/sessions", json!({"name":7})),
        ("assets/a/calibrations", json!({"sessions":{}})),
        ("assets/a/calibrations", stretch),
        ("tokens", json!({})),
        ("tokens", json!({"name":"a","role":"boss"})),
        ("tokens", json!({"name":"a","role":7})),
        ("assets/a/telemetry", json!({"samples":{}})),
        ("assets/a/telemetry", json!({"session":[],"samples":[]})),
        ("assets/a/telemetry", json!([])),
    ] {
        problems.push(client.post(path, &body).await);
    }
    for body in ["", "{", "<a/>", "{\"name\":\"a\",\"name\":\"b\"}", "{} {}"] {
        problems.push(client.post_text("assets", "application/json", body).await);
        problems.push(client.post_text(TELEMETRY, "application/json", body).await);
    }
    problems.push(client.post_text(TELEMETRY, "application/msgpack", "\u{1}").await);
    for problem in &problems {
        let text = problem.json()["detail"].as_str().unwrap().to_owned();
        for word in ["invalid type", "expected", "f64", "u32", "struct", "variant", "View", "EOF"] {
            assert!(!text.contains(word), "{word}: {text}");
        }
        assert!(problem.status.is_client_error(), "{text}");
    }
}

#[tokio::test]
async fn a_json_body_must_say_that_it_is_json() {
    let fixture = service().await;
    let client = &fixture.client;
    let file = "{\"name\":\"b\"}";
    for kind in ["application/xml", "text/plain", "application/x-www-form-urlencoded"] {
        for path in ["assets", "assets/a/sessions", "tokens", "login"] {
            let problem = client.post_text(path, kind, file).await.problem(415);
            assert_eq!(problem["type"], "urn:offbd:problem:media-type", "{path}");
        }
    }
    let bare = client.request(Method::PUT, "assets/b").body(file);
    client.send(bare).await.problem(415);
    client.post_text("assets", "application/json; charset=utf-8", file).await.expect(201);
    // Nothing is sent, so there is nothing to state.
    client.send(client.request(Method::POST, "assets/a/sessions")).await.expect(201);
    let path = "assets/a/sessions/import?name=file";
    let kind = "application/octet-stream";
    client.post_text(path, kind, csv(&rig(10, 10))).await.expect(201);
}

#[tokio::test]
async fn an_ended_session_accepts_no_new_samples() {
    let fixture = service().await;
    let client = &fixture.client;
    let samples = rig(300, 300);
    client.telemetry("a", Some("one"), &samples[..200]).await;
    client.telemetry("a", Some("two"), &samples[..10]).await;
    assert_eq!(client.session("a", "one").await["state"], "ended");
    let again = client.telemetry("a", Some("one"), &samples[100..200]).await;
    assert_eq!((&again["accepted"], &again["duplicate"]), (&json!(0), &json!(100)));
    let body = crate::support::batch(Some("one"), &samples[150..250]);
    let problem = client.post(TELEMETRY, &body).await.problem(409);
    assert_eq!(problem["type"], "urn:offbd:problem:session-ended");
    assert_eq!(client.session("a", "two").await["state"], "open");
    client.post("assets/a/sessions", &json!({"name":"one"})).await.problem(409);
    client.post("assets/a/sessions", &json!({"name":"two"})).await.problem(409);
}

/// A device that sends until it gets 200 must get there, also with a row that was rejected.
#[tokio::test]
async fn a_batch_with_an_invalid_row_is_acknowledged_again_after_its_session_has_ended() {
    let fixture = service().await;
    let client = &fixture.client;
    let mut samples = rig(100, 100);
    samples[7].x_m = Some(1e9);
    let first = client.telemetry("a", Some("one"), &samples).await;
    client.end("a", "one").await;
    client.telemetry("a", Some("two"), &samples[..3]).await;
    let again = client.telemetry("a", Some("one"), &samples).await;
    assert_eq!((&first["accepted"], &again["duplicate"]), (&json!(99), &json!(99)));
    assert_eq!(again["rejected"], first["rejected"]);
    assert_eq!(again["rejected"][0]["index"], 7);
    assert_eq!(client.session("a", "one").await["rejected"], 1);
    assert_eq!(client.session("a", "two").await["rejected"], 0, "another session's row");
}

#[tokio::test]
async fn rows_that_were_rejected_are_rejected_again_after_their_session_has_ended() {
    for numbered in [false, true] {
        let fixture = service().await;
        let client = &fixture.client;
        let mut samples = rig(100, 100);
        if !numbered {
            samples.iter_mut().for_each(|sample| sample.seq = None);
        }
        client.telemetry("a", Some("one"), &samples).await;
        let mut others = samples.clone();
        others[7].x_m = Some(0.123);
        others[8].t_s += 1e-3; // with a number, another sample of this number
        if !numbered {
            others.remove(8);
        }
        let live = client.telemetry("a", Some("one"), &others).await;
        client.end("a", "one").await;
        let again = client.telemetry("a", Some("one"), &others).await;
        assert_eq!(again["duplicate"], live["duplicate"], "{again}");
        let of = |ack: &Value| {
            let rejected = ack["rejected"].as_array().unwrap();
            rejected.iter().map(|row| row["index"].clone()).collect::<Vec<_>>()
        };
        assert_eq!(of(&again), of(&live));
        assert_eq!(of(&again).len(), if numbered { 2 } else { 1 });
        // What is later than the session is for another one.
        let mut later = samples[99];
        later.t_s += 0.01;
        later.seq = later.seq.map(|seq| seq + 1);
        let batch = crate::support::batch(Some("one"), &[samples[99], later]);
        let problem = client.post(TELEMETRY, &batch).await.problem(409);
        assert_eq!(problem["type"], "urn:offbd:problem:session-ended");
    }
}
