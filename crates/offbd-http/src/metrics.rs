//! `/metrics`: the service's metrics in the text format of Prometheus.
//!
//! [`METRICS`] lists all of them but `offbd_partition_epoch`. Series without labels, or with labels known in advance,
//! are exported as 0 from the start, so that `rate()` sees the first event. No label
//! has a value from outside the service.

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

/// The kind of a metric.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum MetricKind {
    /// A value that only increases.
    Counter,
    /// A value that may decrease.
    Gauge,
    /// A histogram of durations, s, with the buckets [`SECONDS`].
    Seconds,
    /// A histogram of counts with the buckets [`SIZES`].
    Sizes,
}

use MetricKind::{Counter, Gauge, Seconds, Sizes};

/// Every metric with its kind and its description.
const METRICS: &[(&str, MetricKind, &str)] = &[
    ("offbd_ack_seconds", Seconds, "Time from the arrival of a batch to its acknowledgement"),
    ("offbd_assets_rebuilding", Gauge, "Assets whose engine is to be rebuilt after the start"),
    ("offbd_assets_untested", Gauge, "Assets whose samples are not judged"),
    ("offbd_bodies_bytes", Gauge, "Bytes of request bodies in memory"),
    ("offbd_build_info", Gauge, "Always 1; the label has the version"),
    ("offbd_bus_connected", Gauge, "1 while connected to the server of NATS or the MQTT broker"),
    ("offbd_bus_devices_online", Gauge, "Devices that say over NATS or MQTT that they are online"),
    ("offbd_bus_faults_total", Counter, "Events published over NATS or MQTT"),
    ("offbd_bus_logins_total", Counter, "Questions of the NATS server for rights, by outcome"),
    ("offbd_bus_messages_total", Counter, "Messages of devices over NATS and MQTT, by outcome"),
    (
        "offbd_bus_replies_refused_total",
        Counter,
        "NATS messages not answered on their reply subject",
    ),
    ("offbd_bus_unsafe", Gauge, "1 if the NATS server may lose messages, see the log"),
    ("offbd_cluster_nodes", Gauge, "Nodes of the cluster that are alive"),
    ("offbd_commit_failures_total", Counter, "Failed commits, including retried ones"),
    ("offbd_commit_seconds", Seconds, "Duration of a commit"),
    ("offbd_commit_sets", Sizes, "Write sets in a commit"),
    ("offbd_commits_overtaken_total", Counter, "Write sets refused because their partition moved"),
    ("offbd_commits_total", Counter, "Successful commits"),
    ("offbd_communication_lost", Gauge, "Rigs with an open session whose data stay away"),
    ("offbd_connections", Gauge, "Open connections"),
    ("offbd_connections_refused_total", Counter, "Connections refused at the limit"),
    ("offbd_deliveries_given_up_total", Counter, "Notifications given up, by kind of channel"),
    ("offbd_delivery_attempts_total", Counter, "Attempts to deliver, by channel and result"),
    ("offbd_engines", Gauge, "Engines in memory, by shard"),
    ("offbd_fault_changes_total", Counter, "Durable fault transitions, by code and status"),
    ("offbd_http_request_seconds", Seconds, "Time until a response starts, by path"),
    ("offbd_http_requests_total", Counter, "Requests, by path and status"),
    ("offbd_ingest_stalled", Gauge, "1 if batches wait and nothing is committed"),
    ("offbd_journal_bytes", Gauge, "Bytes in the journal, not yet folded into the recordings"),
    ("offbd_partitions_handed_over_total", Counter, "Partitions given to other nodes as planned"),
    ("offbd_partitions_lost_total", Counter, "Partitions that other nodes have taken"),
    ("offbd_partitions_owned", Gauge, "Partitions that this node owns"),
    ("offbd_partitions_taken_total", Counter, "Partitions that this node has taken"),
    ("offbd_partitions_unowned", Gauge, "Partitions without an owner, as this node last saw"),
    ("offbd_process_resident_bytes", Gauge, "Resident memory of the process (Linux)"),
    ("offbd_refused_total", Counter, "Requests denied by the guard, by status"),
    ("offbd_requests_forwarded_total", Counter, "Requests sent to the node that owns the asset"),
    ("offbd_samples_in_flight", Gauge, "Samples between arrival and commit"),
    ("offbd_samples_in_flight_limit", Gauge, "Limit of these: limits.in_flight_samples"),
    ("offbd_samples_reevaluated_total", Counter, "Recorded samples evaluated again on loading"),
    ("offbd_samples_total", Counter, "Samples, by outcome"),
    ("offbd_samples_unjudged_total", Counter, "Samples rejected or set aside, by reason"),
    ("offbd_scrub_findings_total", Counter, "Damage and differences found, by kind"),
    ("offbd_scrub_sessions_total", Counter, "Sessions that the scrub found in order"),
    ("offbd_sessions_expired_total", Counter, "Sessions deleted by retention, by reason"),
    ("offbd_shard_queue", Gauge, "Commands in the queue of a shard"),
    ("offbd_store_writable", Gauge, "1 if the last commit succeeded"),
    ("offbd_streams", Gauge, "Open WebSockets"),
    ("offbd_streams_cut_off_total", Counter, "WebSockets closed because the client was too slow"),
    ("offbd_turned_away_total", Counter, "Batches and requests answered with 429, by full queue"),
    ("offbd_writer_queue", Gauge, "Write sets in the queue of the writer"),
];

/// What may become of a message of a device.
const BUS_OUTCOMES: [&str; 11] = [
    "elsewhere",
    "taken",
    "malformed",
    "unknown_asset",
    "conflict",
    "too_large",
    "busy",
    "unavailable",
    "topic",
    "retained",
    "dropped",
];

/// Bucket bounds of durations, s: a commit to a fast disk takes 1 ms, a request times out
/// after 60 s.
const SECONDS: &[f64] =
    &[0.001, 0.0025, 0.005, 0.01, 0.02, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 60.0];

/// Bucket bounds of counts, up to the most write sets in a commit.
const SIZES: &[f64] = &[1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0, 512.0];

static RECORDER: OnceLock<Option<PrometheusHandle>> = OnceLock::new();

/// Interval at which recorded durations are aggregated into histograms. Until then every
/// single duration is in memory, whether or not the metrics are scraped.
const UPKEEP_INTERVAL: Duration = Duration::from_secs(5);

/// Installs the metrics recorder, once per process.
pub fn gather_metrics() {
    RECORDER.get_or_init(|| match install() {
        Ok(handle) => {
            describe();
            initialize_series();
            Some(handle)
        }
        Err(error) => {
            tracing::error!(%error, "cannot install the metrics recorder");
            None
        }
    });
}

/// Aggregates recorded durations periodically until the server stops.
pub async fn keep_metrics(closing: CancellationToken) {
    let Some(Some(handle)) = RECORDER.get() else { return };
    loop {
        tokio::select! {
            () = closing.cancelled() => return,
            () = tokio::time::sleep(UPKEEP_INTERVAL) => handle.run_upkeep(),
        }
    }
}

fn install() -> Result<PrometheusHandle, BuildError> {
    let mut builder = PrometheusBuilder::new();
    for &(name, ref kind, _) in METRICS {
        let name = Matcher::Full(name.to_owned());
        builder = match kind {
            Seconds => builder.set_buckets_for_metric(name, SECONDS)?,
            Sizes => builder.set_buckets_for_metric(name, SIZES)?,
            Counter | Gauge => builder,
        };
    }
    builder.install_recorder()
}

fn describe() {
    for &(name, ref kind, meaning) in METRICS {
        match kind {
            Counter => describe_counter!(name, meaning),
            Gauge => describe_gauge!(name, meaning),
            Seconds | Sizes => describe_histogram!(name, meaning),
        }
    }
}

/// Sets every series that is known in advance to its initial value.
fn initialize_series() {
    let zero = |name: &'static str, label: &'static str, values: &[&'static str]| {
        values.iter().for_each(|value| counter!(name, label => *value).absolute(0));
    };
    for name in [
        "offbd_bus_replies_refused_total",
        "offbd_commit_failures_total",
        "offbd_commits_overtaken_total",
        "offbd_commits_total",
        "offbd_connections_refused_total",
        "offbd_partitions_handed_over_total",
        "offbd_partitions_lost_total",
        "offbd_partitions_taken_total",
        "offbd_requests_forwarded_total",
        "offbd_streams_cut_off_total",
    ] {
        counter!(name).absolute(0);
    }
    zero("offbd_refused_total", "status", &["401", "403", "405", "421", "429", "503"]);
    zero("offbd_samples_total", "outcome", &["accepted", "duplicate", "rejected", "late"]);
    let reasons =
        ["form", "not_finite", "absurd", "conflict", "too_old", "session_ended", "late", "jump"];
    zero("offbd_samples_unjudged_total", "reason", &reasons);
    zero("offbd_sessions_expired_total", "reason", &["age", "size"]);
    zero("offbd_bus_logins_total", "outcome", &["accepted", "refused"]);
    for bus in ["nats", "mqtt"] {
        counter!("offbd_bus_faults_total", "bus" => bus).absolute(0);
        for outcome in BUS_OUTCOMES {
            counter!("offbd_bus_messages_total", "bus" => bus, "outcome" => outcome).absolute(0);
        }
    }
    gauge!("offbd_bus_devices_online").set(0.0);
    zero("offbd_turned_away_total", "queue", &["samples", "shard"]);
    for code in FaultCode::ALL {
        for status in FaultStatus::ALL {
            let (code, status) = (code.as_str(), status.as_str());
            counter!("offbd_fault_changes_total", "code" => code, "status" => status).absolute(0);
        }
    }
    zero("offbd_deliveries_given_up_total", "channel", &["webhook", "email"]);
    for channel in ["webhook", "email"] {
        for result in ["delivered", "failed"] {
            counter!("offbd_delivery_attempts_total", "channel" => channel, "result" => result)
                .absolute(0);
        }
    }
    gauge!("offbd_communication_lost").set(0.0);
    gauge!("offbd_ingest_stalled").set(0.0);
    gauge!("offbd_journal_bytes").set(0.0);
    gauge!("offbd_streams").set(0.0);
    gauge!("offbd_store_writable").set(1.0);
    gauge!("offbd_build_info", "version" => env!("CARGO_PKG_VERSION")).set(1.0);
}

/// Returns the metrics in the text format of Prometheus.
#[utoipa::path(get, path = "/metrics", tag = "operation",
    responses((status = 200, body = String, content_type = "text/plain")))]
pub(super) async fn metrics(State(app): State<App>) -> impl IntoResponse {
    sample_gauges(&app);
    let handle = RECORDER.get().and_then(Option::as_ref);
    let text = handle.map(|handle| {
        handle.run_upkeep();
        handle.render() + &epochs(&app.service.partition_epochs())
    });
    ([(CONTENT_TYPE, "text/plain; version=0.0.4")], text.unwrap_or_default())
}

/// The epochs of the partitions that this process owns. Written here, because the recorder
/// would go on showing those that another node has taken.
fn epochs(owned: &[(u32, i64)]) -> String {
    let head = "# HELP offbd_partition_epoch Owners so far of a partition that this node owns\n\
                # TYPE offbd_partition_epoch gauge\n";
    owned.iter().fold(head.to_owned(), |text, (partition, epoch)| {
        format!("{text}offbd_partition_epoch{{partition=\"{partition}\"}} {epoch}\n")
    })
}

/// Sets the gauges that are read on each scrape.
#[expect(clippy::cast_precision_loss, reason = "no queue is as long as 2^52")]
fn sample_gauges(app: &App) {
    let load = app.service.load();
    gauge!("offbd_samples_in_flight").set(load.samples as f64);
    gauge!("offbd_samples_in_flight_limit").set(app.service.limits().in_flight_samples as f64);
    gauge!("offbd_assets_rebuilding").set(app.service.n_rebuilding() as f64);
    gauge!("offbd_assets_untested").set(app.service.n_untested() as f64);
    let cluster = app.service.cluster(None);
    gauge!("offbd_cluster_nodes").set(cluster.nodes.len() as f64);
    gauge!("offbd_partitions_owned").set(app.service.n_partitions_owned() as f64);
    gauge!("offbd_partitions_unowned").set(cluster.unowned as f64);
    gauge!("offbd_writer_queue").set(load.writer as f64);
    for (shard, waiting) in load.shards.iter().enumerate() {
        gauge!("offbd_shard_queue", "shard" => shard.to_string()).set(*waiting as f64);
    }
    gauge!("offbd_bodies_bytes").set(app.budget.used() as f64);
    if let Some(bytes) = resident_bytes() {
        gauge!("offbd_process_resident_bytes").set(bytes as f64);
    }
}

/// Returns the resident memory of the process, bytes; `None` except on Linux.
fn resident_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}
