//! What goes into the controller, what comes out, and what can be seen of it.

use super::{Mode, PauseState};
use crate::event::EventBatch;
use crate::lens_trace::LensSample;
use crate::report::{Phase, RunId};
use crate::units::{EventRate, LensPosition, LensSpeed};

/// A device that stopped working.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DeviceFailure {
    /// It is gone.
    Gone,
    /// It is there and reports a fault.
    Fault,
    /// It is there and does not answer.
    Silent,
}

/// Something that happened.
#[derive(Debug, Clone, Copy)]
pub enum Input<'a> {
    /// The camera sent events, or at least time.
    Batch(&'a EventBatch),
    /// The lens said where it is.
    Lens(LensSample),
    /// The camera failed; until [`Input::CameraReady`] there is none.
    CameraFailed(DeviceFailure),
    /// The camera is (again) there and streams.
    CameraReady,
    /// The lens failed; until [`Input::LensReady`] there is none.
    LensFailed(DeviceFailure),
    /// The lens is (again) there.
    LensReady,
    /// Time went on, and every other input up to now has been handed in: rests end, silences and deadlines are noticed.
    Tick,
}

/// Something to do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Action {
    /// Start homing the lens.
    Home,
    /// Start moving the lens.
    MoveLens {
        /// Where to.
        target: LensPosition,
        /// How fast.
        speed: LensSpeed,
    },
    /// Stop the lens where it is.
    StopLens,
    /// A run ended; [`Controller::report`](super::Controller::report) has its record.
    RunEnded,
}

/// libcamera's words for what an autofocus does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FocusState {
    /// Nothing asked for, or manual mode.
    Idle,
    /// A run is under way.
    Scanning,
    /// The last run ended in focus, and the lens has not moved since.
    Focused,
    /// The last run ended without focus.
    Failed,
}

/// What can be seen from outside at any moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Snapshot {
    /// Manual, auto or continuous.
    pub mode: Mode,
    /// Whether continuous mode may start runs.
    pub pause: PauseState,
    /// How sharp the picture is as a share of what it was in focus; nothing unless continuous mode knows.
    pub sharpness: Option<f64>,
    /// Runs that continuous mode has started.
    pub continuous_runs: u64,
    /// Idle, scanning, focused or failed.
    pub state: FocusState,
    /// What the run under way is doing.
    pub phase: Option<Phase>,
    /// The run under way.
    pub run: Option<RunId>,
    /// The newest word of the lens.
    pub lens: Option<LensSample>,
    /// Events per second over the last tenth of a second.
    pub event_rate: EventRate,
    /// Events received since the start.
    pub events: u64,
    /// Events known to be lost since the start.
    pub lost: u64,
    /// Whether the camera is there.
    pub camera_ready: bool,
    /// Whether the lens is there.
    pub lens_ready: bool,
}
