//! The checks of NATS servers, as far as these tell their settings.
//!
//! A version or a setting that loses messages is refused at the start. After that a client that
//! has lost its server connects to another one of the cluster, so everything is checked again
//! after each connection; what is found then is told and not acted upon: devices that wait for
//! offbd's own acknowledgement lose nothing with any server, and without one nobody is served.

use std::time::Duration;

use async_nats::ServerInfo;
use axum::body::{Body, to_bytes};
use futures_util::future::join_all;
use hyper::{StatusCode, Uri};
use hyper_util::client::legacy::Client;
use hyper_util::rt::TokioExecutor;
use serde::Deserialize;
use tokio::time::timeout;

/// Oldest version of the server: auth callout came with it. Enough without JetStream.
const OLDEST: (u32, u32, u32) = (2, 10, 0);

/// Oldest version whose JetStream keeps what it has acknowledged if servers are killed, paused
/// or cut off from each other (nats-server issues 6888, 7545 and 7594).
const OLDEST_STREAMS: (u32, u32, u32) = (2, 12, 3);

/// Longest time to read the settings.
const MONITOR_TIMEOUT: Duration = Duration::from_secs(5);

/// Longest document with settings, bytes; a longer one is refused.
const MAX_SETTINGS: usize = 1 << 20;

/// Why a server is not used.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub enum UnsafeServer {
    #[error(
        "the NATS server has version {found}; {major}.{minor} or later is needed",
        major = OLDEST.0, minor = OLDEST.1
    )]
    Version { found: String },
    #[error(
        "JetStream of the NATS server at {url} acknowledges before it has written to the disk (its \
         `sync_interval` is {seconds} s), so that a power cut loses messages of MQTT at QoS 1; \
         set `jetstream {{ sync_interval: always }}`"
    )]
    Unsynced { url: String, seconds: u64 },
    #[error("`nats.monitor`: cannot read the settings of the NATS server at {url}: {reason}")]
    Unreadable { url: String, reason: String },
}

/// The answer of the server to `/jsz?config=1`.
#[derive(Debug, Deserialize)]
struct JetStreamInfo {
    #[serde(default)]
    server_id: String,
    /// Absent if JetStream is off.
    config: Option<JetStreamConfig>,
}

#[derive(Debug, Deserialize)]
struct JetStreamConfig {
    #[serde(default)]
    sync_always: bool,
    /// Nanoseconds.
    #[serde(default)]
    sync_interval: u64,
}

fn numbers(version: &str) -> Option<(u32, u32, u32)> {
    let release = version.split(['-', '+']).next()?;
    let mut numbers = release.split('.').map(|number| number.parse().ok());
    Some((numbers.next()??, numbers.next()??, numbers.next().flatten().unwrap_or_default()))
}

/// Checks the version that the server has told on connecting.
pub(super) fn check_version(version: &str) -> Result<(), UnsafeServer> {
    match numbers(version) {
        Some(found) if found >= OLDEST => Ok(()),
        _ => Err(UnsafeServer::Version { found: version.to_owned() }),
    }
}

/// What is to be said of a server that is used all the same. `checked` are the ids of those
/// whose settings were read.
pub(super) fn doubts(info: &ServerInfo, batch_bytes: usize, checked: &[String]) -> Vec<String> {
    let ServerInfo { max_payload, version, server_name, .. } = info;
    let mut doubts = Vec::new();
    if *max_payload < batch_bytes {
        doubts.push(format!(
            "it takes messages of {max_payload} bytes (`max_payload`), `limits.batch_bytes` is \
             {batch_bytes}; a longer batch disconnects its device"
        ));
    }
    if info.jetstream && numbers(version) < Some(OLDEST_STREAMS) {
        let (major, minor, patch) = OLDEST_STREAMS;
        doubts.push(format!(
            "its version is {version}; JetStream before {major}.{minor}.{patch} can lose messages \
             of MQTT at QoS 1 that it has acknowledged"
        ));
    }
    if !checked.is_empty() && !checked.contains(&info.server_id) {
        doubts.push(format!(
            "the settings of {server_name} are not checked: it is not among `nats.monitor`"
        ));
    }
    doubts
}

/// Reads the settings of JetStream from the monitoring ports of servers, `http://HOST:PORT` with
/// `,` between, and checks them. Returns the ids of the servers. One that does not answer is
/// passed over, because it may be the one that is away, if another one does.
pub(super) async fn check_streams(monitors: &str) -> Result<Vec<String>, UnsafeServer> {
    let found = join_all(monitors.split(',').map(str::trim).map(check_one)).await;
    let (mut ids, mut unreadable) = (Vec::new(), None);
    for result in found {
        match result {
            Ok(id) => ids.push(id),
            Err(error @ UnsafeServer::Unreadable { .. }) => unreadable = Some(error),
            Err(error) => return Err(error),
        }
    }
    match unreadable {
        Some(error) if ids.is_empty() => Err(error),
        error => {
            error.inspect(|error| tracing::warn!(%error, "its settings are not checked"));
            Ok(ids)
        }
    }
}

async fn check_one(monitor: &str) -> Result<String, UnsafeServer> {
    let unreadable = |reason: String| UnsafeServer::Unreadable { url: monitor.to_owned(), reason };
    let fetched = timeout(MONITOR_TIMEOUT, fetch(monitor)).await;
    let late = |_| unreadable(format!("no answer within {} s", MONITOR_TIMEOUT.as_secs()));
    judge(&fetched.map_err(late)?.map_err(unreadable)?, monitor)
}

/// Returns the id of the server.
fn judge(document: &[u8], monitor: &str) -> Result<String, UnsafeServer> {
    let url = || monitor.to_owned();
    let info: JetStreamInfo = serde_json::from_slice(document)
        .map_err(|error| UnsafeServer::Unreadable { url: url(), reason: error.to_string() })?;
    match info.config {
        Some(config) if !config.sync_always && config.sync_interval > 0 => {
            let seconds = config.sync_interval.div_ceil(1_000_000_000);
            Err(UnsafeServer::Unsynced { url: url(), seconds })
        }
        _ => Ok(info.server_id),
    }
}

async fn fetch(monitor: &str) -> Result<Vec<u8>, String> {
    let url = format!("{}/jsz?config=1", monitor.trim_end_matches('/'));
    let url: Uri = url.parse().map_err(|_| "is not `http://HOST:PORT`".to_owned())?;
    let client: Client<_, Body> = Client::builder(TokioExecutor::new()).build_http();
    let response = client.get(url).await.map_err(|error| error.to_string())?;
    if response.status() != StatusCode::OK {
        return Err(format!("the status of the answer is {}", response.status()));
    }
    let body = to_bytes(Body::new(response.into_body()), MAX_SETTINGS).await;
    Ok(body.map_err(|error| error.to_string())?.to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unsafe_server_is_refused_in_words() {
        let judge = |text: &str| judge(text.as_bytes(), "http://a");
        assert_eq!(judge(r#"{"server_id":"N","disabled":true}"#), Ok("N".to_owned()));
        let always = r#"{"config":{"sync_interval":120000000000,"sync_always":true}}"#;
        assert_eq!(judge(always), Ok(String::new()));
        let error = judge(r#"{"config":{"sync_interval":120000000000}}"#).unwrap_err();
        assert_eq!(error, UnsafeServer::Unsynced { url: "http://a".to_owned(), seconds: 120 });
        assert!(error.to_string().contains("sync_interval: always"));
        assert!(judge("junk").is_err());
        for good in ["2.10.0", "2.15.1", "3.0.0-beta", "2.10"] {
            assert_eq!(check_version(good), Ok(()), "{good}");
        }
        for bad in ["2.9.10", "1.4", "", "x"] {
            assert!(check_version(bad).is_err(), "{bad}");
        }
    }

    #[tokio::test]
    async fn one_of_several_servers_must_tell_its_settings() {
        let nobody = "http://127.0.0.1:1";
        let error = check_streams(&format!("{nobody}, {nobody}")).await.unwrap_err();
        assert!(matches!(&error, UnsafeServer::Unreadable { url, .. } if url == nobody), "{error}");
    }

    #[test]
    fn a_server_in_doubt_is_told_of() {
        let info = |version: &str, jetstream| ServerInfo {
            server_id: "N".to_owned(),
            version: version.to_owned(),
            max_payload: 8,
            jetstream,
            ..ServerInfo::default()
        };
        let n = |info: &ServerInfo, batch_bytes, checked: &[&str]| {
            let checked: Vec<_> = checked.iter().map(|id| (*id).to_owned()).collect();
            doubts(info, batch_bytes, &checked).len()
        };
        let good = info("2.12.3", true);
        assert_eq!(n(&good, 8, &["M", "N"]), 0);
        assert_eq!(n(&good, 8, &[]), 0, "nothing is to be checked");
        assert_eq!(n(&good, 9, &["N"]), 1);
        assert_eq!(n(&good, 8, &["M"]), 1);
        assert_eq!(n(&info("2.12.2", true), 8, &[]), 1);
        assert_eq!(n(&info("2.10.0", false), 8, &[]), 0, "without JetStream");
    }
}
