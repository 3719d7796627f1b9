//! `evfocus analyze`: find focus in a recorded sweep.

mod json;
mod text;

use std::path::PathBuf;
use std::time::Duration;

use anyhow::Context;
use clap::Args;
use evfocus_core::Method;
use evfocus_record::Format;

use crate::arguments::{choices, duration};
use crate::exit::Exit;
use crate::files::must_differ;
use crate::output::{Output, warn};
use crate::plot::FocusPlot;
use crate::recording::{self, RecordingAnalysis, Request};

/// Find focus in a recorded sweep
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  evfocus analyze sweep.raw --positions lens.csv
  evfocus analyze sweep.raw --positions lens.csv --method er-fixed --interval 65ms
  evfocus analyze sweep.raw --positions lens.csv --plot curve.svg --json | jq .position

The positions file says where the lens was, one sample a line, oldest first:
  t_us,position
  0,220
  1000,221.8
t_us is in microseconds of the camera's clock, position in the lens's own counts. It must cover the recording (10 ms at either \
end may be missing). Where the lens turns round, a new sweep begins; with sweeps in both directions the answer is the mean of \
both, which cancels lag and backlash. Half their difference (delay_us in JSON, as a time) is lag plus backlash, and with methods \
that answer with the first of two humps of events mostly how far those are apart.

Units: positions in lens counts, times in microseconds of the camera's clock (t_us), rates in events per second.

Exit status: 0 focused, 1 an error, 2 wrong usage, 3 no focus found (the reason is named).")]
pub struct Arguments {
    /// The recording: Prophesee RAW (EVT3, EVT2), AEDAT4, CSV or DAVIS346 USB words
    recording: PathBuf,
    /// Where the lens was: CSV with the header t_us,position (microseconds, lens counts)
    #[arg(long, value_name = "FILE.csv")]
    positions: PathBuf,
    /// Focus measure and search
    #[arg(long, value_name = "NAME", default_value = "egs", value_parser = choices(&Method::ALL, Method::name))]
    method: Method,
    /// Accumulation interval of er-fixed, with its unit: 55ms, 0.055s
    #[arg(long, value_name = "DURATION", default_value = "55ms", value_parser = duration)]
    interval: Duration,
    /// Read the recording as this format instead of recognising it by its content
    #[arg(long, value_name = "NAME", value_parser = choices(&Format::ALL, Format::name))]
    format: Option<Format>,
    /// Print one JSON object instead of text
    #[arg(long)]
    json: bool,
    /// Draw the focus curves and every method's answer into this file
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
}

/// Analyzes the recording and prints what was found.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    let request = Request {
        recording: arguments.recording.clone(),
        positions: arguments.positions.clone(),
        format: arguments.format,
        method: arguments.method,
        interval: arguments.interval,
    };
    if let Some(plot) = &arguments.plot {
        let (recording, positions) = (&request.recording, &request.positions);
        must_differ(&[("the recording", recording), ("--plot", plot)])?;
        must_differ(&[("--positions", positions), ("--plot", plot)])?;
    }
    let analysis = recording::analyze(&request)?;
    for warning in &analysis.warnings {
        warn(warning);
    }
    if let Some(path) = &arguments.plot {
        let plot = plot_of(&analysis, arguments);
        plot.write(path).with_context(|| format!("{}: cannot draw the plot", path.display()))?;
    }
    let mut out = Output::new();
    if arguments.json {
        out.json(&json::Analysis::of(&analysis, &request))?;
    } else {
        text::print(&analysis, &mut out)?;
    }
    Ok(Exit::of_run(analysis.verdict.outcome.is_ok()))
}

fn plot_of(analysis: &RecordingAnalysis, arguments: &Arguments) -> FocusPlot {
    let name = arguments.recording.file_name().map(|name| name.to_string_lossy().into_owned());
    let mut plot = FocusPlot::new(name.unwrap_or_default());
    for sweep in &analysis.sweeps {
        plot.add_sweep(&sweep.report);
    }
    if let Ok(answer) = &analysis.verdict.outcome {
        plot.set_answer(answer.position, analysis.method);
    }
    plot
}
