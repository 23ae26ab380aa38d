//! `/metrics`: what the service counts and measures, in the text format of
//! Prometheus.
//!
//! [`METRICS`] names all of them. Whatever has no labels, or labels that are
//! known beforehand, is there with 0 from the start, so that a first event is
//! seen as a rise. No label takes a value from outside.

use std::sync::OnceLock;
use std::time::Duration;

use axum::extract::State;
use axum::http::header::CONTENT_TYPE;
use axum::response::IntoResponse;
use metrics::{counter, describe_counter, describe_gauge, describe_histogram, gauge};
use metrics_exporter_prometheus::{BuildError, Matcher, PrometheusBuilder, PrometheusHandle};
use tokio_util::sync::CancellationToken;

use super::App;
use offbd_core::vocabulary::{FaultCode, FaultStatus};

/// What a metric is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// It rises.
    Counter,
    /// It rises and falls.
    Gauge,
    /// Seconds, by [`SECONDS`].
    Seconds,
    /// Numbers of things, by [`NUMBERS`].
    Numbers,
}

use Kind::{Counter, Gauge, Numbers, Seconds};

/// Every metric with its kind and its meaning.
const METRICS: [(&str, Kind, &str); 28] = [
    ("offbd_ack_seconds", Seconds, "From the arrival of a batch until it was durable"),
    ("offbd_bodies_bytes", Gauge, "Bytes of request bodies in memory"),
    ("offbd_build_info", Gauge, "1, with the version"),
    ("offbd_commit_failures_total", Counter, "Commits that failed; those of an outage come again"),
    ("offbd_commit_seconds", Seconds, "What a commit took"),
    ("offbd_commit_sets", Numbers, "Sets of changes in one commit"),
    ("offbd_commits_total", Counter, "Commits"),
    ("offbd_connections", Gauge, "Connections"),
    ("offbd_connections_refused_total", Counter, "Connections closed at once: there were too many"),
    ("offbd_engines", Gauge, "Engines in memory, by shard"),
    ("offbd_fault_changes_total", Counter, "Changes of status that became durable, by fault code"),
    ("offbd_http_request_seconds", Seconds, "Until the answer to a request began, by path"),
    ("offbd_http_requests_total", Counter, "Requests answered, by path and status"),
    ("offbd_ingest_stalled", Gauge, "Whether nothing is taken and nothing committed"),
    ("offbd_journal_bytes", Gauge, "Bytes in the journal, not folded into the recordings yet"),
    ("offbd_process_resident_bytes", Gauge, "Memory of the process (Linux)"),
    ("offbd_refused_total", Counter, "Requests refused before they were looked at, by status"),
    ("offbd_samples_in_flight", Gauge, "Samples between arrival and commit"),
    ("offbd_samples_in_flight_limit", Gauge, "How many there may be: limits.in_flight_samples"),
    ("offbd_samples_total", Counter, "Samples, by what became of them"),
    ("offbd_samples_unjudged_total", Counter, "Samples rejected or set aside, by reason"),
    ("offbd_sessions_expired_total", Counter, "Sessions given up, by reason"),
    ("offbd_shard_queue", Gauge, "Requests that wait for a shard"),
    ("offbd_store_writable", Gauge, "Whether the last commit went through"),
    ("offbd_streams", Gauge, "Open WebSockets"),
    ("offbd_streams_cut_off_total", Counter, "WebSockets whose client did not read"),
    ("offbd_turned_away_total", Counter, "Batches and requests told to come again, by full queue"),
    ("offbd_writer_queue", Gauge, "Sets of changes that wait for the writer"),
];

/// Bounds of durations, s: a commit to a good disk takes 1 ms, an answer is
/// given up after 60 s.
const SECONDS: [f64; 14] =
    [0.001, 0.0025, 0.005, 0.01, 0.02, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 60.0];

/// Bounds of numbers, up to the most sets in a commit.
const NUMBERS: [f64; 10] = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0, 512.0];

static RECORDER: OnceLock<Option<PrometheusHandle>> = OnceLock::new();

/// How often what was measured is folded into the metrics. Between, every single
/// duration is kept: a moment's worth, whether anybody asks for the metrics or not.
const UPKEEP: Duration = Duration::from_secs(5);

/// Begins to gather metrics, once for the process.
pub fn gather_metrics() {
    RECORDER.get_or_init(|| match install() {
        Ok(handle) => {
            describe();
            begin_with_nothing();
            Some(handle)
        }
        Err(error) => {
            tracing::error!(%error, "no metrics");
            None
        }
    });
}

/// Folds what was measured into the metrics until the server stops.
pub async fn keep_metrics(closing: CancellationToken) {
    let Some(Some(handle)) = RECORDER.get() else { return };
    loop {
        tokio::select! {
            () = closing.cancelled() => return,
            () = tokio::time::sleep(UPKEEP) => handle.run_upkeep(),
        }
    }
}

fn install() -> Result<PrometheusHandle, BuildError> {
    let mut builder = PrometheusBuilder::new();
    for (name, kind, _) in METRICS {
        let name = Matcher::Full(name.to_owned());
        builder = match kind {
            Seconds => builder.set_buckets_for_metric(name, &SECONDS)?,
            Numbers => builder.set_buckets_for_metric(name, &NUMBERS)?,
            Counter | Gauge => builder,
        };
    }
    builder.install_recorder()
}

fn describe() {
    for (name, kind, meaning) in METRICS {
        match kind {
            Counter => describe_counter!(name, meaning),
            Gauge => describe_gauge!(name, meaning),
            Seconds | Numbers => describe_histogram!(name, meaning),
        }
    }
}

/// Every series that is known before anything happens.
fn begin_with_nothing() {
    let zero = |name: &'static str, label: &'static str, values: &[&'static str]| {
        values.iter().for_each(|value| counter!(name, label => *value).absolute(0));
    };
    for name in [
        "offbd_commit_failures_total",
        "offbd_commits_total",
        "offbd_connections_refused_total",
        "offbd_streams_cut_off_total",
    ] {
        counter!(name).absolute(0);
    }
    zero("offbd_refused_total", "status", &["401", "403", "405", "421", "429", "503"]);
    zero("offbd_samples_total", "outcome", &["accepted", "duplicate", "rejected", "late"]);
    let reasons = ["form", "not_finite", "absurd", "late", "jump"];
    zero("offbd_samples_unjudged_total", "reason", &reasons);
    zero("offbd_sessions_expired_total", "reason", &["age", "size"]);
    zero("offbd_turned_away_total", "queue", &["samples", "shard"]);
    for code in FaultCode::ALL {
        for status in FaultStatus::ALL {
            let (code, status) = (code.as_str(), status.as_str());
            counter!("offbd_fault_changes_total", "code" => code, "status" => status).absolute(0);
        }
    }
    gauge!("offbd_ingest_stalled").set(0.0);
    gauge!("offbd_journal_bytes").set(0.0);
    gauge!("offbd_streams").set(0.0);
    gauge!("offbd_store_writable").set(1.0);
    gauge!("offbd_build_info", "version" => env!("CARGO_PKG_VERSION")).set(1.0);
}

/// Metrics in the text format of Prometheus.
#[utoipa::path(get, path = "/metrics", tag = "operation",
    responses((status = 200, body = String, content_type = "text/plain")))]
pub(super) async fn metrics(State(app): State<App>) -> impl IntoResponse {
    look(&app);
    let handle = RECORDER.get().and_then(Option::as_ref);
    let text = handle.map(|handle| {
        handle.run_upkeep();
        handle.render()
    });
    ([(CONTENT_TYPE, "text/plain; version=0.0.4")], text.unwrap_or_default())
}

/// What is looked up when somebody asks.
#[expect(clippy::cast_precision_loss, reason = "no queue is as long as 2^52")]
fn look(app: &App) {
    let load = app.service.load();
    gauge!("offbd_samples_in_flight").set(load.samples as f64);
    gauge!("offbd_samples_in_flight_limit").set(app.service.limits().in_flight_samples as f64);
    gauge!("offbd_writer_queue").set(load.writer as f64);
    for (shard, waiting) in load.shards.iter().enumerate() {
        gauge!("offbd_shard_queue", "shard" => shard.to_string()).set(*waiting as f64);
    }
    gauge!("offbd_bodies_bytes").set(app.budget.used() as f64);
    if let Some(bytes) = resident_bytes() {
        gauge!("offbd_process_resident_bytes").set(bytes as f64);
    }
}

/// What the process holds in memory; none where the system does not say so.
fn resident_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}
