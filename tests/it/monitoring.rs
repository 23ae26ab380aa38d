//! What an operator watches: metrics, the dashboard and the alerts made of them.

use std::collections::{BTreeMap, BTreeSet};

use crate::support::process::Process;
use crate::support::{Bench, batch, rig};
use serde_json::json;

const DASHBOARD: &str = include_str!("../../deploy/grafana/offbd.json");
const ALERTS: &str = include_str!("../../deploy/prometheus/offbd.yaml");
const MANUAL: &str = include_str!("../../docs/operations.md");

/// What `/metrics` shows: the labels of each series' name.
fn series(text: &str) -> BTreeMap<String, BTreeSet<String>> {
    let mut series: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for line in text.lines().filter(|line| !line.is_empty() && !line.starts_with('#')) {
        let (name, rest) = line.split_at(line.find(['{', ' ']).unwrap());
        let labels = rest.split_once('}').map_or("", |(labels, _)| &labels[1..]);
        let keys = labels.split("\",").filter_map(|pair| pair.split_once('='));
        series.entry(name.to_owned()).or_default().extend(keys.map(|(key, _)| key.to_owned()));
    }
    series
}

/// Every use of a metric in `text`, with the labels by which it is selected.
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

async fn metrics(bench: &Bench) -> String {
    bench.client.get("/metrics").await.text
}

/// A server that has done a little of everything.
async fn busy() -> Bench {
    let bench = Bench::start().await;
    bench.client.asset("very-own-rig").await;
    bench.client.telemetry("very-own-rig", Some("very-own-session"), &rig(200, 100)).await;
    bench.client.get("/nowhere/very-own-path").await.problem(404);
    bench
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_watched_is_measured() {
    let bench = busy().await;
    let there = series(&metrics(&bench).await);
    // Prometheus gives these to every series.
    let given = ["job", "instance", "le"];
    for (file, text) in [("dashboard", DASHBOARD), ("alerts", ALERTS)] {
        let uses = uses(text);
        assert!(uses.len() > 10, "{file}");
        for (name, labels) in uses {
            let known = there.get(&name).unwrap_or_else(|| panic!("{file}: there is no {name}"));
            let strange =
                labels.iter().find(|l| !known.contains(*l) && !given.contains(&l.as_str()));
            assert_eq!(strange, None, "{file}: {name} has no such label");
        }
    }
}

/// Where a JSON Web Token says what its bearer is for, by default.
const CLAIMS: [&str; 2] = ["offbd_role", "offbd_asset"];

#[tokio::test(flavor = "multi_thread")]
async fn every_metric_is_explained_and_none_has_labels_from_outside() {
    let bench = busy().await;
    let text = metrics(&bench).await;
    let mut names = BTreeSet::new();
    for line in text.lines() {
        let Some(rest) = line.strip_prefix("# TYPE ") else { continue };
        let name = rest.split(' ').next().unwrap();
        assert!(text.contains(&format!("# HELP {name} ")), "{name} has no explanation");
        names.insert(name.to_owned());
    }
    assert!(names.len() >= 25, "{names:?}");
    for name in &names {
        assert!(MANUAL.contains(&format!("`{name}`")), "docs/operations.md does not name {name}");
    }
    // Claims of a JSON Web Token are named as metrics are.
    let metrics = uses(MANUAL).into_iter().filter(|(name, _)| !CLAIMS.contains(&name.as_str()));
    for (name, _) in metrics {
        assert!(names.contains(&name), "docs/operations.md names {name}, which is not there");
    }
    assert!(!text.contains("very-own"), "a label comes from outside");
}

/// The number of a series.
fn number(text: &str, series: &str) -> f64 {
    let line = text.lines().find_map(|line| line.strip_prefix(series)?.strip_prefix(' '));
    line.unwrap_or_else(|| panic!("no {series}")).parse().unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn it_is_counted_what_became_of_samples_and_what_was_found() {
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
    let engines =
        after.lines().filter_map(|line| line.strip_prefix("offbd_engines{")?.split(' ').nth(1));
    assert_eq!(engines.map(|n| n.parse::<f64>().unwrap()).sum::<f64>(), 1.0);
    assert_eq!(number(&after, "offbd_store_writable"), 1.0);
    #[cfg(target_os = "linux")]
    assert!(number(&after, "offbd_process_resident_bytes") > 1e6);
}
