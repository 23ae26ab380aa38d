//! The configuration of cold data.

use std::path::PathBuf;
use std::time::Duration;

use serde::Deserialize;

use super::{ConfigError, within};
use offbd_service::cold_directory;
use offbd_store::ColdDirectory;
use offbd_wire::session_file::SessionFormat;

/// A hundred years, days.
const HUNDRED_YEARS: usize = 36_525;

/// Where the samples of ended sessions go that leave the database.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ColdConfig {
    /// An existing directory of this database alone; the same for all nodes of a cluster.
    pub directory: PathBuf,
    /// Days after its end after which a session leaves the database, 0 for at once; without
    /// it, none leaves, and those that have left are still read.
    pub after_days: Option<usize>,
}

impl ColdConfig {
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        let invalid = |key, reason| Err(ConfigError::Invalid { key, reason });
        if self.directory.as_os_str().is_empty() {
            return invalid("cold.directory", "is empty".to_owned());
        }
        within("cold.after_days", self.after_days.unwrap_or_default(), 0, HUNDRED_YEARS)?;
        SessionFormat::Parquet
            .check()
            .or_else(|error| invalid("cold", format!("is set, but {error}")))
    }

    pub(super) fn directory(&self) -> ColdDirectory {
        cold_directory(&self.directory)
    }

    pub(super) fn after(&self) -> Option<Duration> {
        self.after_days.map(|days| Duration::from_secs(days as u64 * 86_400))
    }
}
