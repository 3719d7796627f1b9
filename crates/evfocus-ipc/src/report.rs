//! The report of a focus run: the same JSON on the socket and in the report file.

use serde::{Deserialize, Serialize};

use crate::{FocusRequest, Phase, State};

/// The value of [`Report::format`] that this version writes. It grows only when a field changes its meaning or goes away;
/// new fields do not count, readers ignore what they do not know.
pub const REPORT_FORMAT: u64 = 1;

/// Everything about one run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// The version of this format, [`REPORT_FORMAT`].
    pub format: u64,
    /// The run's number.
    pub run_id: u64,
    /// When it started, in seconds since 1970 (UTC).
    pub started_unix_s: f64,
    /// How long it took, in seconds.
    pub elapsed_s: f64,
    /// What was asked for, with the daemon's defaults filled in.
    pub request: FocusRequest,
    /// What it was done with.
    pub devices: RunDevices,
    /// How it ended.
    pub result: Outcome,
    /// The sweeps, in order.
    pub sweeps: Vec<Sweep>,
    /// Half the difference of the two directions' answers, as a time at the sweep's speed, in microseconds: lag plus
    /// backlash. Nothing without two answers.
    pub delay_us: Option<f64>,
    /// Hot pixels that were left out.
    pub hot_pixels: u64,
    /// The relation of the camera's clock to the host's; nothing if the run ended before one was known.
    pub clock_map: Option<ClockMap>,
    /// The events of the run.
    pub events: EventCounts,
    /// How long each phase took, in order.
    pub timings: Vec<PhaseTiming>,
    /// What was odd but did not make the run fail, one sentence each.
    pub warnings: Vec<String>,
}

/// The devices and the program of a run.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct RunDevices {
    /// The camera, model and serial.
    pub camera: String,
    /// The lens, model and serial.
    pub lens: String,
    /// The daemon's version.
    pub version: String,
}

/// How a run ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// [`State::Focused`], [`State::Failed`], or [`State::Idle`] for an aborted run.
    pub state: State,
    /// The named reason of a failure in kebab case, such as `too-few-events` or `aborted`.
    pub reason: Option<String>,
    /// The outcome in a sentence, with the numbers, and what to do about a failure.
    pub message: String,
    /// The position of best focus in counts.
    pub position: Option<f64>,
    /// Where the lens stood when the run ended, in counts.
    pub lens_position: Option<f64>,
    /// Where the lens stood before the run, in counts.
    pub position_before: f64,
    /// The estimator that decided.
    pub method: Option<String>,
}

/// One sweep of the lens, and what was read off it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sweep {
    /// Which way.
    pub direction: Direction,
    /// Where it began, in counts.
    pub from: f64,
    /// Where it ended, in counts.
    pub to: f64,
    /// Camera time at its start, in microseconds.
    pub start_us: i64,
    /// Camera time at its end, in microseconds.
    pub end_us: i64,
    /// The event rate along it.
    pub curve: Curve,
    /// What each estimator said, whether or not it decided.
    pub estimators: Vec<Estimate>,
    /// Whether its counts are fit to find focus with.
    pub quality: Quality,
}

/// What the counts of a sweep look like.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Quality {
    /// Share of the 5 ms windows whose rate is near the greatest, 0 to 1; above 0.3 the read-out or the link is the limit.
    pub share_at_ceiling: f64,
    /// Variance over mean of the counts in 0.2 ms bins of the busiest half: 1 for chance, below 0.1 a read-out limit.
    pub regularity: f64,
    /// Variance over mean of the counts in fiftieths of the sweep: below 2 the rate does not depend on the lens.
    pub dispersion: f64,
    /// The mains frequency at which the light flickers most, in Hz: 100 or 120; 0 if unknown.
    pub flicker_hz: u64,
    /// How much of the rate flickers, 0 to 2; above 0.3 it is a warning.
    pub flicker_depth: f64,
}

/// The focus curve; all lists have the same length.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Curve {
    /// Lens positions in counts.
    pub position: Vec<f64>,
    /// Events per second.
    pub rate: Vec<f64>,
    /// Camera times in microseconds.
    pub t_us: Vec<i64>,
}

/// The direction of a sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// The first sweep.
    Forward,
    /// The second sweep, the way back.
    Backward,
}

/// What one estimator found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Its name, as in a request.
    pub method: String,
    /// [`State::Focused`] or [`State::Failed`].
    pub state: State,
    /// Why it found nothing, in words.
    pub reason: Option<String>,
    /// The position found, in counts.
    pub position: Option<f64>,
    /// Camera time of that position in the sweep, in microseconds.
    pub t_us: Option<i64>,
    /// Steps of the search.
    pub iterations: u64,
    /// Events that the answer rests on.
    pub events: u64,
}

/// The relation of the two clocks: host = camera + offset, at the end of the run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ClockMap {
    /// Host time minus camera time, in microseconds.
    pub offset_us: f64,
    /// How much faster the host's clock runs than the camera's, in parts per million.
    pub drift_ppm: f64,
    /// How far the packets that came soonest lie off the map, root mean square, in microseconds: what it may err by.
    pub residual_us: f64,
    /// How much later than the soonest the packets came on average, in microseconds.
    pub mean_delay_us: f64,
    /// How often the camera's clock has started anew.
    pub resets: u64,
}

/// Where the events of a run went.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct EventCounts {
    /// All that were counted; `on` plus `off`.
    pub counted: u64,
    /// Brighter.
    pub on: u64,
    /// Darker.
    pub off: u64,
    /// Known to be lost between the sensor and the counter.
    pub lost: u64,
    /// Counted, but not kept for the measures that need pixels, because the buffer was full.
    pub dropped_from_buffer: u64,
}

/// How long a phase took.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PhaseTiming {
    /// The phase.
    pub phase: Phase,
    /// Seconds.
    pub seconds: f64,
}
