//! Small promises at the edge of the service: names, headers, files and closing codes.

use crate::support::{ServiceFixture, config, eventually, on_postgres, rig};
use futures_util::StreamExt;
use offbd::config::Auth;
use offbd::server::tokens::create_token;
use offbd::service::access::{NewToken, Role};
use reqwest::Method;
use serde_json::json;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio_tungstenite::connect_async;
use tokio_tungstenite::tungstenite::Message;

/// Sends `head` as it is, and returns what is received until the connection is closed.
async fn raw(address: &str, head: &str) -> String {
    let mut connection = TcpStream::connect(address).await.unwrap();
    connection.write_all(head.as_bytes()).await.unwrap();
    let mut text = Vec::new();
    connection.read_to_end(&mut text).await.unwrap();
    String::from_utf8_lossy(&text).into_owned()
}

#[tokio::test]
async fn without_tokens_only_a_local_host_is_answered() {
    let fixture = ServiceFixture::start().await;
    let status = async |host: &str| {
        let request = format!("GET /api/v1/assets HTTP/1.1\r\n{host}connection: close\r\n\r\n");
        let answer = raw(&fixture.client.address, &request).await;
        answer.split(' ').nth(1).unwrap_or_default().to_owned()
    };
    for host in ["127.0.0.1", "127.0.0.1:80", "localhost:8087", "[::1]", "[::1]:8087", "10.1.2.3"] {
        assert_eq!(status(&format!("host: {host}\r\n")).await, "200", "{host}");
    }
    for host in [
        "evil.example",
        "a\"b.evil.example",
        "a{b}.evil.example",
        "[::1].evil.example",
        "127.0.0.1.evil.example",
        "localhost.evil.example",
        "localhost@evil.example",
        "127.0.0.1:",
    ] {
        let found = status(&format!("host: {host}\r\n")).await;
        assert!(found == "421" || found == "400", "{host}: {found}");
    }
    for missing in ["", "host: \r\n"] {
        let found = status(missing).await;
        assert!(found == "421" || found == "400", "{missing:?}: {found}");
    }
}

#[tokio::test]
async fn names_that_clients_cannot_address_are_invalid() {
    let fixture = ServiceFixture::start().await;
    for name in [".", ".."] {
        let answer = fixture.client.post("assets", &json!({"name": name})).await;
        assert_eq!(answer.problem(422)["pointer"], "/name", "{name}");
    }
    fixture.client.asset("...").await;
}

#[tokio::test]
async fn a_repeated_key_is_an_error_and_loses_nothing() {
    let fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    for (key, document) in [
        ("samples", r#"{"samples":[{"t_s":1}],"samples":[{"t_s":2}]}"#),
        ("session", r#"{"session":"a","session":"b","samples":[{"t_s":1}]}"#),
        ("t_s", r#"{"t_s":[1,2],"t_s":[3,4]}"#),
    ] {
        let path = "assets/a/telemetry";
        let answer = fixture.client.post_text(path, "application/json", document).await;
        let detail = answer.problem(400)["detail"].clone();
        let wanted = format!("`{key}` is given twice");
        assert!(detail.as_str().unwrap().contains(&wanted), "{detail}");
    }
}

#[tokio::test]
async fn an_answer_before_the_body_announces_that_the_connection_is_closed() {
    let fixture = ServiceFixture::start_with(|config| config.limits.batch_bytes = 2000).await;
    let client = &fixture.client;
    client.asset("a").await;
    let head = |path: &str, kind: &str| {
        format!(
            "POST /api/v1/{path} HTTP/1.1\r\nhost: localhost\r\ncontent-type: {kind}\r\n\
             content-length: 100000\r\n\r\n{{"
        )
    };
    let json = "application/json";
    let too_long = head("assets/a/telemetry", json) + &" ".repeat(3000);
    for (head, status) in [
        (head("assets/a/telemetry", "image/png"), 415),
        (head("assets/a/nothing", json), 404),
        (too_long, 413),
    ] {
        let early = raw(&client.address, &head).await;
        assert!(early.starts_with(&format!("HTTP/1.1 {status}")), "{early}");
        assert!(early.to_lowercase().contains("connection: close"), "{early}");
    }
    // A refused body that arrives as a whole leaves the connection open, whether its first
    // byte tells that it is refused or its end. It is larger than the buffers of a socket.
    let request = client.request(Method::POST, "assets/a/telemetry").body(vec![b' '; 10 << 20]);
    let answer = request.header("content-type", "image/png").send().await.unwrap();
    assert_eq!(answer.status(), 415);
    assert!(!answer.headers().contains_key("connection"));
    let request = client.request(Method::POST, "assets/a/telemetry").body("{");
    let answer = request.header("content-type", "application/json").send().await.unwrap();
    assert_eq!(answer.status(), 400);
    assert!(!answer.headers().contains_key("connection"));
}

#[tokio::test]
async fn a_stream_is_closed_with_the_code_of_its_error() {
    let fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    let url = format!("ws://{}/api/v1/assets/a/stream", fixture.client.address);
    // A text frame that is not UTF-8 (RFC 6455, 8.1), and a reserved operation code (5.2).
    for (frame, expected) in
        [(&[0x81, 0x82, 0, 0, 0, 0, 0xff, 0xfe][..], 1007), (&[0x83, 0x80, 0, 0, 0, 0], 1002)]
    {
        let (mut socket, _) = connect_async(&url).await.unwrap();
        let tokio_tungstenite::MaybeTlsStream::Plain(connection) = socket.get_mut() else {
            panic!("not encrypted")
        };
        connection.write_all(frame).await.unwrap();
        let code = loop {
            match socket.next().await {
                Some(Ok(Message::Close(Some(frame)))) => break u16::from(frame.code),
                Some(Ok(_)) => {}
                other => panic!("{other:?}"),
            }
        };
        assert_eq!(code, expected);
        let _ = socket.close(None).await;
    }
}

#[cfg(unix)]
#[tokio::test]
async fn the_files_of_the_store_are_readable_by_their_owner_only() {
    use std::os::unix::fs::PermissionsExt;
    if on_postgres() {
        return;
    }
    let fixture = ServiceFixture::start().await;
    fixture.client.asset("a").await;
    let data = fixture.data.path();
    let copy = data.join("copy.sqlite");
    let backup = std::process::Command::new(env!("CARGO_BIN_EXE_offbd"))
        .args(["backup", "--data"])
        .args([data, &copy])
        .status();
    assert!(backup.unwrap().success());
    for name in ["offbd.sqlite", "offbd.sqlite-wal", "offbd.sqlite-shm", "copy.sqlite"] {
        let mode = std::fs::metadata(data.join(name)).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600, "{name}");
    }
}

#[cfg(unix)]
#[tokio::test]
async fn a_link_to_the_file_of_a_store_is_not_another_store() {
    if on_postgres() {
        return;
    }
    let fixture = ServiceFixture::start().await;
    let elsewhere = tempfile::tempdir().unwrap();
    let file = fixture.data.path().join("offbd.sqlite");
    std::os::unix::fs::symlink(file, elsewhere.path().join("offbd.sqlite")).unwrap();
    let second = offbd::server::start(config(elsewhere.path())).await;
    let error = format!("{:#}", second.err().expect("the store is locked"));
    assert!(error.contains("another process"), "{error}");
}

#[cfg(unix)]
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn readiness_tells_the_words_of_the_database_only_without_tokens() {
    if on_postgres() {
        return;
    }
    for (auth, reason) in [(None, "was removed or replaced"), (Some(Auth::Required), "see the log")]
    {
        let fixture = ServiceFixture::start_with(|config| config.auth = auth).await;
        let file = fixture.data.path().join("offbd.sqlite");
        let (name, role) = ("root".to_owned(), Role::Admin);
        let wanted = NewToken { name, role, asset: None, expires_at: None };
        let secret = create_token(&config(fixture.data.path()), wanted).await.unwrap();
        let client = fixture.client.with(&secret);
        std::fs::rename(&file, file.with_extension("aside")).unwrap();
        let creating =
            tokio::spawn(async move { client.post("assets", &json!({"name": "a"})).await });
        let detail = fixture.client.readiness(503).await;
        assert!(detail.contains(reason), "{detail}");
        assert_eq!(detail.contains("removed"), auth.is_none(), "{detail}");
        std::fs::rename(file.with_extension("aside"), &file).unwrap();
        creating.await.unwrap().expect(201);
    }
}

/// A replay or a calibration of a session that is deleted meanwhile is accepted, or the
/// session is not found; never is that an error of the service.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_job_beside_a_deletion_is_accepted_or_finds_no_session() {
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    for round in 0..40 {
        client.telemetry("a", Some(&round.to_string()), &rig(20, 20)).await;
        let session = client.end("a", &round.to_string()).await;
        let id = session["id"].as_str().unwrap();
        let jobs = ["replays", "calibrations"].map(|kind| {
            let (client, id) = (client.clone(), id.to_owned());
            tokio::spawn(async move {
                for _ in 0..4 {
                    let answer = match kind {
                        "replays" => {
                            client.post(&format!("sessions/{id}/replays"), &json!({})).await
                        }
                        _ => {
                            let body = json!({ "sessions": [id] });
                            client.post("assets/a/calibrations", &body).await
                        }
                    };
                    let status = answer.status.as_u16();
                    // A calibration names its sessions in its body.
                    let unknown = if kind == "replays" { 404 } else { 422 };
                    assert!([202, 429, unknown].contains(&status), "{kind}: {}", answer.text);
                }
            })
        });
        client.delete(&format!("sessions/{id}")).await.expect(204);
        for job in jobs {
            job.await.unwrap();
        }
    }
}

#[cfg(unix)]
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nothing_is_acknowledged_into_a_removed_file() {
    if on_postgres() {
        return;
    }
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    client.telemetry("a", Some("s"), &rig(10, 10)).await;
    let file = fixture.data.path().join("offbd.sqlite");
    let aside = fixture.data.path().join("aside.sqlite");
    std::fs::rename(&file, &aside).unwrap();
    let sending = tokio::spawn({
        let client = client.clone();
        async move { client.telemetry("a", Some("s"), &rig(20, 20)).await }
    });
    let reason = eventually(async || {
        let ready = client.get("/readyz").await;
        (ready.status == 503).then(|| ready.problem(503)["detail"].clone())
    })
    .await;
    assert!(reason.as_str().unwrap().contains("was removed or replaced"), "{reason}");
    std::fs::rename(&aside, &file).unwrap();
    assert_eq!(sending.await.unwrap()["accepted"], 10, "once the file is back");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_start_waits_a_little_for_the_lock_of_a_process_that_is_ending() {
    if on_postgres() {
        return;
    }
    let data = tempfile::tempdir().unwrap();
    let lock = std::fs::File::create(data.path().join("offbd.sqlite.lock")).unwrap();
    lock.lock().unwrap();
    let mut start = Box::pin(offbd::server::start(config(data.path())));
    assert!(futures_util::poll!(&mut start).is_pending(), "it is locked");
    drop(lock);
    start.await.unwrap().shutdown().await.unwrap();
}
