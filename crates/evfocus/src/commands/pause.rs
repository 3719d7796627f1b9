//! `evfocus pause` and `evfocus resume`: whether continuous mode may start runs.

use std::io::Write;

use clap::Args;
use evfocus_ipc::PauseWhen;
use serde_json::json;

use crate::arguments::SocketArguments;
use crate::connection::{block_on, connect};
use crate::exit::Exit;
use crate::output::Output;

/// Keep continuous mode from starting focus runs, until evfocus resume
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  evfocus pause                a run under way is aborted
  evfocus pause --deferred     a run under way comes to its end first

evfocus focus works all the same. Only mode continuous can be paused.")]
pub struct Arguments {
    /// Let a run under way come to its end
    #[arg(long)]
    deferred: bool,
    #[command(flatten)]
    socket: SocketArguments,
}

/// Let continuous mode start focus runs again
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  evfocus resume

If focus is not known where the lens stands, a run starts at once.")]
pub struct ResumeArguments {
    #[command(flatten)]
    socket: SocketArguments,
}

/// Pauses.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    let when = if arguments.deferred { PauseWhen::Deferred } else { PauseWhen::Immediate };
    block_on(async { Ok(connect(&arguments.socket).await?.pause(when).await?) })?;
    let said = if arguments.deferred { "paused once no run is under way" } else { "paused" };
    tell(&arguments.socket, said)
}

/// Goes on.
pub fn resume(arguments: &ResumeArguments) -> anyhow::Result<Exit> {
    block_on(async { Ok(connect(&arguments.socket).await?.resume().await?) })?;
    tell(&arguments.socket, "resumed")
}

fn tell(socket: &SocketArguments, said: &str) -> anyhow::Result<Exit> {
    let mut out = Output::new();
    if socket.json {
        out.json(&json!({ "continuous": said }))?;
    } else {
        writeln!(out, "continuous mode {said}")?;
    }
    Ok(Exit::Done)
}
