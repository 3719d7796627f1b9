//! `evfocus mode`: who decides about the lens.

use std::io::Write;

use clap::{Args, ValueEnum};
use evfocus_ipc::Mode;
use serde_json::json;

use crate::arguments::SocketArguments;
use crate::connection::{block_on, connect};
use crate::exit::Exit;
use crate::output::Output;

/// Say who moves the lens: you (manual), focus runs (auto), or evfocus by itself too (continuous)
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  evfocus mode manual       focus runs are refused; a run under way is aborted
  evfocus mode auto         evfocus focus works; the lens never moves without it
  evfocus mode continuous   focus runs start by themselves when the picture has lost its sharpness; see evfocus pause")]
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
    /// The lens moves also when focus is not known or lost
    Continuous,
}

/// Changes the mode.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    let mode = match arguments.mode {
        Choice::Manual => Mode::Manual,
        Choice::Auto => Mode::Auto,
        Choice::Continuous => Mode::Continuous,
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
