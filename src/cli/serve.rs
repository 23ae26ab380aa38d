//! `offbd serve`, `migrate` and `check`: thin shells over [`crate::server`].

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::Args;

use super::logging::LoggingArgs;
use super::output;
use crate::config::{Config, ConfigError, Flags};
use crate::server::{self, Traces};

/// Where the service's configuration comes from, lowest first: the defaults, a
/// TOML file, the environment, the command line.
#[derive(Clone, Debug, Args)]
pub(super) struct ConfigArgs {
    /// A configuration file (TOML)
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Where to listen [default: 127.0.0.1:8087]
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
    /// The configuration, checked.
    pub(super) fn load(&self) -> Result<Config, ConfigError> {
        let Self { listen, data, database, .. } = self.clone();
        Config::load(self.config.as_deref(), &Flags { listen, data, database })
    }
}

/// Runs the service: telemetry in, faults out, everything stored.
///
/// Stops gracefully on SIGINT and SIGTERM: what is in flight is finished and
/// committed first.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "Every key of the configuration can be set by the environment: OFFBD_LISTEN,\n\
    OFFBD_LIMITS__BATCH_SAMPLES, ... `offbd check` shows what it comes to.\n\n\
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
/// `serve` does so by itself; this is for those who want it apart.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  offbd migrate --data /var/lib/offbd")]
pub(super) struct MigrateArgs {
    #[command(flatten)]
    config: ConfigArgs,
}

/// Checks the configuration and says what it comes to.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  offbd check --config offbd.toml\n\n\
    Exit status: 0 it is in order, 3 it is not; the key is named.")]
pub(super) struct CheckArgs {
    #[command(flatten)]
    config: ConfigArgs,
}

pub(super) fn serve(args: &ServeArgs, logging: &LoggingArgs) -> anyhow::Result<()> {
    let config = args.config.load()?;
    let traces = Traces::start(&config.traces)?;
    logging.start(&config.log, traces.as_ref());
    let served = super::runtime()?.block_on(server::serve(config));
    traces.iter().for_each(Traces::stop);
    served
}

pub(super) fn migrate(args: &MigrateArgs) -> anyhow::Result<()> {
    let config = args.config.load()?;
    let told = super::runtime()?.block_on(server::migrate(&config))?;
    output::line(&told)
}

pub(super) fn check(args: &CheckArgs) -> anyhow::Result<()> {
    output::line(&server::check(&args.config.load()?)?)
}
