//! `evfocus reload`: the daemon reads its configuration anew.

use std::io::Write;

use clap::Args;
use serde_json::json;

use crate::arguments::SocketArguments;
use crate::connection::{block_on, connect};
use crate::exit::Exit;
use crate::output::Output;

/// Have the daemon read its configuration anew, as SIGHUP does
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  evfocus reload            says what holds now and what waits for a restart

[focus], [access], lens.backlash_counts and daemon.reports_kept can be changed while running; a run under way ends with what it \
began with. If the file is not good, nothing changes and the exit status is 1.")]
pub struct Arguments {
    #[command(flatten)]
    socket: SocketArguments,
}

/// Reloads.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    let reloaded = block_on(async { Ok(connect(&arguments.socket).await?.reload().await?) })?;
    let mut out = Output::new();
    if arguments.socket.json {
        let (applied, needs_restart) = (reloaded.applied, reloaded.needs_restart);
        out.json(&json!({ "applied": applied, "needs_restart": needs_restart }))?;
        return Ok(Exit::Done);
    }
    let list = |names: &[String]| if names.is_empty() { "nothing".to_owned() } else { names.join(", ") };
    writeln!(out, "changed        {}", list(&reloaded.applied))?;
    if !reloaded.needs_restart.is_empty() {
        writeln!(out, "needs restart  {}", list(&reloaded.needs_restart))?;
    }
    Ok(Exit::Done)
}
