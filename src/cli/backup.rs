//! `offbd backup` and `offbd restore`: the embedded store as one file.

use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use serde_json::json;

use super::serve::ConfigArgs;
use crate::server;
use offbd_terminal::output::{self, OutputFormat};

/// Copies the embedded store to a file, also while the service runs.
///
/// The copy has everything that was acknowledged before the command started.
/// For a PostgreSQL database, use pg_dump instead.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  \
    offbd backup --data /var/lib/offbd -o /backup/offbd-monday.sqlite")]
pub(super) struct BackupArgs {
    /// The file to create; it must not exist
    #[arg(value_name = "FILE", required_unless_present = "output")]
    file: Option<PathBuf>,
    /// The file to create, as with the other commands
    #[arg(short, long, value_name = "FILE", conflicts_with = "file")]
    output: Option<PathBuf>,
    #[command(flatten)]
    config: ConfigArgs,
    /// Text for people, or one JSON object
    #[arg(long, value_enum, default_value_t = OutputFormat::Table)]
    format: OutputFormat,
}

/// Restores the embedded store from a copy; the service must not run.
///
/// The copy is checked first and brought to this version's schema. If it is
/// damaged, nothing is changed.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  \
    offbd restore --data /var/lib/offbd /backup/offbd-monday.sqlite")]
pub(super) struct RestoreArgs {
    /// The copy, made by `offbd backup`
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Replace an existing store, which is renamed to *.replaced
    #[arg(long)]
    replace: bool,
    #[command(flatten)]
    config: ConfigArgs,
    /// Text for people, or one JSON object
    #[arg(long, value_enum, default_value_t = OutputFormat::Table)]
    format: OutputFormat,
}

pub(super) fn backup(args: &BackupArgs) -> anyhow::Result<()> {
    let config = args.config.load()?;
    // One of them is required.
    let file = args.output.as_ref().or(args.file.as_ref()).context("no FILE")?;
    offbd_terminal::block_on(server::back_up(&config, file))?;
    let (file, store) = (file.display().to_string(), config.location()?.to_string());
    match args.format {
        OutputFormat::Table => output::print_line(&format!("{file}: a copy of {store}")),
        OutputFormat::Json => output::print_json(&json!({ "store": store, "file": file })),
    }
}

pub(super) fn restore(args: &RestoreArgs) -> anyhow::Result<()> {
    let config = args.config.load()?;
    offbd_terminal::block_on(server::restore(&config, &args.file, args.replace))?;
    let (file, store) = (args.file.display().to_string(), config.location()?.to_string());
    match args.format {
        OutputFormat::Table => output::print_line(&format!("{store}: restored from {file}")),
        OutputFormat::Json => output::print_json(&json!({ "store": store, "file": file })),
    }
}
