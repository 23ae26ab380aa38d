//! Traces sent to an OpenTelemetry collector.

use axum::Router;
use axum::body::Bytes;
use axum::http::Method;
use axum::routing::post;
use serde_json::Value;
use tokio::sync::mpsc;

use crate::support::process::Process;
use crate::support::{self, eventually, rig};

/// Starts a collector; returns its address and the bodies that it receives.
async fn collector() -> (String, mpsc::UnboundedReceiver<Bytes>) {
    let (got, traces) = mpsc::unbounded_channel();
    let take = post(move |body: Bytes| async move { drop(got.send(body)) });
    let app = Router::new().route("/v1/traces", take);
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap().to_string();
    tokio::spawn(async move { axum::serve(listener, app).await.unwrap() });
    (address, traces)
}

/// Starts a service that sends this fraction of its own traces to a collector.
async fn service_with_traces(
    share: &str,
) -> (Process, mpsc::UnboundedReceiver<Bytes>, tempfile::TempDir) {
    let (address, traces) = collector().await;
    let data = tempfile::tempdir().unwrap();
    let endpoint = format!("http://{address}");
    let settings =
        [("OFFBD_TRACES__ENDPOINT", endpoint.as_ref()), ("OFFBD_TRACES__SHARE", share.as_ref())];
    (Process::start_with(data.path(), &settings), traces, data)
}

/// Returns whether `word` occurs in `bytes`.
fn has(bytes: &[u8], word: impl AsRef<[u8]>) -> bool {
    let word = word.as_ref();
    bytes.windows(word.len()).any(|window| window == word)
}

#[tokio::test(flavor = "multi_thread")]
async fn traces_are_sent_to_the_collector() {
    let (process, mut traces, _data) = service_with_traces("1").await;
    process.client.asset("a").await;
    process.client.telemetry("a", Some("s"), &rig(50, usize::MAX)).await;
    let mut received = Vec::new();
    let words = [
        "offbd",
        "service.version",
        "POST /api/v1/assets/{asset}/telemetry",
        "http.route",
        "http.response.status_code",
        "/api/v1/assets/a/telemetry",
        "judge",
        "commit",
    ];
    while !words.iter().all(|word| has(&received, word)) {
        let next = tokio::time::timeout(support::DEADLINE, traces.recv()).await;
        received.extend(next.expect("traces within the deadline").unwrap());
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_variables_of_opentelemetry_apply() {
    let (address, mut traces) = collector().await;
    let data = tempfile::tempdir().unwrap();
    let endpoint = format!("http://{address}");
    let settings = [
        ("OTEL_EXPORTER_OTLP_ENDPOINT", endpoint.as_ref()),
        ("OTEL_SERVICE_NAME", "judge-of-the-lab".as_ref()),
        ("OTEL_TRACES_SAMPLER", "always_on".as_ref()),
    ];
    let process = Process::start_with(data.path(), &settings);
    process.client.asset("a").await;
    let received = tokio::time::timeout(support::DEADLINE, traces.recv()).await.unwrap().unwrap();
    assert!(has(&received, "judge-of-the-lab"), "{received:?}");
}

/// The example of <https://www.w3.org/TR/trace-context/#examples-of-http-traceparent-headers>.
const TRACE: [u8; 16] = 0x4bf92f3577b34da6a3ce929d0e0e4736_u128.to_be_bytes();
const PARENT: [u8; 8] = 0x00f067aa0ba902b7_u64.to_be_bytes();

#[tokio::test(flavor = "multi_thread")]
async fn a_request_joins_the_trace_of_its_caller() {
    let (process, mut traces, _data) = service_with_traces("0").await;
    let ask = |path: &str, parent: &str| {
        let request = process.client.request(Method::GET, path).header("traceparent", parent);
        async move { assert!(request.send().await.unwrap().status().is_success()) }
    };
    ask("/api/v1/assets", "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-00").await;
    ask("/api/v1/assets", "nonsense").await;
    ask("/api/v1/fleet", "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01").await;
    let received = tokio::time::timeout(support::DEADLINE, traces.recv()).await.unwrap().unwrap();
    assert!(has(&received, TRACE) && has(&received, PARENT) && has(&received, "/api/v1/fleet"));
    assert!(!has(&received, "/api/v1/assets"), "the caller does not trace this request");
}

/// The service works without the collector.
#[tokio::test(flavor = "multi_thread")]
async fn an_unavailable_collector_does_not_affect_the_service() {
    let data = tempfile::tempdir().unwrap();
    let nowhere = "http://127.0.0.1:9";
    let process = Process::start_with(data.path(), &[("OFFBD_TRACES__ENDPOINT", nowhere.as_ref())]);
    process.client.asset("a").await;
    let samples = rig(500, usize::MAX);
    for part in samples.chunks(5) {
        process.client.telemetry("a", Some("s"), part).await;
    }
    let ready = eventually(|| async {
        let answer = process.client.get("/readyz").await;
        (answer.status == 200).then(|| answer.json())
    });
    assert_eq!(ready.await["status"], Value::from("ok"));
}
