//! The command line: one binary, one module per subcommand.
//!
//! Data goes to stdout, all else to stderr. Exit codes: 0 done or judged (with
//! faults or without), 2 bad arguments, 3 unusable input, 1 anything else. A
//! reader that closes stdout early ends the command quietly.

mod backup;
mod calibrate;
mod drive_cycle;
mod judge;
#[cfg(feature = "lab")]
mod lab;
mod logging;
mod output;
mod replay;
mod serve;
mod table;
mod token;
mod trends;
mod unusable;
mod watch;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::config::{ConfigError, LogConfig};

/// Off-board diagnostics with a digital twin, for ball-on-plate rigs.
///
/// A device streams commands and measured positions; a twin runs beside it;
/// faults of the servos, the ball and the sensor come out.
#[derive(Debug, Parser)]
#[command(name = "offbd", version, max_term_width = 80)]
#[command(after_help = "Start here:\n  \
    offbd demo --seconds 60\n\n\
    With files:\n  \
    offbd simulate --rig rig.json --reference lissajous -o healthy.csv\n  \
    offbd calibrate --asset rig.json healthy.csv -o learnt.json\n  \
    offbd simulate --fault x_servo:dead@20 --seed 2 -o sick.csv\n  \
    offbd replay --asset learnt.json healthy.csv sick.csv\n\n\
    The chapter's exercises:\n  \
    offbd scene --list\n\n\
    Exit status: 0 done or judged (faults or not), 2 bad arguments, 3 unusable input.")]
struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    logging: logging::LoggingArgs,
}

#[derive(Debug, Subcommand)]
enum Command {
    #[cfg(feature = "lab")]
    #[command(flatten)]
    Lab(lab::LabCommand),
    Calibrate(calibrate::CalibrateArgs),
    Replay(replay::ReplayArgs),
    Trends(trends::TrendsArgs),
    DriveCycle(drive_cycle::DriveCycleArgs),
    Serve(serve::ServeArgs),
    Watch(watch::WatchArgs),
    Token(token::TokenArgs),
    Backup(backup::BackupArgs),
    Restore(backup::RestoreArgs),
    Migrate(serve::MigrateArgs),
    Check(serve::CheckArgs),
}

/// Runs the command line of this process.
#[must_use]
pub fn main() -> ExitCode {
    match Cli::try_parse() {
        Ok(cli) => run(cli).map_or_else(|error| failure(&error), |()| ExitCode::SUCCESS),
        Err(error) => usage(&error),
    }
}

fn run(cli: Cli) -> anyhow::Result<()> {
    let logging = cli.logging;
    match &cli.command {
        // The service's configuration says how it logs.
        Command::Serve(_) => {}
        #[cfg(feature = "lab")]
        Command::Lab(command) if command.log_level().is_some() => {
            let level = command.log_level().unwrap_or_default().to_owned();
            logging.start(&LogConfig { level, ..LogConfig::default() }, None);
        }
        _ => logging.start(&LogConfig::default(), None),
    }
    match cli.command {
        #[cfg(feature = "lab")]
        Command::Lab(command) => command.run(),
        Command::Calibrate(args) => calibrate::run(&args),
        Command::Replay(args) => replay::run(&args),
        Command::Trends(args) => trends::run(&args),
        Command::DriveCycle(args) => drive_cycle::run(&args),
        Command::Serve(args) => serve::serve(&args, &logging),
        Command::Watch(args) => watch::run(&args),
        Command::Token(args) => token::run(&args),
        Command::Backup(args) => backup::backup(&args),
        Command::Restore(args) => backup::restore(&args),
        Command::Migrate(args) => serve::migrate(&args),
        Command::Check(args) => serve::check(&args),
    }
}

/// A runtime for the commands that serve or talk to a service.
fn runtime() -> std::io::Result<tokio::runtime::Runtime> {
    tokio::runtime::Builder::new_multi_thread().enable_all().build()
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
    if error.is::<unusable::BadArgument>() {
        return ExitCode::from(2);
    }
    let unusable = error.is::<unusable::Unusable>() || error.is::<ConfigError>();
    ExitCode::from(if unusable { 3 } else { 1 })
}
