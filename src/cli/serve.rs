//! `offbd serve`, `migrate` and `check`, which call [`crate::server`].

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use serde_json::json;

use crate::config::{self, Config, ConfigError, Flags, LogConfig, LogFormat, ReadableSecret};
use crate::server::{self, ConfigSummary, Traces};
use offbd_store::CheckReport;
use offbd_terminal::logging::LoggingArgs;
use offbd_terminal::output::{self, OutputFormat};

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
        Config::load(self.config.as_deref(), &self.flags())
    }

    fn flags(&self) -> Flags {
        let Self { listen, data, database, .. } = self.clone();
        Flags { listen, data, database }
    }

    fn readable_secrets(&self, config: &Config) -> Vec<ReadableSecret> {
        config.readable_secrets(self.config.as_deref())
    }
}

/// Runs the service, which receives telemetry, stores it and reports faults.
///
/// On SIGINT and SIGTERM it stops gracefully: requests in progress are finished
/// and committed first.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Every key of the configuration can be set by the environment: OFFBD_LISTEN,\n\
    OFFBD_LIMITS__BATCH_SAMPLES, ... `offbd check --print` shows the values that\n\
    apply.\n\n\
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
    /// Text for people, or one JSON object
    #[arg(long, value_enum, default_value_t = OutputFormat::Table)]
    format: OutputFormat,
}

/// Checks the configuration, and the contents of the store with --data or --database.
///
/// Every recording is checked against its checksums, and every stored document.
/// Nothing is changed, and the service may be running.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  offbd check --config offbd.toml\n  \
    offbd check --config offbd.toml --print\n  \
    offbd check --data /var/lib/offbd\n  \
    offbd check --health\n\n\
    Exit status: 0 valid, 3 invalid configuration; the error names the key, or the\n\
    store of a newer version; 1 damaged store, of which each finding is printed, or\n\
    a service that is not ready.")]
pub(super) struct CheckArgs {
    #[command(flatten)]
    config: ConfigArgs,
    /// Only ask the service that runs with this configuration whether it is ready
    #[arg(long, conflicts_with_all = ["format", "print"])]
    health: bool,
    /// Only print all values that apply, as a TOML file, and where each comes from
    #[arg(long)]
    print: bool,
    /// Text for people, or one JSON object
    #[arg(long, value_enum, default_value_t = OutputFormat::Table)]
    format: OutputFormat,
}

/// Starts logging by the arguments or else by `config`, and sends `traces` if given.
pub(super) fn start_logging(logging: &LoggingArgs, config: &LogConfig, traces: Option<&Traces>) {
    logging.start(&config.level, config.format == LogFormat::Json, traces.map(Traces::layer));
}

pub(super) fn serve(args: &ServeArgs, logging: &LoggingArgs) -> anyhow::Result<()> {
    let config = args.config.load()?;
    let traces = Traces::start(&config)?;
    start_logging(logging, &config.log, traces.as_ref());
    args.config.readable_secrets(&config).iter().for_each(|secret| tracing::warn!("{secret}"));
    let result = offbd_terminal::block_on(server::serve(config));
    traces.iter().for_each(Traces::stop);
    result
}

pub(super) fn migrate(args: &MigrateArgs) -> anyhow::Result<()> {
    let config = args.config.load()?;
    let applied = offbd_terminal::block_on(server::migrate(&config))?;
    let store = config.location()?.to_string();
    match args.format {
        OutputFormat::Table => {
            output::print_line(&format!("{store}: {applied} migrations applied"))
        }
        OutputFormat::Json => output::print_json(&json!({ "store": store, "migrations": applied })),
    }
}

/// The result of `check`. Without a store that was asked for, and there, no `checked`.
#[derive(Serialize)]
struct CheckResult {
    #[serde(flatten)]
    configuration: ConfigSummary,
    /// Files with secrets that every user of this machine can read.
    warnings: Vec<String>,
    checked: Option<CheckedStore>,
}

#[derive(Serialize)]
struct CheckedStore {
    sessions: u64,
    samples: u64,
    documents: u64,
    /// Whether the file's pages have checksums; null for PostgreSQL.
    page_checksums: Option<bool>,
    findings: Vec<String>,
}

impl From<CheckReport> for CheckedStore {
    fn from(report: CheckReport) -> Self {
        let CheckReport { n_sessions, n_samples, n_documents, page_checksums, findings } = report;
        Self {
            sessions: n_sessions,
            samples: n_samples,
            documents: n_documents,
            page_checksums,
            findings,
        }
    }
}

pub(super) fn check(args: &CheckArgs) -> anyhow::Result<()> {
    let config = args.config.load()?;
    if args.health {
        return offbd_terminal::block_on(super::health::ask(&config));
    }
    if args.print {
        return print_keys(args);
    }
    let configuration = server::check(&config)?;
    let is_asked = args.config.data.is_some() || args.config.database.is_some();
    let report = match is_asked {
        true => offbd_terminal::block_on(server::check_store(&config))?,
        false => None,
    };
    let warnings = args.config.readable_secrets(&config).iter().map(ToString::to_string).collect();
    let checked = report.map(CheckedStore::from);
    let result = CheckResult { configuration, warnings, checked };
    match args.format {
        OutputFormat::Json => output::print_json(&result)?,
        OutputFormat::Table => print_check(&result, is_asked)?,
    }
    let n_findings = result.checked.map_or(0, |checked| checked.findings.len());
    anyhow::ensure!(n_findings == 0, "the store is damaged: {n_findings} findings");
    Ok(())
}

fn print_keys(args: &CheckArgs) -> anyhow::Result<()> {
    let keys = Config::effective(args.config.config.as_deref(), &args.config.flags())?;
    match args.format {
        OutputFormat::Json => output::print_json(&json!({ "keys": keys })),
        OutputFormat::Table => output::print_line(config::toml(&keys).trim_end()),
    }
}

fn print_check(result: &CheckResult, is_asked: bool) -> anyhow::Result<()> {
    output::print_line(&result.configuration.to_string())?;
    result
        .warnings
        .iter()
        .try_for_each(|warning| output::print_line(&format!("warning  {warning}")))?;
    let Some(store) = &result.checked else {
        return match is_asked {
            true => output::print_line("checked  nothing: there is no store yet"),
            false => Ok(()),
        };
    };
    store.findings.iter().try_for_each(|finding| output::print_line(finding))?;
    match store.page_checksums {
        Some(true) => output::print_line("pages    all read, their checksums match")?,
        Some(false) => output::print_line(
            "pages    without checksums: an earlier version has made this file; to add them, \
             stop the service, `offbd backup` the store, and `offbd restore --replace` the copy",
        )?,
        None => {}
    }
    let CheckedStore { sessions, samples, documents, .. } = store;
    output::print_line(&format!(
        "checked  {sessions} sessions, {samples} samples, {documents} documents"
    ))
}
