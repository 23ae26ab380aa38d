//! `offbd backup` and `restore`: the embedded store in one file.

use std::path::PathBuf;

use clap::Args;

use super::output;
use super::serve::ConfigArgs;
use crate::server;

/// Copies the embedded store to a file, also while the service runs.
///
/// The copy holds everything that was acknowledged before the command was
/// given. A database of PostgreSQL is copied by its own pg_dump.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  \
    offbd backup --data /var/lib/offbd /backup/offbd-monday.sqlite")]
pub(super) struct BackupArgs {
    /// The copy; it must not be there yet
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    config: ConfigArgs,
}

/// Makes the embedded store from a copy; the service must not run.
///
/// The copy is checked first and brought to this version's schema. If it is
/// not whole, everything stays as it was.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  \
    offbd restore --data /var/lib/offbd /backup/offbd-monday.sqlite")]
pub(super) struct RestoreArgs {
    /// The copy that `offbd backup` made
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Take the place of the store that is there; it is kept as *.replaced
    #[arg(long)]
    replace: bool,
    #[command(flatten)]
    config: ConfigArgs,
}

pub(super) fn backup(args: &BackupArgs) -> anyhow::Result<()> {
    let config = args.config.load()?;
    let told = super::runtime()?.block_on(server::back_up(&config, &args.file))?;
    output::line(&told)
}

pub(super) fn restore(args: &RestoreArgs) -> anyhow::Result<()> {
    let config = args.config.load()?;
    let restore = server::restore(&config, &args.file, args.replace);
    output::line(&super::runtime()?.block_on(restore)?)
}
