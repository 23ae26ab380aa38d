//! Small promises at the edge of the service: names, headers, files and closing codes.

use crate::support::{ServiceFixture, eventually, on_postgres, rig};
use futures_util::StreamExt;
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
    let fixture = ServiceFixture::start().await;
    let client = &fixture.client;
    client.asset("a").await;
    let head = |path: &str, kind: &str| {
        format!(
            "POST /api/v1/{path} HTTP/1.1\r\nhost: localhost\r\ncontent-type: {kind}\r\n\
             content-length: 100000\r\n\r\n{{"
        )
    };
    let early = raw(&client.address, &head("assets/a/telemetry", "image/png")).await;
    assert!(early.starts_with("HTTP/1.1 415"), "{early}");
    assert!(early.to_lowercase().contains("connection: close"), "{early}");
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
