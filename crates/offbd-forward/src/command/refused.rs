//! `offbd forward list`, `send-again` and `remove`: batches that the service has refused.

use std::io::Write as _;
use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::DEFAULT_SPOOL;
use crate::{MAX_SPOOL_BYTES, RefusedBatch, Spool, SpoolError};
use offbd_terminal::errors::{BadArgument, InputError};
use offbd_terminal::output::{self, OutputFormat};
use offbd_terminal::table;

#[derive(Clone, Debug, Subcommand)]
pub(super) enum RefusedCommand {
    List(ListRefusedArgs),
    SendAgain(SendAgainArgs),
    Remove(RemoveArgs),
}

#[derive(Clone, Debug, Args)]
struct SpoolArgs {
    /// File of the spool, which no agent uses at the moment
    #[arg(long, value_name = "FILE", default_value = DEFAULT_SPOOL)]
    spool: PathBuf,
}

/// Lists the batches that are set aside, with the reasons.
///
/// Of an agent that is running, GET /api/v1/spool says the same.
#[derive(Clone, Debug, Args)]
pub(super) struct ListRefusedArgs {
    #[command(flatten)]
    spool: SpoolArgs,
    /// Output format
    #[arg(long, value_enum, default_value_t = OutputFormat::Table)]
    format: OutputFormat,
}

/// Lets the agent, once it is started, send again batches that are set aside.
///
/// Stop the agent first: devices keep what it does not acknowledge. Samples go to
/// the session that they were meant for; if it is a new one, it ends the session
/// that is open. A damaged batch cannot be sent; --all leaves it where it is.
#[derive(Clone, Debug, Args)]
pub(super) struct SendAgainArgs {
    #[command(flatten)]
    chosen: ChosenArgs,
}

/// Deletes batches that are set aside, for good.
///
/// Stop the agent first: devices keep what it does not acknowledge.
#[derive(Clone, Debug, Args)]
pub(super) struct RemoveArgs {
    #[command(flatten)]
    chosen: ChosenArgs,
}

#[derive(Clone, Debug, Args)]
struct ChosenArgs {
    #[command(flatten)]
    spool: SpoolArgs,
    /// Ids, as listed
    #[arg(value_name = "ID", required_unless_present = "all", conflicts_with = "all")]
    ids: Vec<i64>,
    /// All batches that are set aside
    #[arg(long)]
    all: bool,
}

impl RefusedCommand {
    pub(super) async fn run(&self) -> anyhow::Result<()> {
        match self {
            Self::List(args) => list(&args.spool.open().await?.refused().await?, args.format),
            Self::SendAgain(SendAgainArgs { chosen }) => {
                let spool = chosen.spool.open().await?;
                let ids = if chosen.all { spool.sendable().await? } else { chosen.ids.clone() };
                spool.send_again(&ids).await.map_err(unknown_id)
            }
            Self::Remove(RemoveArgs { chosen }) => {
                let spool = chosen.spool.open().await?;
                let refused = spool.refused().await?;
                let all = || refused.iter().map(|batch| batch.id).collect();
                let ids = if chosen.all { all() } else { chosen.ids.clone() };
                spool.delete(&ids).await.map_err(unknown_id)
            }
        }
    }
}

impl SpoolArgs {
    async fn open(&self) -> Result<Spool, InputError> {
        let unusable = |reason: String| InputError::file(&self.spool, reason);
        if !self.spool.is_file() {
            return Err(unusable("the spool does not exist".to_owned()));
        }
        Spool::open(&self.spool, MAX_SPOOL_BYTES).await.map_err(|error| match error {
            SpoolError::Locked => unusable(format!("{error}; stop it first")),
            error => unusable(error.to_string()),
        })
    }
}

fn unknown_id(error: SpoolError) -> anyhow::Error {
    match error {
        SpoolError::NotSetAside(_) | SpoolError::Damaged(_) => {
            BadArgument(error.to_string()).into()
        }
        error => error.into(),
    }
}

fn list(refused: &[RefusedBatch], format: OutputFormat) -> anyhow::Result<()> {
    let mut out = output::stdout();
    match format {
        OutputFormat::Table => {
            let mut table = table::table(&["id", "asset", "bytes", "reason"], &[0, 2]);
            for RefusedBatch { id, asset, bytes, reason } in refused {
                table.add_row([&id.to_string(), asset, &bytes.to_string(), reason]);
            }
            table::lines(&table).try_for_each(|line| writeln!(out, "{line}"))?;
        }
        OutputFormat::Json => {
            for batch in refused {
                writeln!(out, "{}", serde_json::to_string(batch)?)?;
            }
        }
    }
    Ok(out.flush()?)
}
