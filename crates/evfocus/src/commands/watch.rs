//! `evfocus watch`: the status as it changes.

use std::io::Write;

use clap::Args;
use evfocus_ipc::Status;

use crate::arguments::SocketArguments;
use crate::connection::{block_on, connect};
use crate::exit::Exit;
use crate::output::Output;
use crate::quantity::rate;

/// Print the status whenever it changes, and once a second
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  evfocus watch
  evfocus watch --json | jq --unbuffered .event_rate

A line at once for every change of mode, state, run, devices or fault; at most ten a second while only the lens position changes; \
one a second while nothing does but the event rate.

Ends with Ctrl-C, when nobody reads the output any more, or with an error when the daemon goes away.

Units: lens positions in counts, event rates in events per second. With --json every line is one JSON object, the same as that \
of evfocus status --json.")]
pub struct Arguments {
    #[command(flatten)]
    socket: SocketArguments,
}

/// Prints until nobody looks.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    let mut out = Output::new();
    block_on(async {
        let mut changes = connect(&arguments.socket).await?.monitor().await?;
        while let Some(status) = changes.next().await? {
            if arguments.socket.json {
                out.json_line(&status)?;
            } else {
                print(&status, &mut out)?;
            }
            if out.is_closed() {
                break;
            }
        }
        Ok(Exit::Done)
    })
}

fn print(status: &Status, out: &mut Output) -> anyhow::Result<()> {
    let run = status.run_id.map(|id| format!(" run {id} {}", status.phase)).unwrap_or_default();
    let fault = status.fault.as_ref().map(|fault| format!("; fault: {fault}")).unwrap_or_default();
    writeln!(
        out,
        "{:<6} {}{run}; lens at {}; {}{fault}",
        status.mode,
        status.state,
        super::status::position(status),
        rate(status.event_rate)
    )?;
    Ok(out.flush()?)
}
