//! Traces sent to an OpenTelemetry collector, decoded by OpenTelemetry's own messages.

use axum::Router;
use axum::body::Bytes;
use axum::http::Method;
use axum::routing::post;
use opentelemetry_proto::tonic::collector::trace::v1::ExportTraceServiceRequest;
use opentelemetry_proto::tonic::common::v1::KeyValue;
use opentelemetry_proto::tonic::common::v1::any_value::Value as Attribute;
use opentelemetry_proto::tonic::trace::v1::Span;
use opentelemetry_proto::tonic::trace::v1::span::SpanKind;
use prost::Message;
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

/// Waits for the next export; returns the attributes of the process, and the spans.
async fn exported(traces: &mut mpsc::UnboundedReceiver<Bytes>) -> (Vec<KeyValue>, Vec<Span>) {
    let body = tokio::time::timeout(support::DEADLINE, traces.recv()).await;
    let body = body.expect("traces within the deadline").unwrap();
    let export = ExportTraceServiceRequest::decode(body).unwrap();
    let [of_process] = export.resource_spans.try_into().expect("one process");
    let scopes = of_process.scope_spans.into_iter();
    let spans = scopes.flat_map(|scope| scope.spans).collect();
    (of_process.resource.unwrap().attributes, spans)
}

fn attribute<'a>(attributes: &'a [KeyValue], key: &str) -> Option<&'a Attribute> {
    let found = attributes.iter().find(|attribute| attribute.key == key)?;
    found.value.as_ref()?.value.as_ref()
}

fn text(text: &str) -> Option<Attribute> {
    Some(Attribute::StringValue(text.to_owned()))
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

#[tokio::test(flavor = "multi_thread")]
async fn traces_are_sent_to_the_collector() {
    let (process, mut traces, _data) = service_with_traces("1").await;
    process.client.asset("a").await;
    process.client.telemetry("a", Some("s"), &rig(50, usize::MAX)).await;
    let mut spans = Vec::new();
    let named = |spans: &[Span], name: &str| spans.iter().find(|span| span.name == name).cloned();
    let (request, judge) = loop {
        let (of_process, next) = exported(&mut traces).await;
        let value = |key| attribute(&of_process, key).cloned();
        assert_eq!(value("service.name"), text("offbd"));
        assert_eq!(value("service.version"), text(env!("CARGO_PKG_VERSION")));
        spans.extend(next);
        let request = named(&spans, "POST /api/v1/assets/{asset}/telemetry");
        let found = request.zip(named(&spans, "judge")).zip(named(&spans, "commit"));
        if let Some((found, _commit)) = found {
            break found;
        }
    };
    assert_eq!(request.kind, SpanKind::Server as i32);
    let value = |key| attribute(&request.attributes, key).cloned();
    assert_eq!(value("http.request.method"), text("POST"));
    assert_eq!(value("http.route"), text("/api/v1/assets/{asset}/telemetry"));
    assert_eq!(value("url.path"), text("/api/v1/assets/a/telemetry"));
    assert_eq!(value("http.response.status_code"), Some(Attribute::IntValue(200)));
    assert_eq!(request.parent_span_id, [0; 0], "the request has no caller with a trace");
    assert_eq!(judge.kind, SpanKind::Internal as i32);
    assert_eq!((judge.trace_id, judge.parent_span_id), (request.trace_id, request.span_id));
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
    let (of_process, _) = exported(&mut traces).await;
    assert_eq!(attribute(&of_process, "service.name").cloned(), text("judge-of-the-lab"));
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
    let (_, spans) = exported(&mut traces).await;
    let route = |span: &Span| attribute(&span.attributes, "http.route").cloned();
    let requests: Vec<_> =
        spans.iter().filter(|span| span.kind == SpanKind::Server as i32).collect();
    assert_eq!(requests.len(), 1, "the callers do not trace the others: {requests:?}");
    assert_eq!(route(requests[0]), text("/api/v1/fleet"));
    assert_eq!(
        (&requests[0].trace_id[..], &requests[0].parent_span_id[..]),
        (&TRACE[..], &PARENT[..])
    );
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
