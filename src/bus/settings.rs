//! The check of a NATS server's settings, as far as it tells them.

use std::time::Duration;

use axum::body::{Body, to_bytes};
use hyper::{StatusCode, Uri};
use hyper_util::client::legacy::Client;
use hyper_util::rt::TokioExecutor;
use serde::Deserialize;
use tokio::time::timeout;

/// Oldest version of the server: auth callout came with it.
const OLDEST: (u32, u32) = (2, 10);

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
        "JetStream of the NATS server acknowledges before it has written to the disk (its \
         `sync_interval` is {seconds} s), so that a power cut loses messages of MQTT at QoS 1; \
         set `jetstream {{ sync_interval: always }}`"
    )]
    Unsynced { seconds: u64 },
    #[error("`nats.monitor`: cannot read the settings of the NATS server at {url}: {reason}")]
    Unreadable { url: String, reason: String },
}

/// The answer of the server to `/jsz?config=1`.
#[derive(Debug, Deserialize)]
struct JetStreamInfo {
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

/// Checks the version that the server has told on connecting.
pub(super) fn check_version(version: &str) -> Result<(), UnsafeServer> {
    let mut numbers = version.split('.').map_while(|number| number.parse::<u32>().ok());
    match (numbers.next(), numbers.next()) {
        (Some(major), Some(minor)) if (major, minor) >= OLDEST => Ok(()),
        _ => Err(UnsafeServer::Version { found: version.to_owned() }),
    }
}

/// Reads the settings of JetStream from the server's monitoring port, `http://HOST:PORT`, and
/// checks them.
pub(super) async fn check_streams(monitor: &str) -> Result<(), UnsafeServer> {
    let unreadable = |reason: String| UnsafeServer::Unreadable { url: monitor.to_owned(), reason };
    let fetched = timeout(MONITOR_TIMEOUT, fetch(monitor)).await;
    let late = |_| unreadable(format!("no answer within {} s", MONITOR_TIMEOUT.as_secs()));
    judge(&fetched.map_err(late)?.map_err(unreadable)?, unreadable)
}

fn judge(document: &[u8], unreadable: impl Fn(String) -> UnsafeServer) -> Result<(), UnsafeServer> {
    let info: JetStreamInfo =
        serde_json::from_slice(document).map_err(|error| unreadable(error.to_string()))?;
    match info.config {
        Some(config) if !config.sync_always && config.sync_interval > 0 => {
            Err(UnsafeServer::Unsynced { seconds: config.sync_interval.div_ceil(1_000_000_000) })
        }
        _ => Ok(()),
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
        let unreadable = |reason| UnsafeServer::Unreadable { url: String::new(), reason };
        let judge = |text: &str| judge(text.as_bytes(), unreadable);
        assert_eq!(judge(r#"{"disabled":true}"#), Ok(()));
        let always = r#"{"config":{"sync_interval":120000000000,"sync_always":true}}"#;
        assert_eq!(judge(always), Ok(()));
        let error = judge(r#"{"config":{"sync_interval":120000000000}}"#).unwrap_err();
        assert_eq!(error, UnsafeServer::Unsynced { seconds: 120 });
        assert!(error.to_string().contains("sync_interval: always"));
        assert!(judge("junk").is_err());
        for good in ["2.10.0", "2.15.1", "3.0.0-beta"] {
            assert_eq!(check_version(good), Ok(()));
        }
        for bad in ["2.9.10", "1.4", "", "x"] {
            assert!(check_version(bad).is_err(), "{bad}");
        }
    }
}
