//! Clients that are not devices: pages of other sites, and those that never end a request.

use std::io::{Read, Write};
use std::net::TcpStream;

use reqwest::Method;
use serde_json::json;

use super::{Agent, nowhere};
use crate::support::{DEADLINE, batch, rig};

const PATH: &str = "assets/a/telemetry";

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_page_of_another_site_cannot_fill_the_spool() {
    let directory = tempfile::tempdir().unwrap();
    let agent =
        Agent::start(&directory.path().join("spool"), &nowhere(), &["--host", "gateway.local"]);
    let body = batch(Some("s"), &rig(1, usize::MAX)).to_string();
    let port = agent.client.address.rsplit_once(':').unwrap().1;
    // What a page can send without asking: no type, or that of a form; always with its origin.
    for kind in ["text/plain", "application/x-www-form-urlencoded"] {
        let request = agent.client.request(Method::POST, PATH).body(body.clone());
        agent.client.send(request.header("content-type", kind)).await.problem(415);
    }
    let untyped = || agent.client.request(Method::POST, PATH).body(body.clone());
    let of_page = untyped().header("origin", "https://evil.example");
    agent.client.send(of_page).await.problem(403);
    let post = |headers: &[(&str, String)]| {
        let request = agent.client.request(Method::POST, PATH).body(body.clone());
        let request = request.header("content-type", "application/json");
        let request = headers.iter().fold(request, |r, (name, value)| r.header(*name, value));
        agent.client.send(request)
    };
    for origin in
        ["https://evil.example".to_owned(), "null".to_owned(), format!("http://[::2]:{port}")]
    {
        post(&[("origin", origin)]).await.problem(403);
    }
    // A name that a page has let point to this machine.
    for host in ["evil.example".to_owned(), format!("gateway.local.evil.example:{port}")] {
        post(&[("host", host.clone())]).await.problem(421);
        let read = agent.client.request(Method::GET, "spool").header("host", host);
        agent.client.send(read).await.problem(421);
    }
    assert_eq!(agent.status().await["waiting_batches"], json!(0));
    let own = format!("http://{}", agent.client.address);
    let by_name = ("host", format!("gateway.local:{port}"));
    let local = ("host", format!("localhost:{port}"));
    for headers in [&[][..], &[("origin", own)], &[by_name], &[local]] {
        post(headers).await.expect(200);
    }
    // A device without a type sends JSON, as to the service.
    agent.client.send(untyped()).await.expect(200);
    assert_eq!(agent.status().await["waiting_batches"], json!(5));
}

#[test]
fn a_request_that_never_ends_is_ended() {
    let directory = tempfile::tempdir().unwrap();
    let agent = Agent::start(&directory.path().join("spool"), &nowhere(), &[]);
    let head = format!("POST /api/v1/{PATH} HTTP/1.1\r\nHost: {}\r\n", agent.client.address);
    let body = "Content-Type: application/json\r\nContent-Length: 5000\r\n\r\n{";
    let answers = [head.clone(), head + body].map(|part| {
        let mut stranger = TcpStream::connect(&agent.client.address).unwrap();
        stranger.set_read_timeout(Some(DEADLINE)).unwrap();
        stranger.write_all(part.as_bytes()).unwrap();
        stranger
    });
    let answers = answers.map(|mut stranger| {
        let mut answer = String::new();
        stranger.read_to_string(&mut answer).unwrap();
        answer
    });
    assert_eq!(answers[0], "");
    assert!(answers[1].starts_with("HTTP/1.1 408 Request Timeout\r\n"), "{}", answers[1]);
    assert!(answers[1].contains("urn:offbd:problem:"), "{}", answers[1]);
}
