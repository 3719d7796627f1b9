//! `evfocus focus`: start a run and follow it.

use std::time::Duration;

use anyhow::bail;
use clap::Args;
use clap::builder::PossibleValuesParser;
use evfocus_core::controller::Pace;
use evfocus_core::{LensSpeed, Prefer};
use evfocus_ipc::client::{ClientError, Following};
use evfocus_ipc::{Error, FocusRequest, FocusWindow, LensRange, Phase, Progress, Report, State};

use crate::arguments::{SocketArguments, duration, position, speed, window};
use crate::connection::{block_on, connect};
use crate::curve_view::{CurveFrame, CurveView};
use crate::exit::{Exit, UsageError};
use crate::output::{Output, warn};
use crate::report_text;

/// Focus: sweep the lens, find the sharpest position, go there
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  evfocus focus
  evfocus focus --speed fast
  evfocus focus --window 0.4,0.4,0.2,0.2
  evfocus focus --window 100,80,60,40 --window 200,80,60,40 --prefer nearest
  evfocus focus --from 1500 --to 2500 --sweep-speed 800
  evfocus focus --method er-fixed --interval 65ms --json | jq .result.position

What is left out is taken from the daemon's configuration. If the same run is already under way, the command follows it.

Units: positions in lens counts, sweep speeds in counts per second, intervals with their unit (55ms, 0.055s), windows in pixels \
from the upper left corner, or in parts of the picture if written with a decimal point or a % (0.4,0.4,0.2,0.2 or 40%,40%,20%,20%).

The result is told with one standard deviation (±) and the probability that it is right to within the depth of focus, or 1 % of \
the range if that is more.

On a terminal the focus curve is drawn while the lens sweeps. Ctrl-C aborts the run: the lens stops where it is. A second \
Ctrl-C leaves at once. If the command is killed or loses its connection, the run goes on; evfocus abort stops it.

Exit status: 0 focused, 1 an error, 2 wrong usage, 3 the run ended without focus.")]
pub struct Arguments {
    /// Focus measure and search: auto, structure, mirror-pairs, egs, egs-official, er-fixed, er-squared
    #[arg(long, value_name = "NAME")]
    method: Option<String>,
    /// How thorough: fast (one sweep, which ends beyond the peak, if that is sure enough), normal (and back over the peak) or accurate
    /// (the whole range, both ways)
    #[arg(long, value_name = "NAME", value_parser = PossibleValuesParser::new(Pace::ALL.map(Pace::name)))]
    speed: Option<String>,
    /// A window of the picture to focus on, instead of the whole; up to eight times. Whole numbers are pixels, with a decimal point
    /// or a % they are parts of the picture
    #[arg(long = "window", value_name = "X,Y,W,H", value_parser = window, allow_hyphen_values = true)]
    windows: Vec<FocusWindow>,
    /// Which of several windows or depths counts: strongest, nearest, or the number of a window, counted from 0
    #[arg(long, value_name = "WHICH", allow_negative_numbers = true)]
    prefer: Option<Prefer>,
    /// Low end of the sweep, in lens counts
    #[arg(long, value_name = "POSITION", value_parser = position, requires = "to", allow_negative_numbers = true)]
    from: Option<f64>,
    /// High end of the sweep, in lens counts
    #[arg(long, value_name = "POSITION", value_parser = position, requires = "from", allow_negative_numbers = true)]
    to: Option<f64>,
    /// Speed of the sweep, in counts per second
    #[arg(long, value_name = "SPEED", value_parser = speed, allow_negative_numbers = true)]
    sweep_speed: Option<LensSpeed>,
    /// Accumulation interval of er-fixed, with its unit: 55ms, 0.055s
    #[arg(long, value_name = "DURATION", value_parser = duration)]
    interval: Option<Duration>,
    /// Sweep one way only, whatever the speed: lag and backlash are not cancelled
    #[arg(long)]
    one_way: bool,
    #[command(flatten)]
    socket: SocketArguments,
}

impl Arguments {
    fn request(&self) -> FocusRequest {
        FocusRequest {
            method: self.method.clone(),
            range: self.from.zip(self.to).map(|(min, max)| LensRange { min, max }),
            speed: self.speed.clone(),
            speed_counts_per_s: self.sweep_speed.map(LensSpeed::counts_per_second),
            interval_us: self.interval.map(|interval| interval.as_micros() as u64),
            directions: self.one_way.then(|| String::from("forward")),
            windows: self.windows.clone(),
            prefer: self.prefer.map(|prefer| prefer.to_string()),
        }
    }
}

/// Starts a run and follows it to its end.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    if let Some((from, to)) = arguments.from.zip(arguments.to).filter(|(from, to)| from >= to) {
        return Err(UsageError(format!("--from {from} must lie below --to {to}")).into());
    }
    block_on(focus(arguments))
}

async fn focus(arguments: &Arguments) -> anyhow::Result<Exit> {
    let mut out = Output::new();
    let mut client = connect(&arguments.socket).await?;
    let request = arguments.request();
    let draws = out.is_terminal() && !arguments.socket.json;
    let range = if draws { request.range.or(client.status().await?.lens_range) } else { None };
    let mut live = range.map(LiveCurve::new);
    let mut run = client.focus(&request).await?;
    let Some(report) = follow(&mut run, &arguments.socket, live.as_mut(), &mut out).await? else {
        bail!("left at the second Ctrl-C; evfocus status tells whether the run has stopped");
    };
    if arguments.socket.json {
        out.json(&report)?;
    } else {
        report_text::print_outcome(&report, &mut out)?;
    }
    Ok(Exit::of_run(report.result.state == State::Focused))
}

/// Names the options that were typed, where the daemon names the parameters of its interface.
fn in_own_words(error: ClientError) -> anyhow::Error {
    let ClientError::Refused(refused) = &error else { return error.into() };
    let words = if let Error::InvalidArgument { name, remedy, .. } = refused {
        // The remedy has the value in it, in the unit that people write.
        option(name).map(|option| format!("{option}: {remedy}"))
    } else if let Error::OutOfRange { what, value, min, max } = refused {
        option(what).map(|option| format!("{option} is {value}; it must be from {min} to {max}"))
    } else {
        None
    };
    words.map_or_else(|| error.into(), anyhow::Error::msg)
}

/// The option that sets `parameter`.
fn option(parameter: &str) -> Option<&'static str> {
    match parameter {
        "interval_us" => Some("--interval"),
        "method" => Some("--method"),
        "speed" => Some("--speed"),
        "speed_counts_per_s" => Some("--sweep-speed"),
        "windows" => Some("--window"),
        "prefer" => Some("--prefer"),
        "range" => Some("--from and --to"),
        "range start" => Some("--from"),
        "range end" => Some("--to"),
        _ => None,
    }
}

/// News until the run's report; none if the user is too impatient even for an abort.
async fn follow(
    run: &mut Following<Progress>,
    socket: &SocketArguments,
    mut live: Option<&mut LiveCurve>,
    out: &mut Output,
) -> anyhow::Result<Option<Report>> {
    let mut aborted = false;
    loop {
        tokio::select! {
            news = run.next() => {
                let Some(progress) = news.map_err(in_own_words)? else { bail!("evfocusd ended the run without a report") };
                if let Some(live) = live.as_deref_mut() {
                    live.show(&progress, out)?;
                }
                if let Some(report) = progress.report {
                    return Ok(Some(report));
                }
            }
            signal = tokio::signal::ctrl_c() => {
                signal?;
                if aborted {
                    return Ok(None);
                }
                aborted = true;
                warn("aborting the run; Ctrl-C again leaves at once");
                connect(socket).await?.abort().await?;
            }
        }
    }
}

/// The curve of the sweep under way.
struct LiveCurve {
    view: CurveView,
    points: Vec<(f64, f64)>,
    phase: Phase,
}

impl LiveCurve {
    fn new(range: LensRange) -> Self {
        Self { view: CurveView::new(range.min, range.max), points: Vec::new(), phase: Phase::None }
    }

    fn show(&mut self, progress: &Progress, out: &mut Output) -> anyhow::Result<()> {
        if progress.phase == Phase::Returning && self.phase != Phase::Returning {
            self.points.clear();
        }
        self.phase = progress.phase;
        if let Some(point) = progress.curve_point {
            self.points.push((point.position, point.rate));
        }
        let title = format!("run {}: {}", progress.run_id, progress.phase);
        let frame = CurveFrame { points: &self.points, lens: progress.lens_position, title: &title };
        Ok(self.view.draw(frame, out)?)
    }
}
