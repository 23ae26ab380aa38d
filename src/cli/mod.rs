//! The command line: one binary, one module per subcommand.
//!
//! Data goes to stdout, all else to stderr. Exit codes: 0 done or judged (with
//! faults or without), 2 bad arguments, 3 unusable input, 1 anything else. A
//! reader that closes stdout early ends the command quietly.

mod calibrate;
mod corpus;
mod judge;
mod labels;
mod logging;
mod output;
mod replay;
mod score;
mod simulate;
mod table;
mod unusable;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Off-board diagnostics with a digital twin, for ball-on-plate rigs.
///
/// A device streams commands and measured positions; a twin runs beside it;
/// faults of the servos, the ball and the sensor come out.
#[derive(Debug, Parser)]
#[command(name = "offbd", version, max_term_width = 80)]
#[command(after_help = "Start here:\n  \
    offbd simulate --rig rig.json -o healthy.csv\n  \
    offbd calibrate --asset rig.json healthy.csv -o learnt.json\n  \
    offbd simulate --fault x_servo:dead@20 --seed 2 -o sick.csv\n  \
    offbd replay --asset learnt.json healthy.csv sick.csv\n\n\
    Exit status: 0 done or judged (faults or not), 2 bad arguments, 3 unusable input.")]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    logging: logging::LoggingArgs,
}

#[derive(Debug, Subcommand)]
enum Command {
    Simulate(Box<simulate::SimulateArgs>),
    Calibrate(calibrate::CalibrateArgs),
    Replay(replay::ReplayArgs),
    Score(score::ScoreArgs),
}

/// Runs the command line of this process.
#[must_use]
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return usage(&error),
    };
    cli.logging.start();
    let result = match cli.command {
        Command::Simulate(args) => simulate::run(&args),
        Command::Calibrate(args) => calibrate::run(&args),
        Command::Replay(args) => replay::run(&args),
        Command::Score(args) => score::run(&args),
    };
    result.map_or_else(|error| failure(&error), |()| ExitCode::SUCCESS)
}

/// Help and version are asked for; anything else is a bad argument.
fn usage(error: &clap::Error) -> ExitCode {
    // A closed stdout is no reason to fail when help is asked for.
    let _ = error.print();
    if error.use_stderr() { ExitCode::from(2) } else { ExitCode::SUCCESS }
}

fn failure(error: &anyhow::Error) -> ExitCode {
    if output::is_closed_pipe(error) {
        return ExitCode::SUCCESS;
    }
    anstream::eprintln!("offbd: {error:#}");
    ExitCode::from(if error.is::<unusable::Unusable>() { 3 } else { 1 })
}
