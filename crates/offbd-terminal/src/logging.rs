//! Logging to stderr with time stamps, as text or one JSON object per line.

use std::io::IsTerminal;

use clap::Args;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, Layer, Registry};

/// The arguments about logs.
#[derive(Clone, Debug, Args)]
pub struct LoggingArgs {
    /// How logs are written to stderr [default: text]
    #[arg(long, global = true, value_enum, value_name = "FORMAT", help_heading = "Logs")]
    log_format: Option<LogFormatArg>,
    /// Which logs: error, warn, info, debug, trace, or module=level,...
    #[arg(long, global = true, value_name = "LEVEL", help_heading = "Logs")]
    log: Option<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum LogFormatArg {
    Text,
    Json,
}

impl LoggingArgs {
    /// Logs errors only, if no level was given.
    pub fn only_errors(&mut self) {
        self.log.get_or_insert_with(|| "error".to_owned());
    }

    /// Starts logging for this process, by the arguments or else by `level` and `json`, and sends
    /// the spans to `traces` if given. A second call has no effect.
    pub fn start(
        &self,
        level: &str,
        json: bool,
        traces: Option<impl Layer<Registry> + Send + Sync>,
    ) {
        let level = self.log.as_deref().unwrap_or(level);
        let filter = EnvFilter::try_new(level).unwrap_or_else(|_| EnvFilter::new("info"));
        let colour = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none();
        let logs = tracing_subscriber::fmt::layer()
            .with_writer(std::io::stderr)
            .with_ansi(colour)
            .with_target(false);
        let json = self.log_format.map_or(json, |format| format == LogFormatArg::Json);
        let logs = if json { logs.json().flatten_event(true).boxed() } else { logs.boxed() };
        // Fails only in a test that runs two commands in one process.
        let _ =
            tracing_subscriber::registry().with(traces).with(logs.with_filter(filter)).try_init();
    }
}
