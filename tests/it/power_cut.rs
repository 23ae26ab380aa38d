//! Power cuts: of what the service wrote and did not sync, nothing, all or any part is on the
//! disk, also after a sync that failed. What was acknowledged before the cut is there, and
//! the service goes on.

mod disk;
mod history;

use std::path::Path;

use disk::Image;
use history::{Acknowledged, COPY, History, RIGS};
use offbd::server;
use offbd::store::Location;
use offbd_core::vocabulary::Sample;

use crate::support::calls::preloaded;
use crate::support::device::Random;
use crate::support::{Client, config, judged, on_postgres, registration, rig};

/// Number of power cuts, unless the environment variable CUTS is set. SEED chooses others.
const CUTS: usize = 40;

/// Number of runs of the service that are cut; in all but the first, syncs fail.
const HISTORIES: usize = 4;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_power_cut_loses_nothing_that_was_acknowledged() {
    assert!(!on_postgres(), "this is a test of the files of SQLite");
    let number = |name: &str, default| std::env::var(name).map_or(default, |n| n.parse().unwrap());
    let (n_cuts, mut random) = (number("CUTS", CUTS), Random(number("SEED", 1) as u64));
    let scratch = tempfile::tempdir().unwrap();
    let library = preloaded("calls", scratch.path());
    let (mut n_samples, mut n_failed_syncs) = (0, 0);
    for i in 0..HISTORIES {
        let history = History::record(&library, i > 0, &mut random).await;
        n_failed_syncs += history.failed_syncs(history.records.len()).len();
        for _ in 0..(n_cuts + i) / HISTORIES {
            n_samples += cut(&history, &mut random).await;
        }
    }
    println!("{n_cuts} power cuts, {n_failed_syncs} failed syncs: {n_samples} samples are there");
}

/// A disk that does not keep the names in a directory is noticed before anything is
/// acknowledged.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_service_whose_directory_is_not_synced_acknowledges_nothing() {
    assert!(!on_postgres(), "this is a test of the files of SQLite");
    let scratch = tempfile::tempdir().unwrap();
    let library = preloaded("calls", scratch.path());
    let (mut n_refused, mut n_served) = (0, 0);
    for n_earlier in 0..=1 {
        for number in 1.. {
            let history = History::of_failed_start(&library, n_earlier, number).await;
            if history.failed_syncs(history.records.len()).is_empty() {
                break;
            }
            match history.answers().last() {
                Some(at) => {
                    let log = history.folder().join("offbd.sqlite-wal");
                    let failed = history.failed_syncs(*at);
                    assert!(history.disk(*at).keeps(&log), "{n_earlier} {number}: {failed:?}");
                    n_served += 1;
                }
                None => n_refused += 1,
            }
        }
    }
    println!("{n_refused} starts were refused, {n_served} were not");
    assert!(n_refused > 0 && n_served > 0);
}

/// Cuts the power somewhere in a history, half of the time when an answer is being sent.
/// Checks what is left; returns the number of samples that were acknowledged.
async fn cut(history: &History, random: &mut Random) -> usize {
    let sent: Vec<usize> = history.answers();
    let at = match random.below(2) {
        0 => sent[random.below(sent.len())] + 1,
        _ => random.below(history.records.len()),
    };
    let image = history.disk(at).cut(random);
    let acknowledged = history.acknowledged(at);
    let at = format!("after {at} records, failed syncs {:?}", history.failed_syncs(at));
    go_on(&image, &acknowledged, history, &at).await
}

/// Starts the service with the files of an image, compares what is there, sends what was not
/// acknowledged, and compares the verdicts.
async fn go_on(image: &Image, acknowledged: &Acknowledged, history: &History, at: &str) -> usize {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in image {
        let file = Path::new(name).strip_prefix(history.folder()).unwrap();
        std::fs::write(folder.path().join(file), content).unwrap();
    }
    let copy = folder.path().join(COPY);
    assert!(copy.exists() || !acknowledged.is_backed_up, "{at}: the backup is gone");
    if copy.exists() {
        check(&Location::File(copy), at).await;
    }
    let started = server::start(config(folder.path())).await;
    let server = started.unwrap_or_else(|error| panic!("{at}: it does not start: {error:#}"));
    let client = Client::new(server.address.to_string());
    for (asset, n, dead_from) in RIGS {
        resume(&client, asset, &rig(n, dead_from), acknowledged, at).await;
    }
    server.shutdown().await.unwrap();
    check(&config(folder.path()).location().unwrap(), at).await;
    acknowledged.n_samples.values().sum()
}

/// Compares what is there of a rig, sends the rest, and ends the session.
async fn resume(client: &Client, asset: &str, samples: &[Sample], all: &Acknowledged, at: &str) {
    if !all.registered.contains(asset) {
        let made = client.post("assets", &registration(asset)).await;
        assert!([201, 409].contains(&made.status.as_u16()), "{at}: {}", made.text);
    }
    let n_acknowledged = all.n_samples.get(asset).copied().unwrap_or(0);
    let (n, is_ended) = stored(client, asset, samples, at).await;
    assert!(n >= n_acknowledged, "{at}: {asset}: {n} of {n_acknowledged} samples are there");
    assert!(is_ended || !all.ended.contains(asset), "{at}: {asset}: the session is open");
    if !is_ended {
        client.telemetry(asset, Some("s"), &samples[n_acknowledged..]).await;
    }
    let verdict = &client.end(asset, "s").await["verdict"];
    assert_eq!(verdict["verdict_hash"], judged(asset, samples).0, "{at}: {asset}");
    assert_eq!(client.recording(asset, "s").await, samples, "{at}: {asset}");
}

/// Returns how many samples of a rig are stored, which must be the first ones, and whether
/// their session has ended.
async fn stored(client: &Client, asset: &str, samples: &[Sample], at: &str) -> (usize, bool) {
    let page = client.get(&format!("sessions?asset={asset}")).await;
    assert_eq!(page.status, 200, "{at}: {asset}: {}", page.text);
    let page = page.json();
    let Some(session) = page["items"].as_array().unwrap().first() else { return (0, false) };
    let recording = client.recording(asset, "s").await;
    assert_eq!(recording, samples[..recording.len()], "{at}: {asset}");
    (recording.len(), session["state"] == "ended")
}

async fn check(location: &Location, at: &str) {
    let report = offbd::store::check(location).await;
    let report = report.unwrap_or_else(|error| panic!("{at}: {location}: {error}"));
    assert_eq!(report.findings, Vec::<String>::new(), "{at}: {location}");
}
