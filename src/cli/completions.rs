//! `offbd completions` and `offbd man`: made from the definition of the command line.

use std::io::Write as _;
use std::path::PathBuf;

use anyhow::Context;
use clap::{Args, CommandFactory};
use clap_complete::Shell;

use super::{Cli, output};

/// Prints the completion of commands and options for a shell.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  \
    offbd completions bash > ~/.local/share/bash-completion/completions/offbd\n  \
    offbd completions zsh > ~/.zfunc/_offbd\n  \
    offbd completions fish > ~/.config/fish/completions/offbd.fish")]
pub(super) struct CompletionsArgs {
    /// The shell
    shell: Shell,
}

/// Writes the manual: a page for offbd, and one for each command.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  \
    offbd man -o ~/.local/share/man/man1\n  \
    man offbd-replay")]
pub(super) struct ManArgs {
    /// The directory to write to; created if missing
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

pub(super) fn completions(args: &CompletionsArgs) -> anyhow::Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "offbd", &mut script);
    let mut out = output::stdout();
    out.write_all(&script)?;
    Ok(out.flush()?)
}

pub(super) fn man(args: &ManArgs) -> anyhow::Result<()> {
    let folder = &args.output;
    std::fs::create_dir_all(folder)
        .with_context(|| format!("cannot create {}", folder.display()))?;
    let command = Cli::command().disable_help_subcommand(true);
    clap_mangen::generate_to(command, folder)
        .with_context(|| format!("cannot write to {}", folder.display()))?;
    output::remark(format_args!("the pages are in {}", folder.display()));
    Ok(())
}
