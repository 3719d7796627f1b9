//! The command line of evfocus: what a person or a script at the rig types.
//!
//! - [`cli`] is the command line itself; [`commands`] has one file for each subcommand.
//! - [`arguments`] has what several of them take.
//! - `recording` analyzes a sweep on disk with the daemon's own code; `simulation` makes one.
//! - `files` looks at the files that are named; `output` is standard output.
//! - `plot` draws focus curves as SVG, `curve_view` in a terminal.
//!
//! Not its job: focusing. The daemon does that, and [`evfocus_core`] knows how.

pub mod arguments;
pub mod cli;
pub mod commands;
pub mod exit;
pub mod output;

mod connection;
mod curve_view;
mod files;
mod plot;
mod quantity;
mod recording;
mod report_text;
mod simulation;

use std::process::ExitCode;

use clap::Parser;

use cli::Cli;
use exit::Exit;

/// Runs the command that the program's arguments name.
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            let exit = if error.use_stderr() { Exit::Usage } else { Exit::Done };
            // Help that nobody reads to the end is no failure.
            drop(error.print());
            return exit.into();
        }
    };
    match cli.run() {
        Ok(exit) => exit.into(),
        Err(error) => {
            output::report_error(&error);
            Exit::of_error(&error).into()
        }
    }
}
