//! `evfocus move`: send the lens somewhere.

use std::io::Write;
use std::time::Duration;

use anyhow::bail;
use clap::Args;
use evfocus_ipc::Status;
use evfocus_ipc::client::Client;
use serde_json::json;

use crate::arguments::{SocketArguments, position};
use crate::connection::{block_on, connect};
use crate::exit::Exit;
use crate::output::Output;

/// Move the lens to a position, in counts
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  evfocus move 1985
  evfocus move --wait 1985.5

The command returns at once, with --wait when the lens has arrived. evfocus status names the positions that the lens accepts. \
Refused while a focus run is under way.

Units: counts of the lens.")]
pub struct Arguments {
    /// Where to, in lens counts
    #[arg(value_parser = position, allow_negative_numbers = true)]
    position: f64,
    /// Return only when the lens stands there
    #[arg(long)]
    wait: bool,
    #[command(flatten)]
    socket: SocketArguments,
}

/// A lens that rests this near to its target, as a share of its range, has arrived.
const NEAR_SHARE: f64 = 0.005;
/// How long the lens may stand still before it starts to move.
const LONGEST_STILL: Duration = Duration::from_secs(3);

/// Moves the lens.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    let arrived = block_on(async {
        let mut client = connect(&arguments.socket).await?;
        client.move_to(arguments.position).await?;
        if arguments.wait { wait(client, arguments.position).await.map(Some) } else { Ok(None) }
    })?;
    let mut out = Output::new();
    if arguments.socket.json {
        out.json(&json!({ "target": arguments.position, "arrived_at": arrived }))?;
    } else if let Some(arrived) = arrived {
        writeln!(out, "the lens is at {arrived:.1} counts")?;
    } else {
        writeln!(out, "the lens goes to {:.1} counts", arguments.position)?;
    }
    Ok(Exit::Done)
}

/// Returns where the lens has come to rest.
async fn wait(client: Client, target: f64) -> anyhow::Result<f64> {
    let mut changes = client.monitor().await?;
    let mut has_moved = false;
    let mut patience = std::pin::pin!(tokio::time::sleep(LONGEST_STILL));
    loop {
        let status = tokio::select! {
            status = changes.next() => status?,
            () = &mut patience, if !has_moved => bail!("the lens does not move; evfocus status may say why"),
        };
        let Some(status) = status else { bail!("evfocusd stopped telling where the lens is") };
        has_moved |= status.lens_moving;
        if let Some(position) = arrival(&status, target, has_moved)? {
            return Ok(position);
        }
    }
}

/// Where the lens has come to rest, if it has; an error if it will not any more. A fault that is not the lens's, such as a full
/// disk, does not stop it.
fn arrival(status: &Status, target: f64, has_moved: bool) -> anyhow::Result<Option<f64>> {
    if status.lens.is_none() {
        bail!("the lens did not arrive: {}", status.fault.as_deref().unwrap_or("there is no lens any more"));
    }
    let Some(position) = status.lens_position.filter(|_| !status.lens_moving) else { return Ok(None) };
    let tolerance = status.lens_range.map_or(1.0, |range| NEAR_SHARE * (range.max - range.min));
    if (position - target).abs() <= tolerance {
        return Ok(Some(position));
    }
    if has_moved {
        bail!("the lens stands at {position:.1} counts, not at {target:.1}; evfocus status may say why");
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(position: f64) -> Status {
        Status { lens: Some(String::from("a lens")), lens_position: Some(position), ..Status::default() }
    }

    #[test]
    fn only_a_fault_of_the_lens_ends_the_wait() {
        let full = Some(String::from("the disk is full"));
        let moving = Status { fault: full.clone(), lens_moving: true, ..at(500.0) };
        assert_eq!(arrival(&moving, 400.0, true).unwrap(), None);
        assert_eq!(arrival(&Status { fault: full.clone(), ..at(400.0) }, 400.0, true).unwrap(), Some(400.0));
        let gone = Status { lens: None, fault: full, ..moving };
        assert!(arrival(&gone, 400.0, true).unwrap_err().to_string().contains("the disk is full"));
    }

    #[test]
    fn a_lens_that_stops_short_has_not_arrived_and_one_that_has_not_started_may_yet() {
        assert!(arrival(&at(500.0), 400.0, true).unwrap_err().to_string().contains("500.0"));
        assert_eq!(arrival(&at(500.0), 400.0, false).unwrap(), None);
    }
}
