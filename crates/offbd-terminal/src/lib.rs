//! What the commands of offbd share: output, tables, help, logs, errors and
//! their exit codes.

pub mod errors;
pub mod help;
pub mod logging;
pub mod output;
pub mod table;

use std::mem::ManuallyDrop;
use std::process::ExitCode;

/// Runs an asynchronous command to its end, which is that of the process.
///
/// # Errors
/// Those of the command, or if the system refuses a thread.
pub fn block_on<T>(command: impl Future<Output = anyhow::Result<T>>) -> anyhow::Result<T> {
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    // Not dropped: after an error tasks may still run, and some would panic without timers.
    ManuallyDrop::new(runtime).block_on(command)
}

/// Describes `error` and its causes. Some errors of libraries name their cause themselves.
fn with_causes(error: &anyhow::Error) -> String {
    let mut text = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !text.ends_with(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    text
}

/// Prints `error` and returns its exit code: 0 if the reader of stdout has closed it, 2 for
/// invalid arguments, 3 for unusable input (or if the caller knows that it `is_unusable`), 4 for
/// a fault, 1 for any other error.
#[must_use]
pub fn report(error: &anyhow::Error, is_unusable: bool) -> ExitCode {
    if output::is_closed_pipe(error) {
        return ExitCode::SUCCESS;
    }
    anstream::eprintln!("offbd: {}", with_causes(error));
    if error.is::<errors::BadArgument>() {
        return ExitCode::from(2);
    }
    if error.is::<errors::FaultFound>() {
        return ExitCode::from(4);
    }
    ExitCode::from(if is_unusable || error.is::<errors::InputError>() { 3 } else { 1 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cause_that_an_error_names_itself_is_not_repeated() {
        let error = anyhow::anyhow!("no file").context("database: no file").context("store");
        assert_eq!(with_causes(&error), "store: database: no file");
        let error = anyhow::anyhow!("no file").context("store");
        assert_eq!(with_causes(&error), "store: no file");
    }
}
