//! `evfocus completions`: for shells.

use clap::{Args, CommandFactory};
use clap_complete::Shell;

use crate::arguments::Cli;
use crate::exit::Exit;
use crate::output::Output;

/// Print completions for a shell
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  evfocus completions bash > ~/.local/share/bash-completion/completions/evfocus
  evfocus completions zsh > ~/.zfunc/_evfocus
  evfocus completions fish > ~/.config/fish/completions/evfocus.fish")]
pub struct Arguments {
    /// The shell
    shell: Shell,
}

/// Prints the script.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    // Generation goes through memory, for it gives up on a closed pipe with a panic.
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut Cli::command(), "evfocus", &mut script);
    std::io::Write::write_all(&mut Output::new(), &script)?;
    Ok(Exit::Done)
}
