//! The help of the program: its commands grouped by what one does with them.

use clap::Command;
use offbd_terminal::help::{self, HELP};
use offbd_terminal::table::wrapped;

/// The groups of commands, and the order in which the help has them.
pub(super) const GROUPS: [(&str, &[&str]); 6] = [
    ("Try it", &["demo", "simulate"]),
    ("Look at recordings", &["inspect", "replay", "trends", "export"]),
    ("Calibrate a rig", &["calibrate", "drive-cycle"]),
    (
        "Run the service",
        &["serve", "forward", "watch", "check", "token", "backup", "restore", "migrate"],
    ),
    ("Laboratory", &["scene", "chart", "score", "soak"]),
    ("Shell", &["completions", "man", "help"]),
];

/// Width of the names of commands, characters.
const NAMES: usize = 12;

/// Returns `command` with a help that lists its subcommands in groups.
pub(super) fn grouped(mut command: Command) -> Command {
    let commands = listed(&command);
    let names: Vec<String> =
        command.get_subcommands().map(|sub| sub.get_name().to_owned()).collect();
    for name in names {
        // They are listed above, not once more by clap.
        command = command.mut_subcommand(name, |sub| sub.hide(true));
    }
    let template = format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{commands}\n{{all-args}}{{after-help}}"
    );
    help::described(command.override_usage("offbd [OPTIONS] <COMMAND>").help_template(template))
}

/// Returns the subcommands in their groups, each with what it does.
fn listed(command: &Command) -> String {
    let line = |name: &&str| {
        let about = command.find_subcommand(name).and_then(Command::get_about);
        let about = about.map(ToString::to_string);
        let about = about.or_else(|| (*name == "help").then(|| HELP.to_owned()))?;
        Some(wrapped(&format!("  {name:NAMES$} "), &about) + "\n")
    };
    let group = |(title, names): &(&str, &[&str])| {
        format!("{title}:\n{}", names.iter().filter_map(line).collect::<String>())
    };
    GROUPS.iter().map(group).collect::<Vec<String>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::super::Cli;
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn each_command_is_in_one_group() {
        let mut grouped: Vec<&str> =
            GROUPS.iter().flat_map(|(_, names)| names.iter().copied()).collect();
        let n = grouped.len();
        grouped.sort_unstable();
        grouped.dedup();
        assert_eq!(grouped.len(), n, "a command is in two groups");
        for command in Cli::command().get_subcommands() {
            assert!(grouped.contains(&command.get_name()), "{} is in no group", command.get_name());
        }
    }

    #[test]
    fn the_help_has_each_command_once_and_fits_in_eighty_columns() {
        let help = grouped(Cli::command()).render_long_help().to_string();
        assert!(help.lines().all(|line| line.chars().count() <= 80), "{help}");
        for name in ["serve", "inspect", "help"] {
            let is_line = |line: &&str| line.starts_with(&format!("  {name} "));
            assert_eq!(help.lines().filter(is_line).count(), 1, "{name}: {help}");
        }
    }
}
