//! The words of the help that clap itself adds.

use clap::Command;

/// What the command `help` does.
pub const HELP: &str = "Prints the help of the program or of a command";

/// Builds `command` and describes its command `help`, and those of its subcommands, as the other
/// commands are described.
#[must_use]
pub fn described(mut command: Command) -> Command {
    command.build();
    with_words(command)
}

fn with_words(command: Command) -> Command {
    let names: Vec<String> =
        command.get_subcommands().map(|sub| sub.get_name().to_owned()).collect();
    names.into_iter().fold(command, |command, name| {
        command.mut_subcommand(name, |sub| match sub.get_name() {
            "help" => sub.about(HELP),
            _ => with_words(sub),
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_help_of_nested_commands_is_described_like_the_others() {
        let inner = Command::new("inner").subcommand(Command::new("list").about("Lists them"));
        let mut command = described(Command::new("outer").subcommand(inner));
        let inner = command.find_subcommand_mut("inner").unwrap();
        let help = inner.render_long_help().to_string();
        assert!(help.contains(HELP) && !help.contains("Print this message"), "{help}");
        let args = ["outer", "inner", "list"];
        assert!(command.try_get_matches_from_mut(args).is_ok(), "it still parses");
    }
}
