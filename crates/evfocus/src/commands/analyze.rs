//! `evfocus analyze`: find focus in a recorded sweep.

mod json;
mod text;

use std::path::PathBuf;
use std::time::Duration;

use anyhow::Context;
use clap::Args;
use evfocus_core::{Method, Prefer};
use evfocus_ipc::FocusWindow;
use evfocus_record::Format;
use evfocusd::parts_report;

use crate::arguments::{choices, duration, window};
use crate::exit::Exit;
use crate::files::must_differ;
use crate::output::{Output, warn};
use crate::plot::{FocusMap, FocusPlot};
use crate::recording::{self, RecordingAnalysis, Request};

/// Find focus in a recorded sweep
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  evfocus analyze sweep.raw --positions lens.csv
  evfocus analyze sweep.raw --positions lens.csv --window 0.4,0.4,0.2,0.2 --map map.svg
  evfocus analyze sweep.raw --positions lens.csv --method er-fixed --interval 65ms
  evfocus analyze sweep.raw --positions lens.csv --plot curve.svg --json | jq .position

The positions file says where the lens was, one sample a line, oldest first:
  t_us,position
  0,220
  1000,221.8
t_us is in microseconds of the camera's clock, position in the lens's own counts. It must cover the recording (10 ms at either \
end may be missing). Where the lens turns round, a new sweep begins; with sweeps in both directions the answer is the mean of \
both, each weighted by how sure it is, which cancels the lag. Half their difference (delay_us in JSON, as a time) is lag plus backlash, and with methods \
that answer with the first of two humps of events mostly how far those are apart.

The answer comes with one standard deviation (±) and the probability that it is right to within 1 % of the range.

Units: positions in lens counts, times in microseconds of the camera's clock (t_us), rates in events per second.

Exit status: 0 focused, 1 an error, 2 wrong usage, 3 no focus found (the reason is named).")]
pub struct Arguments {
    /// The recording: Prophesee RAW (EVT3, EVT2), AEDAT4, CSV or DAVIS346 USB words
    recording: PathBuf,
    /// Where the lens was: CSV with the header t_us,position (microseconds, lens counts)
    #[arg(long, value_name = "FILE.csv")]
    positions: PathBuf,
    /// Focus measure and search
    #[arg(long, value_name = "NAME", default_value = "auto", value_parser = choices(&Method::ALL, Method::name))]
    method: Method,
    /// Accumulation interval of er-fixed, with its unit: 55ms, 0.055s
    #[arg(long, value_name = "DURATION", default_value = "55ms", value_parser = duration)]
    interval: Duration,
    /// A window of the picture to focus on, instead of the whole; up to eight times. Whole numbers are pixels, with a decimal point
    /// or a % they are parts of the picture
    #[arg(long = "window", value_name = "X,Y,W,H", value_parser = window, allow_hyphen_values = true)]
    windows: Vec<FocusWindow>,
    /// Which of several windows or depths counts: strongest, nearest (higher positions are nearer), or the number of a window, counted
    /// from 0
    #[arg(long, value_name = "WHICH", default_value = "strongest", allow_negative_numbers = true)]
    prefer: Prefer,
    /// Read the recording as this format instead of recognising it by its content
    #[arg(long, value_name = "NAME", value_parser = choices(&Format::ALL, Format::name))]
    format: Option<Format>,
    /// Print one JSON object instead of text
    #[arg(long)]
    json: bool,
    /// Draw the focus curves and every method's answer into this file
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// Draw where each part of the picture is sharp into this file: tilt and depth at a glance
    #[arg(long, value_name = "FILE.svg")]
    map: Option<PathBuf>,
}

/// Analyzes the recording and prints what was found.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    let request = Request {
        recording: arguments.recording.clone(),
        positions: arguments.positions.clone(),
        format: arguments.format,
        method: arguments.method,
        interval: arguments.interval,
        windows: arguments.windows.clone(),
        prefer: arguments.prefer,
    };
    let pictures = [("--plot", &arguments.plot), ("--map", &arguments.map)];
    for (option, picture) in pictures.iter().filter_map(|(option, path)| Some((*option, path.as_ref()?))) {
        must_differ(&[("the recording", &request.recording), (option, picture)])?;
        must_differ(&[("--positions", &request.positions), (option, picture)])?;
    }
    if let Some((plot, map)) = arguments.plot.as_ref().zip(arguments.map.as_ref()) {
        must_differ(&[("--plot", plot), ("--map", map)])?;
    }
    let analysis = recording::analyze(&request)?;
    for warning in &analysis.warnings {
        warn(warning);
    }
    if let Some(path) = &arguments.plot {
        let plot = plot_of(&analysis, arguments);
        plot.write(path).with_context(|| format!("{}: cannot draw the plot", path.display()))?;
    }
    if let Some(path) = &arguments.map {
        match analysis.verdict.map.as_ref().map(parts_report::map) {
            Some(map) => {
                FocusMap::new(title(arguments), &map)
                    .write(path)
                    .with_context(|| format!("{}: cannot draw the map", path.display()))?;
            }
            None => warn(&format!("no --map was drawn into {}: no sweep has a peak", path.display())),
        }
    }
    let mut out = Output::new();
    if arguments.json {
        out.json(&json::Analysis::of(&analysis, &request))?;
    } else {
        text::print(&analysis, &mut out)?;
    }
    Ok(Exit::of_run(analysis.verdict.outcome.is_ok()))
}

/// The recording's name.
fn title(arguments: &Arguments) -> String {
    arguments.recording.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

fn plot_of(analysis: &RecordingAnalysis, arguments: &Arguments) -> FocusPlot {
    let mut plot = FocusPlot::new(title(arguments));
    for sweep in &analysis.sweeps {
        plot.add_sweep(&sweep.report);
    }
    if let Ok(answer) = &analysis.verdict.outcome {
        plot.set_answer(answer.position, analysis.method);
    }
    plot
}
