//! `evfocus abort`: stop the lens.

use std::io::Write;

use clap::Args;
use serde_json::json;

use crate::arguments::SocketArguments;
use crate::connection::{block_on, connect};
use crate::exit::Exit;
use crate::output::Output;

/// Stop the focus run under way, and the lens where it is
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  evfocus abort
  evfocus abort --json

It is not an error if no run is under way. Mode continuous is paused, see evfocus resume. JSON: run_id is the run that was stopped, or null.")]
pub struct Arguments {
    #[command(flatten)]
    socket: SocketArguments,
}

/// Aborts, and says what that stopped.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    let run_id = block_on(async { Ok(connect(&arguments.socket).await?.abort().await?) })?;
    let mut out = Output::new();
    if arguments.socket.json {
        out.json(&json!({ "run_id": run_id }))?;
    } else if let Some(id) = run_id {
        writeln!(out, "run {id} aborted; the lens stops where it is")?;
    } else {
        writeln!(out, "no run was under way; the lens stops where it is")?;
    }
    Ok(Exit::Done)
}
