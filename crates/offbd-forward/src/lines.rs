//! Takes the lines of a stream, CSV or NDJSON, and puts them into the spool in batches.

use std::io::{BufRead, Read};
use std::time::Duration;

use tokio::sync::mpsc;
use tokio::time::{sleep, timeout};

use super::parsed;
use super::spool::{NewBatch, Spool};
use offbd_net::Reasons;

/// Most lines of a batch.
const MAX_BATCH_LINES: usize = 100;
/// Longest time that a line waits for a full batch.
const LONGEST_WAIT: Duration = Duration::from_millis(500);
/// Longest line, bytes; a longer one ends the stream with an error.
const MAX_LINE_BYTES: u64 = 1 << 20;
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

/// Reads `source` to its end on a thread of its own, and spools its lines for `asset`. While the
/// spool is full or fails the source is not read, so that its writer waits. An error of the source
/// ends it and is logged.
pub async fn spool_lines(
    spool: &Spool,
    source: impl BufRead + Send + 'static,
    format: LineFormat,
    asset: &str,
    query: &str,
) {
    let (send, mut lines) = mpsc::channel(MAX_BATCH_LINES);
    std::thread::spawn(move || read(source, &send));
    let header = match format {
        LineFormat::Csv => lines.recv().await.unwrap_or_default(),
        LineFormat::Ndjson => Vec::new(),
    };
    let invalid = Reasons::default();
    while let Some(first) = lines.recv().await {
        let mut body = header.clone();
        body.extend(first);
        // Ends when the batch is full, the time is over, or the source has ended.
        let _ = timeout(LONGEST_WAIT, async {
            for _ in 1..MAX_BATCH_LINES {
                let Some(line) = lines.recv().await else { break };
                body.extend(line);
            }
        })
        .await;
        let (asset, query) = (asset.to_owned(), query.to_owned());
        let media_type = format.media_type().to_owned();
        let batch = NewBatch { asset, query, media_type, body };
        log_invalid(&batch, &invalid);
        put(spool, &batch).await;
    }
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

/// Adds a batch, once there is room for it and the spool does not fail.
async fn put(spool: &Spool, batch: &NewBatch) {
    let logged = Reasons::default();
    while let Err(error) = spool.put(batch).await {
        if logged.is_new(&error) {
            tracing::warn!(%error, "the source waits");
        }
        tokio::select! {
            () = spool.freed.notified() => {}
            () = sleep(RETRY) => {}
        }
    }
}

/// Sends each line, with its end.
fn read(mut source: impl BufRead, to: &mpsc::Sender<Vec<u8>>) {
    loop {
        let mut line = Vec::new();
        match (&mut source).take(MAX_LINE_BYTES).read_until(b'\n', &mut line) {
            Ok(0) => return,
            Ok(n) if n as u64 == MAX_LINE_BYTES && line.last() != Some(&b'\n') => {
                tracing::error!(
                    "a line is longer than {MAX_LINE_BYTES} bytes; the rest is not read"
                );
                return;
            }
            Ok(_) => {
                if line.last() != Some(&b'\n') {
                    line.push(b'\n');
                }
                if to.blocking_send(line).is_err() {
                    return;
                }
            }
            Err(error) => {
                tracing::error!(%error, "the source cannot be read");
                return;
            }
        }
    }
}
