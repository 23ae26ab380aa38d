//! What one device or one upload may take of the service has a bound.

use crate::support::process::Process;
use crate::support::web_socket::{CLOSE, TEXT, frame, open_websocket, read_frame};
use crate::support::{DEADLINE, ServiceFixture, batch, eventually, rig};
use offbd::config::Auth;
use serde_json::json;
use tokio::io::AsyncWriteExt;
use tokio::net::TcpStream;

/// Six files of 4 MiB with one invalid value per row, which once took 25 times their size.
#[cfg(target_os = "linux")]
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn imports_of_invalid_rows_use_little_more_memory_than_their_files() {
    const FILE: usize = 4 << 20;
    let data = tempfile::tempdir().unwrap();
    let process = Process::start(data.path());
    let client = &process.client;
    let before = client.resident_bytes().await;
    let mut file = "t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m\n".to_owned();
    file.push_str(&"x,,,,\n".repeat(FILE / 6));
    let sending: Vec<_> = (0..6)
        .map(|i| {
            let (client, file) = (client.clone(), file.clone());
            tokio::spawn(async move {
                client.asset(&format!("a{i}")).await;
                let path = format!("assets/a{i}/sessions/import?name=bad");
                client.post_text(&path, "text/csv", file).await.problem(400)
            })
        })
        .collect();
    let mut most: f64 = 0.0;
    while !sending.iter().all(tokio::task::JoinHandle::is_finished) {
        most = most.max(client.resident_bytes().await);
    }
    for import in sending {
        let problem = import.await.unwrap();
        let detail = problem["detail"].as_str().unwrap();
        assert!(
            detail.starts_with("no usable row: line 2: `t_s`: `x` is not a number"),
            "{detail}"
        );
    }
    let files = (6 * FILE) as f64;
    assert!(most - before < 2.5 * files, "{} MiB", (most - before) / f64::from(1 << 20));
}

/// Messages that are begun and not ended, of 56 MiB together.
#[cfg(target_os = "linux")]
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn unfinished_messages_of_streams_take_no_more_memory_than_all_bodies_may() {
    const STREAMS: usize = 60;
    const MESSAGE: usize = 1 << 20;
    const SENT: usize = MESSAGE - (MESSAGE >> 4);
    const BUDGET: usize = 8 << 20;
    let data = tempfile::tempdir().unwrap();
    let (budget, message) = (BUDGET.to_string(), MESSAGE.to_string());
    let environment = [
        ("OFFBD_LIMITS__BODIES_BYTES", std::path::Path::new(&budget)),
        ("OFFBD_LIMITS__BATCH_BYTES", std::path::Path::new(&message)),
    ];
    let process = Process::start_with(data.path(), &environment);
    let client = &process.client;
    client.asset("a").await;
    let mut document = batch(Some("s"), &rig(300, 300)[..50]).to_string();
    document.extend(std::iter::repeat_n(' ', MESSAGE - 100 - document.len()));
    let message = frame(document.as_bytes());
    let before = client.resident_bytes().await;
    let mut streams = Vec::new();
    for i in 0..STREAMS {
        let mut stream = open_websocket(&client.address).await;
        stream.write_all(&message[..SENT]).await.unwrap();
        streams.push(stream);
        let held = format!("offbd_bodies_bytes {}\n", (i + 1) * SENT);
        if (i + 1) * SENT <= BUDGET {
            let is_held = async || client.get("/metrics").await.text.contains(&held).then_some(());
            eventually(is_held).await;
        }
    }
    let mut others = streams.split_off(BUDGET / SENT);
    for stream in &mut others {
        let closed = tokio::time::timeout(DEADLINE, read_frame(stream)).await;
        let (kind, reason) = closed.expect("the stream is closed");
        assert_eq!((kind, &reason[..2]), (CLOSE, &1013_u16.to_be_bytes()[..]));
    }
    let more = client.resident_bytes().await - before;
    assert!(more < 2.5 * BUDGET as f64, "{} MiB", more / f64::from(1 << 20));
    // Others go on, and so do those that are within the budget.
    let samples = rig(300, 300);
    client.post("assets/a/telemetry", &batch(Some("s"), &samples[..50])).await.expect(200);
    streams[0].write_all(&message[SENT..]).await.unwrap();
    let (kind, answer) = read_frame(&mut streams[0]).await;
    assert_eq!(kind, TEXT);
    let answer: serde_json::Value = serde_json::from_slice(&answer).unwrap();
    assert_eq!((&answer["type"], &answer["duplicate"]), (&json!("ack"), &json!(50)), "{answer}");
}

/// One token that fills the budget of bodies and holds it turns away only itself.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn one_device_does_not_take_the_memory_of_all_bodies() {
    let fixture = ServiceFixture::start_with(|config| {
        config.auth = Some(Auth::Required);
        config.limits.bodies_bytes = 1 << 20;
        config.limits.batch_bytes = 256 << 10;
    })
    .await;
    let token = |name: &str| {
        let words = ["token", "create", "--name", name, "--role", "admin", "--data"];
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_offbd"))
            .args(words)
            .arg(fixture.data.path())
            .args(
                crate::support::config(fixture.data.path())
                    .database
                    .iter()
                    .flat_map(|url| ["--database".to_owned(), url.clone()]),
            )
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let text = String::from_utf8(output.stdout).unwrap();
        text.split_whitespace().find(|word| word.starts_with("offbd_")).unwrap().to_owned()
    };
    let (greedy, other) =
        (fixture.client.with(&token("greedy")), fixture.client.with(&token("other")));
    other.asset("a").await;
    // Eight bodies of 200 kB, each of which lacks its end.
    let mut held = Vec::new();
    let token = greedy.token.as_deref().unwrap();
    let head = format!(
        "POST /api/v1/assets/a/telemetry HTTP/1.1\r\nhost: localhost\r\n\
         authorization: Bearer {token}\r\ncontent-type: application/json\r\n\
         content-length: 200001\r\n\r\n"
    );
    for _ in 0..8 {
        let mut connection = TcpStream::connect(&greedy.address).await.unwrap();
        connection.write_all(head.as_bytes()).await.unwrap();
        connection.write_all(&[b' '; 200_000]).await.unwrap();
        held.push(connection);
    }
    eventually(async || {
        let used = other.get("/metrics").await.text;
        used.contains("offbd_bodies_bytes 400000").then_some(())
    })
    .await;
    let samples = rig(1000, 1000);
    for part in samples.chunks(100) {
        other.post("assets/a/telemetry", &batch(Some("s"), part)).await.expect(200);
    }
    let refused = greedy.post("assets/a/telemetry", &batch(Some("s"), &samples)).await;
    assert_eq!(refused.status, 429);
}

/// A device whose session names change all the time does not fill the store.
#[tokio::test]
async fn sessions_of_an_asset_begin_at_a_limited_rate() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    let samples = rig(2, 2);
    let mut n_opened = 0;
    for i in 0..300 {
        let answer =
            client.post("assets/a/telemetry", &batch(Some(&format!("s{i}")), &samples)).await;
        match answer.status.as_u16() {
            200 => n_opened += 1,
            429 => assert!(answer.headers.contains_key("retry-after")),
            status => panic!("{status}"),
        }
    }
    assert!((100..200).contains(&n_opened), "{n_opened} sessions");
    // The session that is open goes on.
    let open = client.get("sessions?asset=a&state=open").await.expect(200);
    let name = open["items"][0]["name"].as_str().unwrap();
    let more = rig(50, 50);
    let ack = client.telemetry("a", Some(name), &more[2..]).await;
    assert_eq!(ack["accepted"], json!(48));
}
