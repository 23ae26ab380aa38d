//! `offbd forward`: the edge agent, and what it has set aside.

mod refused;

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Context;
use clap::{Args, ValueEnum};
use percent_encoding::{NON_ALPHANUMERIC, utf8_percent_encode};

use crate::stop::Stop;
use crate::{
    LineFormat, Lines, MAX_SPOOL_BYTES, ServiceUrl, Spool, SpoolSender, listen, router, spool_lines,
};
use offbd_core::engine::Rig;
use offbd_terminal::errors::{BadArgument, InputError, read};

const DEFAULT_SPOOL: &str = "offbd-spool.sqlite";

/// Keeps telemetry on this machine until the service has stored it.
///
/// Takes batches like the service (POST /api/v1/assets/ASSET/telemetry), or with
/// --asset the lines of stdin, and forwards them in order, across lost
/// connections and restarts. When the spool is full it takes no more: devices get
/// 429, a pipe waits.
#[derive(Clone, Debug, Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
#[command(after_help = "GET /api/v1/spool says how much waits and why, and what the service has\n\
    refused for good. The agent has no access control: let it listen where only\n\
    devices are.\n\n\
    Only an acknowledgement of all rows ends the wait of a batch. What the service\n\
    refuses, and samples that it rejects, are set aside with the reason. On SIGINT\n\
    and SIGTERM the agent ends once all that it has read is in the spool.\n\n\
    Examples:\n  \
    offbd forward --url https://offbd.example:8087 --token-file token \\\n      \
    --spool spool.sqlite\n  \
    my_logger | offbd forward --url http://10.0.0.2:8087 --asset my-rig \\\n      \
    --session monday\n  \
    offbd forward list --spool spool.sqlite\n  \
    offbd forward send-again --spool spool.sqlite 17 18")]
pub struct ForwardArgs {
    #[command(subcommand)]
    refused: Option<refused::RefusedCommand>,
    #[command(flatten)]
    agent: Option<AgentArgs>,
}

#[derive(Clone, Debug, Args)]
struct AgentArgs {
    /// Address of the service
    #[arg(long = "url", visible_alias = "to", value_name = "URL")]
    to: String,
    /// File with the token for the service; an empty one for a service without
    /// tokens
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
    /// File of the spool; created if missing
    #[arg(long, value_name = "FILE", default_value = DEFAULT_SPOOL)]
    spool: PathBuf,
    /// Most bytes in the spool
    #[arg(long, value_name = "N", default_value_t = MAX_SPOOL_BYTES)]
    max_bytes: u64,
    /// Address to listen on
    #[arg(
        long,
        value_name = "ADDR:PORT",
        default_value = "127.0.0.1:8088",
        conflicts_with = "asset"
    )]
    listen: SocketAddr,
    /// Name by which devices address the agent, besides IP addresses and
    /// localhost; may be given several times
    #[arg(long, value_name = "NAME", conflicts_with = "asset")]
    host: Vec<String>,
    /// Take the lines of stdin as samples of this asset, instead of listening
    #[arg(long, value_name = "ASSET")]
    asset: Option<String>,
    /// Name of the session of these lines
    #[arg(long, value_name = "NAME", requires = "asset")]
    session: Option<String>,
    /// Format of these lines; the first line of CSV is the header
    #[arg(long, value_enum, default_value = "csv", requires = "asset")]
    format: LineFormatArg,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum LineFormatArg {
    Csv,
    Ndjson,
}

pub fn run(args: &ForwardArgs) -> anyhow::Result<()> {
    match (&args.refused, &args.agent) {
        (Some(command), _) => offbd_terminal::block_on(command.run()),
        (None, Some(args)) => forward(args),
        (None, None) => Err(BadArgument("name the service with --url".to_owned()).into()),
    }
}

fn forward(args: &AgentArgs) -> anyhow::Result<()> {
    let token = args.token_file.as_deref().map(read).transpose()?;
    let token = token.map(|token| String::from_utf8_lossy(&token).trim().to_owned());
    let token = token.filter(|token| !token.is_empty());
    let to = ServiceUrl::new(&args.to, token.as_deref())
        .map_err(|e| BadArgument(format!("--url: {e}")))?;
    offbd_terminal::block_on(async {
        let spool = Spool::open(&args.spool, args.max_bytes).await;
        let spool = Arc::new(spool.map_err(|e| InputError::file(&args.spool, e))?);
        let waiting = spool.status().await?.waiting_batches;
        let delivery = SpoolSender::new(spool.clone(), to);
        let stop = Stop::at_signal()?;
        match &args.asset {
            Some(asset) => forward_lines(args, asset, &spool, delivery, stop).await,
            None => serve(args, spool, delivery, waiting, stop).await,
        }
    })
}

async fn serve(
    args: &AgentArgs,
    spool: Arc<Spool>,
    delivery: SpoolSender,
    waiting: u64,
    stop: Stop,
) -> anyhow::Result<()> {
    let listener = tokio::net::TcpListener::bind(args.listen).await;
    let listener = listener.with_context(|| format!("cannot listen on {}", args.listen))?;
    let address = listener.local_addr()?;
    tracing::info!(%address, to = args.to, waiting, "forwarding");
    let router = router(spool.clone(), delivery.delays(), &args.host);
    tokio::select! {
        () = listen::serve(listener, router, stop) => log_stop(&spool).await,
        never = delivery.run() => match never {},
    }
}

async fn forward_lines(
    args: &AgentArgs,
    asset: &str,
    spool: &Spool,
    delivery: SpoolSender,
    mut stop: Stop,
) -> anyhow::Result<()> {
    Rig::chapter(asset).check().map_err(|e| BadArgument(format!("--asset: {}", e.reason)))?;
    let name = |name: &String| format!("session={}", utf8_percent_encode(name, NON_ALPHANUMERIC));
    let query = args.session.as_ref().map(name).unwrap_or_default();
    let format = match args.format {
        LineFormatArg::Csv => LineFormat::Csv,
        LineFormatArg::Ndjson => LineFormat::Ndjson,
    };
    let lines = Lines::of_stdin(stop.clone()).context("cannot read stdin")?;
    let n_lost = tokio::select! {
        n_lost = spool_lines(spool, lines, format, asset, &query) => n_lost,
        never = delivery.run() => match never {},
    };
    anyhow::ensure!(n_lost == 0, "{n_lost} lines could not be kept");
    tokio::select! {
        biased;
        () = stop.told() => return log_stop(spool).await,
        // What was under way when the source ended is sent again.
        () = delivery.drain() => {}
    }
    let n = spool.refused().await?.len();
    anyhow::ensure!(n == 0, "of {n} batches all or a part is refused: see `offbd forward list`");
    Ok(())
}

async fn log_stop(spool: &Spool) -> anyhow::Result<()> {
    let waiting = spool.status().await?.waiting_batches;
    tracing::info!(waiting, "stopping; what waits is sent after the next start");
    Ok(())
}
