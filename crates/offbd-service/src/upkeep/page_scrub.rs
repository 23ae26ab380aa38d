//! The background scrub of the database's pages: reads every table now and then, so that
//! damage is known before the data are needed. SQLite only.

use std::time::{Duration, Instant};

use super::scrub::{PAUSE_AFTER_ALL, PAUSE_FACTOR, count_findings};
use crate::writing::Handles;

/// This kind of finding, as a label of a metric.
const PAGE: &str = "page";

/// The background task of the scrub.
pub(crate) struct PageScrubber {
    pub(crate) handles: Handles,
}

impl PageScrubber {
    /// Goes through all tables again and again until the service shuts down.
    pub(crate) async fn run(self) {
        count_findings(PAGE, 0);
        let closing = self.handles.closing.clone();
        closing.run_until_cancelled(self.forever()).await;
    }

    async fn forever(self) {
        loop {
            match self.handles.store.tables_to_check().await {
                Ok(tables) => {
                    for table in tables {
                        tokio::time::sleep(self.check(&table).await * PAUSE_FACTOR).await;
                    }
                }
                Err(error) => tracing::error!(%error, "the scrub cannot read the tables"),
            }
            tokio::time::sleep(PAUSE_AFTER_ALL).await;
        }
    }

    /// Reads `table` and reports what is damaged. Returns how long that took.
    #[expect(clippy::disallowed_methods, reason = "pauses are a multiple of the work")]
    async fn check(&self, table: &str) -> Duration {
        let started = Instant::now();
        match self.handles.store.check_table(table).await {
            Ok(findings) => {
                for what in &findings {
                    tracing::error!(table, what, "the database is damaged");
                }
                count_findings(PAGE, u64::try_from(findings.len()).unwrap_or(u64::MAX));
            }
            Err(error) => {
                tracing::warn!(table, %error, "the scrub cannot read a table; it goes on later");
            }
        }
        started.elapsed()
    }
}
