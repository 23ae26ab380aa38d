//! The command line, with one module per subcommand.
//!
//! Data goes to stdout, everything else to stderr. Exit codes: 0 for success, whether
//! faults were found or not, 2 for invalid arguments, 3 for unusable input, 4 for a fault
//! with `--fail-on-fault`, 1 for any other error. If the reader of stdout closes it early, the command ends without an
//! error.

mod backup;
mod completions;
#[cfg(feature = "lab")]
mod demo;
mod health;
mod help;
#[cfg(all(test, feature = "lab", feature = "nats"))]
mod reference;
mod serve;
mod token;
mod usage;
mod version;
mod watch;

use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use offbd_file_cli::{calibrate, drive_cycle, export, inspect, replay, trends};
use offbd_forward::command as forward;
use offbd_store::StoreError;
use offbd_terminal::logging::LoggingArgs;
use offbd_terminal::output;

use crate::config::{ConfigError, LogConfig};

/// How sqlx names the threads of SQLite connections.
const SQLITE_THREAD: &str = "sqlx-sqlite-worker-";

/// Off-board diagnostics with a digital twin, for ball-on-plate rigs.
///
/// A device streams commands and measured positions; a physical model of the
/// rig, its twin, runs in parallel; deviations are diagnosed as faults of the
/// servos, the ball or the sensor.
#[derive(Debug, Parser)]
#[command(name = "offbd", version, long_version = version::long(), max_term_width = 80)]
#[command(after_help = "Start here:\n  \
    offbd demo --seconds 60\n\n\
    With files:\n  \
    offbd simulate --rig rig.json --reference lissajous -o healthy.csv\n  \
    offbd calibrate --asset rig.json healthy.csv -o calibrated.json\n  \
    offbd simulate --fault x_servo:dead@20 --seed 2 -o sick.csv\n  \
    offbd replay --asset calibrated.json healthy.csv sick.csv\n\n\
    The book's exercises:\n  \
    offbd scene --list\n\n\
    Exit status: 0 success (faults or not), 2 invalid arguments, 3 unusable input,\n\
    4 a fault was found, with --fail-on-fault; 1 any other error.")]
struct Cli {
    #[command(subcommand)]
    command: CliCommand,
    #[command(flatten)]
    logging: LoggingArgs,
    /// Print results and errors only: no remarks, no progress, no logs but errors
    #[arg(short, long, global = true)]
    quiet: bool,
}

#[derive(Debug, Subcommand)]
enum CliCommand {
    #[cfg(feature = "lab")]
    #[command(flatten)]
    Lab(offbd_lab_cli::LabCommand),
    #[cfg(feature = "lab")]
    Demo(demo::DemoArgs),
    Inspect(inspect::InspectArgs),
    Calibrate(calibrate::CalibrateArgs),
    Replay(replay::ReplayArgs),
    Trends(trends::TrendsArgs),
    Export(export::ExportArgs),
    DriveCycle(drive_cycle::DriveCycleArgs),
    Serve(serve::ServeArgs),
    Forward(forward::ForwardArgs),
    Watch(watch::WatchArgs),
    Token(token::TokenArgs),
    Backup(backup::BackupArgs),
    Restore(backup::RestoreArgs),
    Migrate(serve::MigrateArgs),
    Check(serve::CheckArgs),
    Completions(completions::CompletionsArgs),
    Man(completions::ManArgs),
}

/// Runs the command line of this process.
#[must_use]
pub fn main() -> ExitCode {
    end_with_essential_threads();
    match parse() {
        Ok(cli) => {
            let report = |error: anyhow::Error| offbd_terminal::report(&error, is_unusable(&error));
            run(cli).map_or_else(report, |()| ExitCode::SUCCESS)
        }
        Err(error) => usage::print(error),
    }
}

/// Whether the configuration, or the store that it names, stays unusable for this program.
fn is_unusable(error: &anyhow::Error) -> bool {
    error.is::<ConfigError>() || error.downcast_ref().is_some_and(StoreError::is_newer)
}

/// Parses the arguments of this process.
fn parse() -> Result<Cli, clap::Error> {
    let mut command = help::grouped(Cli::command());
    let matches = command.try_get_matches_from_mut(std::env::args_os())?;
    Cli::from_arg_matches(&matches).map_err(|error| error.format(&mut command))
}

fn run(cli: Cli) -> anyhow::Result<()> {
    let mut logging = cli.logging;
    if cli.quiet {
        output::be_quiet();
        logging.only_errors();
    }
    match &cli.command {
        // Starts logging itself, as its configuration says.
        CliCommand::Serve(_) => {}
        #[cfg(feature = "lab")]
        CliCommand::Demo(_) => {
            let level = "warn".to_owned();
            serve::start_logging(&logging, &LogConfig { level, ..LogConfig::default() }, None);
        }
        _ => serve::start_logging(&logging, &LogConfig::default(), None),
    }
    match cli.command {
        #[cfg(feature = "lab")]
        CliCommand::Lab(command) => command.run(),
        #[cfg(feature = "lab")]
        CliCommand::Demo(args) => demo::run(&args),
        CliCommand::Inspect(args) => inspect::run(&args),
        CliCommand::Calibrate(args) => calibrate::run(&args),
        CliCommand::Replay(args) => replay::run(&args),
        CliCommand::Trends(args) => trends::run(&args),
        CliCommand::Export(args) => export::run(&args),
        CliCommand::DriveCycle(args) => drive_cycle::run(&args),
        CliCommand::Serve(args) => serve::serve(&args, &logging),
        CliCommand::Forward(args) => forward::run(&args),
        CliCommand::Watch(args) => watch::run(&args),
        CliCommand::Token(args) => token::run(&args),
        CliCommand::Backup(args) => backup::backup(&args),
        CliCommand::Restore(args) => backup::restore(&args),
        CliCommand::Migrate(args) => serve::migrate(&args),
        CliCommand::Check(args) => serve::check(&args),
        CliCommand::Completions(args) => completions::completions(&args),
        CliCommand::Man(args) => completions::man(&args),
    }
}

/// Makes a panic end the process at once, where it would be taken for something else:
///
/// - on the main thread, which panics in tokio if the system refuses one of the runtime's
///   threads; tokio then waits for the others for ever;
/// - on a thread of an SQLite connection, on which sqlx panics without memory for a value.
///   The rows that it had not sent yet are missing, as if the query had none.
///
/// A panic that means that an imported file is damaged is not reported: the reader's error is.
fn end_with_essential_threads() {
    let main = std::thread::current().id();
    let report = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if offbd_wire::session_file::is_guarded() {
            return;
        }
        report(panic);
        let thread = std::thread::current();
        let is_sqlite = thread.name().is_some_and(|name| name.starts_with(SQLITE_THREAD));
        if is_sqlite || thread.id() == main {
            std::process::exit(101);
        }
    }));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the texts below the help of a command and of its subcommands.
    fn texts(command: &clap::Command) -> Vec<String> {
        let own = command.get_after_help().map(ToString::to_string);
        own.into_iter().chain(command.get_subcommands().flat_map(texts)).collect()
    }

    #[test]
    fn lines_of_the_help_that_are_broken_by_hand_fit_in_eighty_columns() {
        for text in texts(&Cli::command()) {
            // A paragraph that is one line is broken where it has to be.
            for lines in text.split("\n\n").map(|part| part.lines().collect::<Vec<_>>()) {
                let wide = lines.iter().find(|line| lines.len() > 1 && line.chars().count() > 80);
                assert_eq!(wide, None);
            }
        }
    }
}
