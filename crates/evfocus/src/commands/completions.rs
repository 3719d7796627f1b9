//! `evfocus completions`: for shells.

use clap::{Args, Command};
use clap_complete::Shell;

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

/// Prints the script that completes `command`.
pub fn run(arguments: &Arguments, command: &mut Command) -> anyhow::Result<Exit> {
    // Generation goes through memory, for it gives up on a closed pipe with a panic.
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, command, "evfocus", &mut script);
    std::io::Write::write_all(&mut Output::new(), &script)?;
    Ok(Exit::Done)
}
