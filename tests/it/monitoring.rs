//! Metrics, and the dashboard and alerts that use them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use crate::support::process::Process;
use crate::support::{batch, manual, rig};
use serde_json::{Value, json};

const DASHBOARD: &str = include_str!("../../deploy/grafana/offbd.json");
const RIG_DASHBOARD: &str = include_str!("../../deploy/grafana/offbd-rig.json");
const ALERTS: &str = include_str!("../../deploy/prometheus/offbd.yaml");

/// Returns the metrics of `/metrics`, each with its labels.
fn metrics_and_labels(text: &str) -> BTreeMap<String, BTreeSet<String>> {
    let mut series: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for line in text.lines().filter(|line| !line.is_empty() && !line.starts_with('#')) {
        let (name, rest) = line.split_at(line.find(['{', ' ']).unwrap());
        let labels = rest.split_once('}').map_or("", |(labels, _)| &labels[1..]);
        let keys = labels.split("\",").filter_map(|pair| pair.split_once('='));
        series.entry(name.to_owned()).or_default().extend(keys.map(|(key, _)| key.to_owned()));
    }
    series
}

/// Returns every use of a metric in `text`, with the labels in its selector.
fn uses(text: &str) -> Vec<(String, Vec<String>)> {
    let part = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    let mut uses = Vec::new();
    for (at, _) in text.match_indices("offbd_") {
        let rest = &text[at..];
        let (name, rest) = rest.split_at(rest.find(|c| !part(c)).unwrap_or(rest.len()));
        if name == "offbd_" {
            continue;
        }
        let selector = rest.strip_prefix('{').and_then(|rest| rest.split_once('}'));
        let pairs = selector.map_or("", |(pairs, _)| pairs).split(',');
        let keys = pairs.filter_map(|pair| pair.split_once('=')).map(|(key, _)| key.to_owned());
        uses.push((name.to_owned(), keys.collect()));
    }
    uses
}

async fn metrics(service: &Process) -> String {
    service.client.get("/metrics").await.text
}

/// Starts a service that has handled several kinds of requests, and whose NATS server is away.
async fn busy_service(data: &Path) -> Process {
    let nats =
        cfg!(feature = "nats").then_some(("OFFBD_NATS__URL", Path::new("nats://127.0.0.1:1")));
    let service = Process::start_with(data, &Vec::from_iter(nats));
    service.client.asset("very-own-rig").await;
    service.client.telemetry("very-own-rig", Some("very-own-session"), &rig(200, 100)).await;
    service.client.get("/nowhere/very-own-path").await.problem(404);
    service
}

/// Whether a metric exists only in builds with another feature.
fn is_left_out(name: &str) -> bool {
    !cfg!(feature = "nats") && name.starts_with("offbd_bus_")
}

#[tokio::test(flavor = "multi_thread")]
async fn dashboard_and_alerts_use_only_existing_metrics() {
    let data = tempfile::tempdir().unwrap();
    let existing = metrics_and_labels(&metrics(&busy_service(data.path()).await).await);
    // Prometheus adds these labels to every series.
    let added = ["job", "instance", "le"];
    for (file, text) in [("dashboard", DASHBOARD), ("alerts", ALERTS)] {
        let uses = uses(text);
        assert!(uses.len() > 10, "{file}");
        for (name, labels) in uses.into_iter().filter(|(name, _)| !is_left_out(name)) {
            let known = existing.get(&name).unwrap_or_else(|| panic!("{file}: there is no {name}"));
            let unknown =
                labels.iter().find(|l| !known.contains(*l) && !added.contains(&l.as_str()));
            assert_eq!(unknown, None, "{file}: {name} has no such label");
        }
    }
}

/// Other names with the prefix of metrics: default claims of a JSON Web Token for role and asset,
/// and the library of FMUs.
const OTHERS: [&str; 3] = ["offbd_role", "offbd_asset", "offbd_fmu"];

#[tokio::test(flavor = "multi_thread")]
async fn every_metric_is_documented_and_no_label_comes_from_a_request() {
    let data = tempfile::tempdir().unwrap();
    let text = metrics(&busy_service(data.path()).await).await;
    let mut names = BTreeSet::new();
    for line in text.lines() {
        let Some(rest) = line.strip_prefix("# TYPE ") else { continue };
        let name = rest.split(' ').next().unwrap();
        assert!(text.contains(&format!("# HELP {name} ")), "{name} has no explanation");
        names.insert(name.to_owned());
    }
    assert!(names.len() >= 25, "{names:?}");
    let manual = manual();
    for name in &names {
        assert!(manual.contains(&format!("`{name}`")), "docs/operations/ does not name {name}");
    }
    let metrics = uses(&manual).into_iter().filter(|(name, _)| !OTHERS.contains(&name.as_str()));
    for (name, _) in metrics.filter(|(name, _)| !is_left_out(name)) {
        assert!(names.contains(&name), "docs/operations/ names {name}, which does not exist");
    }
    assert!(!text.contains("very-own"), "a label contains a name from a request");
}

/// Returns the value of a series.
fn number(text: &str, series: &str) -> f64 {
    let line = text.lines().find_map(|line| line.strip_prefix(series)?.strip_prefix(' '));
    line.unwrap_or_else(|| panic!("no {series}")).parse().unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn metrics_count_samples_by_outcome_and_fault_transitions() {
    let data = tempfile::tempdir().unwrap();
    let Process { client, .. } = &Process::start(data.path());
    client.asset("a").await;
    let before = client.get("/metrics").await.text;
    let mut samples = rig(1500, 500);
    samples[700].x_m = Some(1e6);
    samples[800].t_s += 1e5;
    let mut body = batch(Some("s"), &samples);
    body["samples"][900]["t_s"] = json!("now");
    let ack = client.post("assets/a/telemetry", &body).await.expect(200);
    assert_eq!(ack["rejected"].as_array().unwrap().len(), 2, "{}", ack["rejected"]);
    let after = client.get("/metrics").await.text;
    for (series, least) in [
        ("offbd_samples_total{outcome=\"accepted\"}", 1498.0),
        ("offbd_samples_unjudged_total{reason=\"form\"}", 1.0),
        ("offbd_samples_unjudged_total{reason=\"absurd\"}", 1.0),
        ("offbd_samples_unjudged_total{reason=\"jump\"}", 1.0),
        ("offbd_fault_changes_total{code=\"x_servo\",status=\"confirmed\"}", 1.0),
        ("offbd_commits_total", 1.0),
    ] {
        let rise = number(&after, series) - number(&before, series);
        assert!(rise >= least, "{series} rose by {rise}");
    }
    for series in ["offbd_ack_seconds_count", "offbd_commit_seconds_count"] {
        assert!(number(&after, series) >= 1.0, "{series}");
    }
    assert_eq!(client.n_engines().await, 1.0);
    assert_eq!(number(&after, "offbd_store_writable"), 1.0);
    #[cfg(target_os = "linux")]
    assert!(number(&after, "process_resident_memory_bytes") > 1e6);
}

/// The dashboard of one rig asks for paths, parameters and columns that the interface has.
#[test]
fn the_dashboard_of_a_rig_uses_what_the_interface_describes() {
    let document = serde_json::to_value(offbd::http::openapi()).unwrap();
    let dashboard: Value = serde_json::from_str(RIG_DASHBOARD).unwrap();
    let schemas = &document["components"]["schemas"];
    let properties = |name: &str| schemas[name]["properties"].as_object().unwrap().clone();
    let mut row = properties("SeriesValues");
    for part in schemas["SeriesRow"]["allOf"].as_array().unwrap() {
        row.extend(part["properties"].as_object().cloned().unwrap_or_default());
    }
    let panels = dashboard["panels"].as_array().unwrap();
    let series = panels.iter().map(|panel| (&panel["targets"][0], &row));
    let mark = properties("Annotation");
    let marks = [(&dashboard["annotations"]["list"][0]["target"], &mark)];
    let mut n_columns = 0;
    for (target, known) in series.chain(marks) {
        let url = target["url"].as_str().unwrap().replace("${asset}", "{asset}");
        let (path, query) = url.strip_prefix("${url}").unwrap().split_once('?').unwrap();
        let operation = &document["paths"][path]["get"];
        let parameters = operation["parameters"].as_array().unwrap();
        for pair in query.split('&') {
            let name = pair.split('=').next().unwrap();
            assert!(parameters.iter().any(|parameter| parameter["name"] == name), "{name}");
        }
        for column in target["columns"].as_array().unwrap() {
            let name = column["selector"].as_str().unwrap();
            assert!(known.contains_key(name), "{name}");
            n_columns += 1;
        }
    }
    assert_eq!(n_columns, 21);
}
