//! Takes the lines of a stream, CSV or NDJSON, and puts them into the spool in batches.

use std::time::Duration;

use tokio::time::{sleep, timeout};

use super::batch::{NewBatch, SpoolError};
use super::parsed;
use super::source::Lines;
use super::spool::Spool;
use super::stop::Stop;
use offbd_net::Reasons;

/// Most lines of a batch.
const MAX_BATCH_LINES: usize = 100;
/// Longest time that a line waits for a full batch.
const LONGEST_WAIT: Duration = Duration::from_millis(500);
/// How often a spool that is full or fails is tried if no room is reported.
const RETRY: Duration = Duration::from_secs(1);

/// The format of a stream of lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineFormat {
    /// The first line is the header.
    Csv,
    Ndjson,
}

impl LineFormat {
    const fn media_type(self) -> &'static str {
        match self {
            Self::Csv => "text/csv",
            Self::Ndjson => "application/x-ndjson",
        }
    }
}

/// Spools `lines` for `asset` to their end; returns the number of those that it could not keep.
/// While the spool is full or fails the source is not read, so that its writer waits; after a
/// stop signal, what was read is kept beyond the limit.
pub async fn spool_lines(
    spool: &Spool,
    mut lines: Lines,
    format: LineFormat,
    asset: &str,
    query: &str,
) -> usize {
    let header = match format {
        LineFormat::Csv => lines.next().await.unwrap_or_default(),
        LineFormat::Ndjson => Vec::new(),
    };
    let invalid = Reasons::default();
    let mut n_lost = 0;
    while let Some(first) = lines.next().await {
        let mut body = header.clone();
        body.extend(first);
        let mut n = 1;
        // Ends when the batch is full, the time is over, or the source has ended.
        let _ = timeout(LONGEST_WAIT, async {
            while n < MAX_BATCH_LINES {
                let Some(line) = lines.next().await else { break };
                body.extend(line);
                n += 1;
            }
        })
        .await;
        let (asset, query) = (asset.to_owned(), query.to_owned());
        let media_type = format.media_type().to_owned();
        let batch = NewBatch { asset, query, media_type, body };
        log_invalid(&batch, &invalid);
        if let Err(error) = put(spool, &batch, lines.stop()).await {
            tracing::error!(%error, n, "lines are lost");
            n_lost += n;
        }
    }
    n_lost
}

/// Logs why lines are not samples, each reason once: the service rejects them, and a pipe, unlike
/// a device, has no answer.
fn log_invalid(batch: &NewBatch, logged: &Reasons) {
    let Ok(parsed) = parsed(batch) else { return };
    for reason in parsed.rows.iter().filter_map(|row| row.as_ref().err()) {
        // Without the line of the batch, which is not that of the pipe.
        let numbered = reason.split_once(": ").filter(|(line, _)| line.starts_with("line "));
        let reason = numbered.map_or(reason.as_str(), |(_, reason)| reason);
        if logged.is_new(&reason) {
            tracing::error!(reason, "a line is not a sample, and is not recorded");
        }
    }
}

/// Adds a batch, once there is room for it and the spool does not fail, or at once after a stop
/// signal.
async fn put(spool: &Spool, batch: &NewBatch, mut stop: Stop) -> Result<(), SpoolError> {
    let logged = Reasons::default();
    while let Err(error) = spool.put(batch).await {
        if stop.is_told() {
            return spool.put_last(batch).await;
        }
        if logged.is_new(&error) {
            tracing::warn!(%error, "the source waits");
        }
        tokio::select! {
            () = spool.freed.notified() => {}
            () = sleep(RETRY) => {}
            () = stop.told() => {}
        }
    }
    Ok(())
}
