//! `offbd-forward`: the edge agent as a separate small program, for the machine beside the rig.

use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser};
use offbd_forward::command::{self, ForwardArgs};
use offbd_terminal::help;
use offbd_terminal::logging::LoggingArgs;
use offbd_terminal::report;

/// Keeps telemetry on this machine until the service has stored it.
///
/// Takes batches like the service (POST /api/v1/assets/ASSET/telemetry), or with
/// --asset the lines of stdin, and forwards them in order, across lost
/// connections and restarts. When the spool is full it takes no more: devices get
/// 429, a pipe waits.
#[derive(Debug, Parser)]
#[command(name = "offbd-forward", version, max_term_width = 80)]
struct Cli {
    #[command(flatten)]
    forward: ForwardArgs,
    #[command(flatten)]
    logging: LoggingArgs,
}

fn main() -> ExitCode {
    let text = Cli::command().get_after_help().map(ToString::to_string).unwrap_or_default();
    let named = text.replace("offbd forward", "offbd-forward");
    let matches = help::described(Cli::command().after_help(named)).get_matches();
    let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    cli.logging.start("info", false, None::<tracing_subscriber::layer::Identity>);
    command::run(&cli.forward).map_or_else(|error| report(&error, false), |()| ExitCode::SUCCESS)
}
