//! `evfocus man`: manual pages, for those who make packages.

use std::path::PathBuf;

use anyhow::Context;
use clap::{Args, Command, CommandFactory};

use crate::exit::Exit;

/// Write the manual pages of evfocus and evfocusd
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  evfocus man man1          man1/evfocus.1, man1/evfocus-focus.1, ..., man1/evfocusd.1")]
pub struct Arguments {
    /// The folder for them, which must be there
    folder: PathBuf,
}

/// Writes the pages of `command` and of the daemon.
pub fn run(arguments: &Arguments, command: Command) -> anyhow::Result<Exit> {
    let folder = &arguments.folder;
    for command in [command, evfocusd::arguments::Arguments::command()] {
        clap_mangen::generate_to(command, folder)
            .with_context(|| format!("cannot write manual pages to {}", folder.display()))?;
    }
    Ok(Exit::Done)
}
