//! The report of a focus run: the same JSON on the socket and in the report file.

use serde::{Deserialize, Serialize};

use crate::{Calibration, FocusMap, FocusRequest, Phase, State, Sweep, WindowAnswer};

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
    /// What the windows of the request say, in their order.
    #[serde(default)]
    pub windows: Vec<WindowAnswer>,
    /// Where each part of the picture is sharp; nothing if no sweep had a peak in its fine structure.
    #[serde(default)]
    pub map: Option<FocusMap>,
    /// Half the difference of the two directions' answers, as a time at the sweep's speed, in microseconds: lag plus
    /// backlash. Nothing without two answers.
    pub delay_us: Option<f64>,
    /// How late the pixels are, as far as the runs up to this one have taught.
    #[serde(default)]
    pub rig_delay: Option<RigDelay>,
    /// What was known of the lens by measurement, and counted on; nothing if it was not calibrated.
    #[serde(default)]
    pub calibration: Option<Calibration>,
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
    /// The method asked for.
    pub method: Option<String>,
    /// The estimator that decided; nothing without an answer.
    #[serde(default)]
    pub decided_by: Option<String>,
    /// One standard deviation of the position, in counts; nothing if nothing is known of it.
    #[serde(default)]
    pub error_bar: Option<f64>,
    /// The probability, 0 to 1, that the position is right to within the depth of focus, or 1 % of the range if that is more.
    #[serde(default)]
    pub confidence: Option<f64>,
    /// What is odd about the answer, in kebab case: `saturated`, `two-depths`, `weak`, `unsure`, `edge`, `flat`, `flicker`,
    /// `events-lost`, `coarse`. The report's warnings say what each means.
    #[serde(default)]
    pub flags: Vec<String>,
    /// Where a good part of the picture is sharp beside the position, in counts.
    #[serde(default)]
    pub second_depth: Option<f64>,
    /// The window that won, counted from 0; nothing without windows.
    #[serde(default)]
    pub window: Option<u64>,
}

/// How late the pixels are: `base_us` plus `us_per_hz` for each noise event that a pixel makes in a second.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RigDelay {
    /// Of pixels without noise, in microseconds.
    pub base_us: f64,
    /// More for each Hz of noise, in microseconds.
    pub us_per_hz: f64,
    /// Sweeps there and back that it has been learnt from.
    pub measurements: u64,
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
