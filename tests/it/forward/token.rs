//! The token that the agent sends.

use axum::Router;
use axum::http::{HeaderMap, StatusCode};
use tokio::sync::mpsc;

use super::Agent;
use crate::support::{DEADLINE, rig};

/// The unit of systemd gives the agent an empty file if there is no token.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_empty_file_is_not_a_token() {
    let directory = tempfile::tempdir().unwrap();
    for (content, sent) in [("secret\n", Some("Bearer secret")), ("\n", None)] {
        let (got, mut requests) = mpsc::unbounded_channel();
        let take = move |headers: HeaderMap| async move {
            let _ = got.send(headers);
            StatusCode::SERVICE_UNAVAILABLE
        };
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
        let to = format!("http://{}", listener.local_addr().unwrap());
        let service = axum::serve(listener, Router::new().fallback(take)).into_future();
        let serving = tokio::spawn(service);
        let token = directory.path().join("token");
        std::fs::write(&token, content).unwrap();
        let spool = directory.path().join(format!("spool-{}", content.len()));
        let agent = Agent::start(&spool, &to, &["--token-file", token.to_str().unwrap()]);
        agent.client.telemetry("a", None, &rig(1, usize::MAX)).await;
        let headers = tokio::time::timeout(DEADLINE, requests.recv()).await.unwrap().unwrap();
        let authorization = headers.get("authorization").map(|value| value.to_str().unwrap());
        assert_eq!(authorization, sent);
        serving.abort();
    }
}
