//! Logs: on stderr, with time stamps, as text or one JSON object per line.

use std::io::IsTerminal;

use clap::Args;
use tracing_subscriber::EnvFilter;

#[derive(Clone, Debug, Args)]
pub(super) struct LoggingArgs {
    /// How logs are written to stderr
    #[arg(long, global = true, value_enum, default_value = "text", help_heading = "Logs")]
    log_format: LogFormat,
    /// Which logs: error, warn, info, debug, trace, or module=level,…
    #[arg(long, global = true, env = "OFFBD_LOG", default_value = "info", help_heading = "Logs")]
    log: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum LogFormat {
    Text,
    Json,
}

impl LoggingArgs {
    /// Starts logging for this process; a second start is ignored.
    pub(super) fn start(&self) {
        let filter = EnvFilter::try_new(&self.log).unwrap_or_else(|_| EnvFilter::new("info"));
        let colour = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none();
        let logs = tracing_subscriber::fmt()
            .with_env_filter(filter)
            .with_writer(std::io::stderr)
            .with_ansi(colour)
            .with_target(false);
        // Only a test that runs two commands in one process starts it twice.
        let _ = match self.log_format {
            LogFormat::Text => logs.try_init(),
            LogFormat::Json => logs.json().flatten_event(true).try_init(),
        };
    }
}
