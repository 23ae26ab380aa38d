//! `/metrics`: the service's metrics in the text format of Prometheus.
//!
//! [`METRICS`] lists all of them but `offbd_partition_epoch` and those of the process. Series without labels, or with
//! labels known in advance, are exported as 0 from the start, so that `rate()` sees the first
//! event. No label has a value from outside the service.

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
use offbd_core::words;
use offbd_wire::words::{ChannelKind, UnjudgedWord};

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

/// A label with all its values.
type Label = (&'static str, fn() -> Vec<&'static str>);

/// The series of a metric before the first event.
enum Start {
    /// None: its labels are not known in advance, or no value is.
    Later,
    /// A series for each combination of the labels, with this value.
    At(f64, &'static [Label]),
    /// One series, read on each scrape; absent while it has no value.
    Read(fn(&App) -> Option<f64>),
}

use Start::{At, Later, Read};

const ZERO: Start = At(0.0, &[]);
const BUS: Label = ("bus", || vec!["nats", "mqtt"]);
const CHANNEL: Label = ("channel", || each(ChannelKind::ALL, ChannelKind::as_str));

fn each<T: Copy>(all: &[T], of: fn(T) -> &'static str) -> Vec<&'static str> {
    all.iter().copied().map(of).collect()
}

/// Every metric with its kind, its first series and its description.
macro_rules! metrics {
    ($($name:literal $kind:ident $start:expr => $meaning:literal;)+) => {
        #[expect(clippy::cast_precision_loss, reason = "no queue is as long as 2^52")]
        const METRICS: &[(&str, MetricKind, &str, Start)] =
            &[$(($name, $kind, $meaning, $start)),+];
    };
}

metrics! {
    "offbd_ack_seconds" Seconds Later => "Time from the arrival of a batch to its acknowledgement";
    "offbd_assets_rebuilding" Gauge Read(|app| Some(app.service.n_rebuilding() as f64))
        => "Assets whose engine is to be rebuilt after the start";
    "offbd_assets_untested" Gauge Read(|app| Some(app.service.n_untested() as f64))
        => "Assets whose samples are not judged";
    "offbd_bodies_bytes" Gauge Read(|app| Some(app.budget.used() as f64))
        => "Bytes of request bodies in memory";
    "offbd_build_info" Gauge At(1.0, &[("version", || vec![env!("CARGO_PKG_VERSION")])])
        => "Always 1; the label has the version";
    "offbd_bus_connected" Gauge Later
        => "1 while connected to the server of NATS or the MQTT broker";
    "offbd_bus_devices_online" Gauge ZERO
        => "Devices that say over NATS or MQTT that they are online";
    "offbd_bus_faults_total" Counter At(0.0, &[BUS]) => "Events published over NATS or MQTT";
    "offbd_bus_logins_total" Counter At(0.0, &[("outcome", || vec!["accepted", "refused"])])
        => "Questions of the NATS server for rights, by outcome";
    "offbd_bus_messages_total" Counter
        At(0.0, &[BUS, ("outcome", || each(MessageOutcome::ALL, MessageOutcome::as_str))])
        => "Messages of devices over NATS and MQTT, by outcome";
    "offbd_bus_replies_refused_total" Counter ZERO
        => "NATS messages not answered on their reply subject";
    "offbd_bus_unsafe" Gauge Later => "1 if the NATS server may lose messages, see the log";
    "offbd_cluster_nodes" Gauge Read(|app| Some(app.service.cluster(None).nodes.len() as f64))
        => "Nodes of the cluster that are alive";
    "offbd_commit_failures_total" Counter ZERO => "Failed commits, including retried ones";
    "offbd_commit_seconds" Seconds Later => "Duration of a commit";
    "offbd_commit_sets" Sizes Later => "Write sets in a commit";
    "offbd_commits_overtaken_total" Counter ZERO
        => "Write sets refused because their partition moved";
    "offbd_commits_total" Counter ZERO => "Successful commits";
    "offbd_communication_lost" Gauge ZERO => "Rigs with an open session that have stopped sending";
    "offbd_connections" Gauge Later => "Open connections";
    "offbd_connections_refused_total" Counter ZERO => "Connections refused at the limit";
    "offbd_deliveries_given_up_total" Counter At(0.0, &[CHANNEL])
        => "Notifications given up, by kind of channel";
    "offbd_delivery_attempts_total" Counter
        At(0.0, &[CHANNEL, ("result", || vec!["delivered", "failed"])])
        => "Attempts to deliver, by channel and result";
    "offbd_engines" Gauge Later => "Engines in memory, by shard";
    "offbd_event_reads_total" Counter ZERO
        => "Reads of the events of all nodes, while somebody listens";
    "offbd_fault_changes_total" Counter
        At(0.0, &[
            ("code", || each(FaultCode::ALL, FaultCode::as_str)),
            ("status", || each(FaultStatus::ALL, FaultStatus::as_str)),
        ])
        => "Durable fault transitions, by code and status";
    "offbd_http_request_seconds" Seconds Later => "Time until a response starts, by path";
    "offbd_http_requests_total" Counter Later => "Requests, by path and status";
    "offbd_ingest_stalled" Gauge ZERO => "1 if batches wait and nothing is committed";
    "offbd_journal_bytes" Gauge ZERO => "Bytes in the journal, not yet folded into the recordings";
    "offbd_node_clock_offset_seconds" Gauge ZERO
        => "Clock of this node ahead of that of the database, beyond the time of a look";
    "offbd_partitions_handed_over_total" Counter ZERO
        => "Partitions given to other nodes as planned";
    "offbd_partitions_lost_total" Counter ZERO => "Partitions that other nodes have taken";
    "offbd_partitions_owned" Gauge Read(|app| Some(app.service.n_partitions_owned() as f64))
        => "Partitions that this node owns";
    "offbd_partitions_taken_total" Counter ZERO => "Partitions that this node has taken";
    "offbd_partitions_unowned" Gauge Read(|app| Some(app.service.cluster(None).unowned as f64))
        => "Partitions without an owner, as this node last saw";
    "offbd_refused_total" Counter
        At(0.0, &[("status", || vec!["401", "403", "405", "421", "429", "503"])])
        => "Requests denied by the guard, by status";
    "offbd_requests_forwarded_total" Counter ZERO
        => "Requests sent to the node that owns the asset";
    "offbd_samples_in_flight" Gauge Read(|app| Some(app.service.load().samples as f64))
        => "Samples between arrival and commit";
    "offbd_samples_in_flight_limit" Gauge
        Read(|app| Some(app.service.limits().requests.in_flight_samples as f64))
        => "Limit of these: limits.in_flight_samples";
    "offbd_samples_reevaluated_total" Counter Later
        => "Recorded samples evaluated again on loading";
    "offbd_samples_total" Counter
        At(0.0, &[("outcome", || vec!["accepted", "duplicate", "rejected", "late"])])
        => "Samples, by outcome";
    "offbd_samples_unjudged_total" Counter
        At(0.0, &[("reason", || each(UnjudgedWord::ALL, UnjudgedWord::as_str))])
        => "Samples rejected or set aside, by reason";
    "offbd_scrub_findings_total" Counter Later => "Damage and differences found, by kind";
    "offbd_scrub_sessions_total" Counter Later => "Sessions that the scrub found in order";
    "offbd_sessions_expired_total" Counter At(0.0, &[("reason", || vec!["age", "size"])])
        => "Sessions deleted by retention, by reason";
    "offbd_shard_queue" Gauge Later => "Commands in the queue of a shard";
    "offbd_store_writable" Gauge At(1.0, &[]) => "1 if the last commit succeeded";
    "offbd_streams" Gauge ZERO => "Open WebSockets";
    "offbd_streams_cut_off_total" Counter ZERO
        => "WebSockets closed because the client was too slow";
    "offbd_turned_away_total" Counter At(0.0, &[("queue", || vec!["samples", "shard"])])
        => "Batches and requests answered with 429, by full queue";
    "offbd_writer_queue" Gauge Read(|app| Some(app.service.load().writer as f64))
        => "Write sets in the queue of the writer";
}

words! {
    /// What may become of a message of a device.
    MessageOutcome {
        Elsewhere = "elsewhere",
        Taken = "taken",
        Malformed = "malformed",
        UnknownAsset = "unknown_asset",
        Conflict = "conflict",
        TooLarge = "too_large",
        Busy = "busy",
        Unavailable = "unavailable",
        Topic = "topic",
        Retained = "retained",
        Dropped = "dropped",
    }
}

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
    for &(name, ref kind, ..) in METRICS {
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
    for &(name, ref kind, meaning, _) in METRICS {
        match kind {
            Counter => describe_counter!(name, meaning),
            Gauge => describe_gauge!(name, meaning),
            Seconds | Sizes => describe_histogram!(name, meaning),
        }
    }
}

/// Sets every series that is known in advance to its initial value.
fn initialize_series() {
    for (name, kind, _, start) in METRICS {
        let At(value, labels) = *start else { continue };
        for series in combinations(labels) {
            match kind {
                Counter => counter!(*name, series).absolute(0),
                Gauge => gauge!(*name, series).set(value),
                Seconds | Sizes => {}
            }
        }
    }
}

/// Returns the labels of every combination of their values.
fn combinations(labels: &[Label]) -> Vec<Vec<metrics::Label>> {
    labels.iter().fold(vec![Vec::new()], |all, (key, values)| {
        let with = |series: &Vec<metrics::Label>, value| {
            let label = metrics::Label::from_static_parts(key, value);
            series.iter().cloned().chain([label]).collect()
        };
        all.iter()
            .flat_map(|series| values().into_iter().map(|value| with(series, value)))
            .collect()
    })
}

/// Returns the metrics in the text format of Prometheus. `docs/operations/monitoring.md` explains
/// each of them.
#[utoipa::path(get, path = "/metrics", tag = "operation",
    responses((status = 200, body = String, content_type = "text/plain")))]
pub(super) async fn metrics(State(app): State<App>) -> impl IntoResponse {
    sample_gauges(&app);
    let handle = RECORDER.get().and_then(Option::as_ref);
    let text = handle.map(|handle| {
        handle.run_upkeep();
        handle.render() + &epochs(&app.service.partition_epochs()) + &super::process::metrics()
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
    for (name, .., start) in METRICS {
        if let Read(value) = start
            && let Some(value) = value(app)
        {
            gauge!(*name).set(value);
        }
    }
    for (shard, waiting) in app.service.load().shards.iter().enumerate() {
        gauge!("offbd_shard_queue", "shard" => shard.to_string()).set(*waiting as f64);
    }
}
