//! Writes the page of the book about the command line from its help. Only for the test, which
//! compares both.

use clap::{Arg, Command, CommandFactory};

use super::Cli;
use super::help::GROUPS;
use crate::config::manual::compare;

const PAGE: &str = "docs/operations/cli.md";

const HEAD: &str = "# Command line\n\n\
    All commands and options of a program with all features, as `offbd --help` and `man offbd` have \
    them.\n\
    `UPDATE_MANUAL=1 cargo test --all-features --lib cli` writes this page from the program.\n\n";

fn page() -> String {
    let mut root = Cli::command();
    root.build();
    let mut text = HEAD.to_owned() + "## All commands\n\n";
    text += &options(root.get_arguments());
    text += &code(&root.get_after_help().map(ToString::to_string).unwrap_or_default());
    for (title, names) in GROUPS {
        text += &format!("## {title}\n\n");
        for command in names.iter().filter_map(|name| root.find_subcommand(name)) {
            text += &section(command, "###");
        }
    }
    text.trim_end().to_owned() + "\n"
}

/// A command, with its own subcommands.
fn section(command: &Command, level: &str) -> String {
    let mut command = command.clone();
    let about = command.get_long_about().or(command.get_about());
    let about = about.map(ToString::to_string).unwrap_or_default();
    let usage = command.render_usage().to_string();
    let name = command.get_bin_name().unwrap_or_default();
    let mut text =
        format!("{level} {}\n\n{}\n\n", name.trim_start_matches("offbd "), plain(&about));
    text += &code(usage.trim_start_matches("Usage: "));
    text += &options(command.get_arguments().filter(|arg| !arg.is_global_set()));
    text += &code(&command.get_after_help().map(ToString::to_string).unwrap_or_default());
    for sub in command.get_subcommands().filter(|sub| sub.get_name() != "help") {
        text += &section(sub, "####");
    }
    text
}

fn options<'a>(arguments: impl Iterator<Item = &'a Arg>) -> String {
    let is_shown =
        |arg: &&Arg| !arg.is_hide_set() && !["help", "version"].contains(&arg.get_id().as_str());
    let rows: Vec<String> = arguments.filter(is_shown).map(row).collect();
    if rows.is_empty() {
        return String::new();
    }
    format!("| option | default | meaning |\n| --- | --- | --- |\n{}\n", rows.concat())
}

fn row(arg: &Arg) -> String {
    let takes_value = arg.is_positional() || arg.get_action().takes_values();
    let names: Vec<String> =
        arg.get_value_names().unwrap_or_default().iter().map(|name| format!("<{name}>")).collect();
    let names = if takes_value { names.join(" ") } else { String::new() };
    let flags =
        [arg.get_short().map(|c| format!("-{c}")), arg.get_long().map(|l| format!("--{l}"))];
    let flags: Vec<String> = flags.into_iter().flatten().collect();
    let option = format!("{} {names}", flags.join(", "));
    let default: Vec<_> = arg.get_default_values().iter().map(|v| v.to_string_lossy()).collect();
    let default = match takes_value && !default.is_empty() {
        true => format!("`{}`", default.join(" ")),
        false => String::new(),
    };
    let help = arg.get_long_help().or(arg.get_help()).map(ToString::to_string).unwrap_or_default();
    let values: Vec<String> = arg
        .get_possible_values()
        .iter()
        .filter(|value| !value.is_hide_set())
        .map(|value| format!("`{}`", value.get_name()))
        .collect();
    let values = match takes_value && !values.is_empty() {
        true => format!(": {}", values.join(", ")),
        false => String::new(),
    };
    let meaning = plain(&help).split_whitespace().collect::<Vec<_>>().join(" ");
    format!("| `{}` | {default} | {}{values} |\n", option.trim(), meaning.replace('|', "\\|"))
}

/// Text that Markdown shows as it is.
fn plain(text: &str) -> String {
    let parts = text.trim().split('`').enumerate();
    let parts =
        parts.map(|(i, part)| if i % 2 == 0 { part.replace('<', "\\<") } else { part.to_owned() });
    parts.collect::<Vec<_>>().join("`")
}

fn code(text: &str) -> String {
    let text = text.trim();
    if text.is_empty() { String::new() } else { format!("```text\n{text}\n```\n\n") }
}

#[test]
fn the_page_about_the_command_line_is_the_help_of_the_program() {
    compare(PAGE, |_| page());
}
