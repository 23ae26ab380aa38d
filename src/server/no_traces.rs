//! Traces in a build without the feature `otel`: there are none, and a
//! configuration that names an endpoint is refused ([`TracesConfig`]).

use anyhow::Result;
use tracing_subscriber::layer::Identity;

use crate::config::TracesConfig;

/// What would send traces; there is no value of it.
pub enum Traces {}

impl Traces {
    /// `None`.
    ///
    /// # Errors
    /// Never.
    pub fn start(_: &TracesConfig) -> Result<Option<Self>> {
        Ok(None)
    }

    /// A layer that does nothing.
    #[must_use]
    pub fn layer(&self) -> Identity {
        match *self {}
    }

    /// Sends nothing.
    pub fn stop(&self) {
        match *self {}
    }
}
