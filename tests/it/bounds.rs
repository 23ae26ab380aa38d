//! What one device or one upload may take of the service has a bound.

use crate::support::process::Process;
use crate::support::{ServiceFixture, batch, rig};
use offbd::config::Auth;
use serde_json::json;
use tokio::io::AsyncWriteExt;
use tokio::net::TcpStream;

/// Six files of 10 MiB with one invalid value per row, which took 1.5 GB once.
#[cfg(target_os = "linux")]
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn imports_of_invalid_rows_use_little_more_memory_than_their_files() {
    const FILE: usize = 10 << 20;
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
                client.post_text(&path, "text/csv", file).await.expect(201)
            })
        })
        .collect();
    let mut most: f64 = 0.0;
    while !sending.iter().all(tokio::task::JoinHandle::is_finished) {
        most = most.max(client.resident_bytes().await);
    }
    for import in sending {
        let view = import.await.unwrap();
        assert_eq!(view["rejected"], FILE / 6);
        assert_eq!(view["rejections"].as_array().unwrap().len(), 100);
    }
    let files = (6 * FILE) as f64;
    assert!(most - before < 2.5 * files, "{} MiB", (most - before) / f64::from(1 << 20));
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
    crate::support::eventually(async || {
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
