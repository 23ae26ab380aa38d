//! Messages about wrong arguments: what was probably meant.

use std::process::ExitCode;

use clap::error::{ContextKind, ContextValue, ErrorKind};

/// Prints help, the version, or an error of the arguments.
pub(super) fn print(mut error: clap::Error) -> ExitCode {
    correct_suggestions(&mut error);
    // A closed stdout is not an error of the help.
    let _ = error.print();
    if error.use_stderr() { ExitCode::from(2) } else { ExitCode::SUCCESS }
}

/// Removes suggestions that nobody meant, and adds those that clap cannot know.
fn correct_suggestions(error: &mut clap::Error) {
    if error.kind() == ErrorKind::InvalidSubcommand {
        keep_near_commands(error);
    }
    let invalid = error.get(ContextKind::InvalidArg).map(ToString::to_string);
    if error.kind() == ErrorKind::UnknownArgument && invalid.as_deref() == Some("--json") {
        let meant = ContextValue::String("--format json".to_owned());
        error.insert(ContextKind::SuggestedArg, meant);
        error.remove(ContextKind::Suggested);
    }
}

/// Keeps the suggested subcommands that need few changes: one for each three letters.
fn keep_near_commands(error: &mut clap::Error) {
    let typed = match error.get(ContextKind::InvalidSubcommand) {
        Some(ContextValue::String(typed)) => typed.clone(),
        _ => return,
    };
    let suggested = match error.get(ContextKind::SuggestedSubcommand) {
        Some(ContextValue::Strings(suggested)) => suggested.clone(),
        Some(ContextValue::String(suggested)) => vec![suggested.clone()],
        _ => return,
    };
    let is_near = |word: &String| strsim::osa_distance(&typed, word) <= word.len().div_ceil(3);
    let near: Vec<String> = suggested.into_iter().filter(is_near).collect();
    if near.is_empty() {
        error.remove(ContextKind::SuggestedSubcommand);
        error.remove(ContextKind::Suggested);
    } else {
        error.insert(ContextKind::SuggestedSubcommand, ContextValue::Strings(near));
    }
}
