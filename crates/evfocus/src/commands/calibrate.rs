//! `evfocus calibrate`: measure what is attached.

use std::io::Write;

use anyhow::bail;
use clap::{Args, Subcommand};
use evfocus_ipc::Calibration;

use crate::arguments::SocketArguments;
use crate::connection::{block_on, connect};
use crate::exit::Exit;
use crate::output::{Output, warn};
use crate::report_text;

/// Measure the rig's devices; what was measured is counted on from then on
#[derive(Debug, Args)]
#[command(arg_required_else_help = true)]
pub struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    Lens(LensArguments),
}

/// Measure the lens: range, speed, read-back, latency, stopping, and play
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  evfocus calibrate lens
  evfocus calibrate lens --json | jq .backlash

The lens goes from one end of its limits (lens.min_counts to lens.max_counts) to the other and back, is stopped once on its way, and \
returns to where it was. Then two slow focus runs tell its play from what the pixels are late by: let the camera see something with \
structure, and do not move it. Without that everything but the play is measured. Expect one to two minutes.

If an end of the lens's way lies within its limits, it runs into it. A lens that reads its position (firmata, labjack) finds the \
end and keeps away from it from then on. With limit switches (grbl) the controller locks itself. One that counts steps (moonlite, most \
behind indi) slips and counts on: then up and down disagree in the picture, and nothing is kept. An optotune lens does not tell \
where it is: that it sticks is not seen, except that nothing comes into focus.

What was measured is kept in the daemon's state directory for this lens, and every run counts on it; evfocus status and evfocus \
report show it. lens.backlash_counts in the configuration counts before what was measured.

Ctrl-C stops the lens where it is. If the command is killed, the calibration goes on; evfocus abort stops it.

Units: counts of the lens, counts per second, microseconds in JSON.")]
struct LensArguments {
    #[command(flatten)]
    socket: SocketArguments,
}

/// Calibrates.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    let What::Lens(arguments) = &arguments.what;
    let calibration = block_on(calibrate(&arguments.socket))?;
    let mut out = Output::new();
    if arguments.socket.json {
        out.json(&calibration)?;
    } else {
        report_text::print_calibration(&calibration, &mut out)?;
        for note in &calibration.notes {
            writeln!(out, "note: {note}")?;
        }
    }
    Ok(Exit::Done)
}

async fn calibrate(socket: &SocketArguments) -> anyhow::Result<Calibration> {
    let mut client = connect(socket).await?;
    if !socket.json {
        warn("the lens goes over its whole range now; Ctrl-C stops it");
    }
    let mut calibration = std::pin::pin!(client.calibrate());
    let mut aborted = false;
    loop {
        tokio::select! {
            measured = &mut calibration => return Ok(measured?),
            signal = tokio::signal::ctrl_c() => {
                signal?;
                if aborted {
                    bail!("left at the second Ctrl-C; evfocus status tells whether the lens has stopped");
                }
                aborted = true;
                connect(socket).await?.abort().await?;
            }
        }
    }
}
