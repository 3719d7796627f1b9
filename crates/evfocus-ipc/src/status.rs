//! What the daemon is doing, in libcamera's vocabulary.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::{Calibration, LensRange};

/// Who decides about the lens.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    /// The lens moves to where it is told; the state is always idle.
    Manual,
    /// The lens moves by itself, but only when a focus run is started.
    #[default]
    Auto,
    /// The lens moves by itself, when a focus run is started, when focus is not known, and when the picture has lost its sharpness.
    Continuous,
}

/// Whether continuous mode may start runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PauseState {
    /// It may.
    #[default]
    Running,
    /// The run under way is the last one.
    Pausing,
    /// It may not.
    Paused,
}

/// When continuous mode is to pause.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PauseWhen {
    /// At once; a run under way is aborted.
    #[default]
    Immediate,
    /// A run under way comes to its end first.
    Deferred,
}

/// How the last focus run went, or that one is under way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// No run yet, or the last one was aborted.
    #[default]
    Idle,
    /// A run is under way.
    Scanning,
    /// The last run found focus and the lens stands there.
    Focused,
    /// The last run failed; its report has a named reason.
    Failed,
}

/// What a run is at. Varlink's enumerations know no hyphen, hence `to_start`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// No run is under way.
    #[default]
    None,
    /// The lens finds its reference position.
    Homing,
    /// The lens moves to where the sweep starts.
    ToStart,
    /// The lens rests there; hot pixels are learnt.
    Resting,
    /// The first sweep; events are counted.
    Sweeping,
    /// The second sweep, on the way back.
    Returning,
    /// The counts of a sweep are completed and searched.
    Searching,
    /// The lens moves to the position found, past backlash.
    Approaching,
    /// It is looked whether the lens is there.
    Verifying,
    /// The run failed and the lens goes back to where it was.
    Restoring,
    /// No run: the lens is being calibrated.
    Calibrating,
}

impl Mode {
    /// The name on the wire.
    pub fn name(self) -> &'static str {
        match self {
            Self::Manual => "manual",
            Self::Auto => "auto",
            Self::Continuous => "continuous",
        }
    }
}

impl PauseState {
    /// The name on the wire.
    pub fn name(self) -> &'static str {
        match self {
            Self::Running => "running",
            Self::Pausing => "pausing",
            Self::Paused => "paused",
        }
    }
}

impl State {
    /// The name on the wire.
    pub fn name(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::Scanning => "scanning",
            Self::Focused => "focused",
            Self::Failed => "failed",
        }
    }
}

impl Phase {
    /// The name on the wire.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Homing => "homing",
            Self::ToStart => "to_start",
            Self::Resting => "resting",
            Self::Sweeping => "sweeping",
            Self::Returning => "returning",
            Self::Searching => "searching",
            Self::Approaching => "approaching",
            Self::Verifying => "verifying",
            Self::Restoring => "restoring",
            Self::Calibrating => "calibrating",
        }
    }
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl fmt::Display for Phase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// The daemon at one moment.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Status {
    /// Who decides about the lens.
    pub mode: Mode,
    /// Whether continuous mode may start runs; [`PauseState::Running`] in other modes says nothing.
    #[serde(default)]
    pub pause: PauseState,
    /// How sharp the picture is as a share of what it was in focus; nothing unless continuous mode knows.
    #[serde(default)]
    pub sharpness: Option<f64>,
    /// How focusing stands.
    pub state: State,
    /// What the run under way is at; [`Phase::None`] without one.
    pub phase: Phase,
    /// The run under way.
    pub run_id: Option<u64>,
    /// Where the lens is, in its own counts; nothing before its first answer.
    pub lens_position: Option<f64>,
    /// Whether the lens is moving: from the order on, until it was asked since and stands.
    pub lens_moving: bool,
    /// The positions that the lens accepts, in counts.
    pub lens_range: Option<LensRange>,
    /// Events per second, over the last tenth of a second or so.
    pub event_rate: f64,
    /// Events known to be lost since the daemon started, anywhere between the sensor and the counter.
    pub events_lost: u64,
    /// The last run that ended.
    pub last_run: Option<LastRun>,
    /// The camera in use, model and serial; nothing while none is there.
    pub camera: Option<String>,
    /// The lens in use, model and serial; nothing while none is there.
    pub lens: Option<String>,
    /// What was measured of the lens in use, and is counted on; nothing if it was not calibrated.
    #[serde(default)]
    pub calibration: Option<Calibration>,
    /// What is wrong at the moment, in words, with what to do about it; nothing if all is well.
    pub fault: Option<String>,
    /// What was asked of the operating system for real time, and whether it was granted; empty if nothing was.
    #[serde(default)]
    pub real_time: Vec<Grant>,
    /// The daemon's version.
    pub version: String,
    /// Seconds since the daemon started.
    pub uptime_s: f64,
}

/// Something that was asked of the operating system.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Grant {
    /// What: `control scheduling`, `camera processors`, `memory`.
    pub what: String,
    /// What was asked for: `SCHED_FIFO 20`, `2 3`, `locked`.
    pub asked: String,
    /// Whether it was granted.
    pub granted: bool,
    /// Why it was not, and what to do about it.
    pub remedy: Option<String>,
}

/// How the last run ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LastRun {
    /// Its number, for `GetReport`.
    pub id: u64,
    /// [`State::Focused`], [`State::Failed`], or [`State::Idle`] for an aborted run.
    pub state: State,
    /// The position found, in counts.
    pub position: Option<f64>,
    /// The named reason of a failure, in kebab case.
    pub reason: Option<String>,
    /// One standard deviation of the position, in counts; nothing if nothing is known of it.
    #[serde(default)]
    pub error_bar: Option<f64>,
    /// The probability, 0 to 1, that the position is right.
    #[serde(default)]
    pub confidence: Option<f64>,
    /// What is odd about the answer, in kebab case.
    #[serde(default)]
    pub flags: Vec<String>,
}
