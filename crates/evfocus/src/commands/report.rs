//! `evfocus report`: how a run went.

use std::path::PathBuf;

use anyhow::Context;
use clap::Args;

use crate::arguments::SocketArguments;
use crate::connection::{block_on, connect};
use crate::exit::Exit;
use crate::output::{Output, warn};
use crate::plot::{FocusMap, FocusPlot};
use crate::report_text;

/// Print the report of a focus run
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  evfocus report
  evfocus report 7 --json | jq '.sweeps[].estimators'
  evfocus report --plot curve.svg --map map.svg

Units: positions in lens counts, rates in events per second, t_us in microseconds of the camera's clock, elapsed_s in seconds.

The exit status says whether the report could be had, not whether the run found focus.")]
pub struct Arguments {
    /// The run's number; the last run if left out
    id: Option<u64>,
    /// Draw the focus curve and every method's answer into this file
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// Draw where each part of the picture is sharp into this file
    #[arg(long, value_name = "FILE.svg")]
    map: Option<PathBuf>,
    #[command(flatten)]
    socket: SocketArguments,
}

/// Prints the report.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    let report = block_on(async { Ok(connect(&arguments.socket).await?.report(arguments.id).await?) })?;
    if let Some(path) = &arguments.plot {
        let mut plot = FocusPlot::new(format!("Run {}", report.run_id));
        plot.add_report(&report);
        plot.write(path).with_context(|| format!("{}: cannot draw the plot", path.display()))?;
    }
    if let Some(path) = &arguments.map {
        match &report.map {
            Some(map) => FocusMap::new(format!("Run {}", report.run_id), map)
                .write(path)
                .with_context(|| format!("{}: cannot draw the map", path.display()))?,
            None => warn(&format!("no --map was drawn into {}: no sweep has a peak", path.display())),
        }
    }
    let mut out = Output::new();
    if arguments.socket.json {
        out.json(&report)?;
    } else {
        report_text::print(&report, &mut out)?;
    }
    Ok(Exit::Done)
}
