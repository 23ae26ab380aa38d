//! `offbd serve`, `migrate` and `check`, which call [`crate::server`].

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::Args;

use super::logging::LoggingArgs;
use super::output;
use crate::config::{Config, ConfigError, Flags};
use crate::server::{self, Traces};
use crate::store::CheckReport;

/// The arguments of the service's configuration. They override the environment, which
/// overrides the file, which overrides the defaults.
#[derive(Clone, Debug, Args)]
pub(super) struct ConfigArgs {
    /// A configuration file (TOML)
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Address to listen on [default: 127.0.0.1:8087]
    #[arg(long, value_name = "ADDR:PORT")]
    listen: Option<SocketAddr>,
    /// Directory of the embedded store [default: offbd-data]
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// sqlite:FILE or postgres://… instead of the file in the data directory
    #[arg(long, value_name = "URL")]
    database: Option<String>,
}

impl ConfigArgs {
    /// Loads and checks the configuration.
    pub(super) fn load(&self) -> Result<Config, ConfigError> {
        let Self { listen, data, database, .. } = self.clone();
        Config::load(self.config.as_deref(), &Flags { listen, data, database })
    }
}

/// Runs the service, which receives telemetry, stores it and reports faults.
///
/// On SIGINT and SIGTERM it stops gracefully: requests in progress are finished
/// and committed first.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Every key of the configuration can be set by the environment: OFFBD_LISTEN,\n\
    OFFBD_LIMITS__BATCH_SAMPLES, ... `offbd check` shows the result.\n\n\
    Examples:\n  \
    offbd serve\n  \
    offbd serve --listen 0.0.0.0:8087 --data /var/lib/offbd --log-format json\n  \
    offbd serve --config offbd.toml"
)]
pub(super) struct ServeArgs {
    #[command(flatten)]
    config: ConfigArgs,
}

/// Brings the store's schema up to this version.
///
/// `serve` does this too; use this command to migrate without serving.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  offbd migrate --data /var/lib/offbd")]
pub(super) struct MigrateArgs {
    #[command(flatten)]
    config: ConfigArgs,
}

/// Checks the configuration, and the contents of the store with --data or --database.
///
/// Every recording is checked against its checksums, and every stored document.
/// Nothing is changed, and the service may be running.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  offbd check --config offbd.toml\n  \
    offbd check --data /var/lib/offbd\n\n\
    Exit status: 0 valid, 3 invalid configuration; the error names the key;\n\
    1 damaged store; each finding is printed.")]
pub(super) struct CheckArgs {
    #[command(flatten)]
    config: ConfigArgs,
}

pub(super) fn serve(args: &ServeArgs, logging: &LoggingArgs) -> anyhow::Result<()> {
    let config = args.config.load()?;
    let traces = Traces::start(&config.traces)?;
    logging.start(&config.log, traces.as_ref());
    let result = super::block_on(server::serve(config));
    traces.iter().for_each(Traces::stop);
    result
}

pub(super) fn migrate(args: &MigrateArgs) -> anyhow::Result<()> {
    let config = args.config.load()?;
    let message = super::block_on(server::migrate(&config))?;
    output::print_line(&message)
}

pub(super) fn check(args: &CheckArgs) -> anyhow::Result<()> {
    let config = args.config.load()?;
    output::print_line(&server::check(&config)?)?;
    if args.config.data.is_none() && args.config.database.is_none() {
        return Ok(());
    }
    let Some(report) = super::block_on(server::check_store(&config))? else {
        return output::print_line("checked  nothing: there is no store yet");
    };
    report.findings.iter().try_for_each(|finding| output::print_line(finding))?;
    let CheckReport { n_sessions, n_samples, n_documents, page_checksums, findings } = report;
    match page_checksums {
        Some(true) => output::print_line("pages    each has a checksum, and all were read")?,
        Some(false) => output::print_line(
            "pages    without checksums: an earlier version has made this file; to add them, \
             stop the service, `offbd backup` the store, and `offbd restore --replace` the copy",
        )?,
        None => {}
    }
    output::print_line(&format!(
        "checked  {n_sessions} sessions, {n_samples} samples, {n_documents} documents"
    ))?;
    anyhow::ensure!(findings.is_empty(), "the store is damaged: {} findings", findings.len());
    Ok(())
}
