//! `evfocus mode`: who decides about the lens.

use std::io::Write;

use clap::{Args, ValueEnum};
use evfocus_ipc::Mode;
use serde_json::json;

use crate::arguments::SocketArguments;
use crate::connection::{block_on, connect};
use crate::exit::Exit;
use crate::output::Output;

/// Say who moves the lens: you (manual) or focus runs (auto)
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  evfocus mode manual       focus runs are refused; a run under way is aborted
  evfocus mode auto         evfocus focus works; the lens never moves without it")]
pub struct Arguments {
    /// The new mode
    mode: Choice,
    #[command(flatten)]
    socket: SocketArguments,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Choice {
    /// The lens moves to where it is told
    Manual,
    /// The lens moves when a focus run is started
    Auto,
}

/// Changes the mode.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    let mode = match arguments.mode {
        Choice::Manual => Mode::Manual,
        Choice::Auto => Mode::Auto,
    };
    block_on(async { Ok(connect(&arguments.socket).await?.set_mode(mode).await?) })?;
    let mut out = Output::new();
    if arguments.socket.json {
        out.json(&json!({ "mode": mode }))?;
    } else {
        writeln!(out, "mode {mode}")?;
    }
    Ok(Exit::Done)
}
