//! Between the core's types and those of the socket.

mod report;

use std::fmt::Display;
use std::time::Duration;

use evfocus_core::controller::{FocusRequest, FocusState, Mode, Pace, PauseState, Refusal};
use evfocus_core::{Directions, Geometry, LensPosition, LensRange, LensSpeed, Method, Phase, Prefer};
use evfocus_ipc as ipc;

use crate::windows;

pub(crate) use report::{Circumstances, report};

/// The request that a client of a camera of `geometry` means.
pub(crate) fn focus_request(
    request: &ipc::FocusRequest,
    geometry: Geometry,
) -> Result<FocusRequest, ipc::Error> {
    Ok(FocusRequest {
        method: request.method.as_deref().map(method).transpose()?,
        interval: request.interval_us.map(Duration::from_micros),
        range: request.range.map(range).transpose()?,
        speed: request.speed_counts_per_s.map(speed).transpose()?,
        pace: request.speed.as_deref().map(pace).transpose()?,
        directions: request.directions.as_deref().map(directions).transpose()?,
        windows: windows::in_pixels(&request.windows, geometry)?,
        prefer: request.prefer.as_deref().map(prefer).transpose()?,
    })
}

pub(crate) fn invalid(name: &str, value: &dyn Display, remedy: &dyn Display) -> ipc::Error {
    ipc::Error::InvalidArgument {
        name: name.to_owned(),
        value: value.to_string(),
        remedy: remedy.to_string(),
    }
}

fn method(given: &str) -> Result<Method, ipc::Error> {
    given.parse().map_err(|_| ipc::Error::UnknownMethod {
        given: given.to_owned(),
        known: Method::ALL.iter().map(|method| method.name().to_owned()).collect(),
    })
}

fn range(range: ipc::LensRange) -> Result<LensRange, ipc::Error> {
    LensRange::new(LensPosition(range.min), LensPosition(range.max))
        .map_err(|error| invalid("range", &format!("{} to {}", range.min, range.max), &error))
}

fn speed(speed: f64) -> Result<LensSpeed, ipc::Error> {
    LensSpeed::new(speed).map_err(|error| invalid("speed_counts_per_s", &speed, &error))
}

fn pace(name: &str) -> Result<Pace, ipc::Error> {
    Pace::ALL
        .into_iter()
        .find(|pace| pace.name() == name)
        .ok_or_else(|| invalid("speed", &name, &"it must be \"fast\", \"normal\" or \"accurate\""))
}

fn directions(name: &str) -> Result<Directions, ipc::Error> {
    match name {
        "both" => Ok(Directions::Both),
        "forward" => Ok(Directions::Forward),
        other => Err(invalid("directions", &other, &"it must be \"both\" or \"forward\"")),
    }
}

fn prefer(name: &str) -> Result<Prefer, ipc::Error> {
    name.parse().map_err(|error| invalid("prefer", &name, &error))
}

/// A refused command as a typed error.
pub(crate) fn refusal(refusal: &Refusal) -> ipc::Error {
    match *refusal {
        Refusal::Busy { run } => ipc::Error::Busy { run_id: run.0 },
        Refusal::ManualMode => ipc::Error::WrongMode { mode: ipc::Mode::Manual, needed: ipc::Mode::Auto },
        Refusal::NotContinuous { mode: present } => {
            ipc::Error::WrongMode { mode: mode(present), needed: ipc::Mode::Continuous }
        }
        Refusal::NoCamera => ipc::Error::NoSuchDevice {
            role: ipc::DeviceRole::Camera,
            remedy: "connect the camera; ListDevices says what is there".to_owned(),
        },
        Refusal::NoLens => ipc::Error::NoSuchDevice {
            role: ipc::DeviceRole::Lens,
            remedy: "connect the lens; ListDevices says what is there".to_owned(),
        },
        Refusal::NotHomed => ipc::Error::NotPermitted {
            what: "moving a lens that has not been homed".to_owned(),
            remedy: "start a focus run; it homes the lens first".to_owned(),
        },
        Refusal::OutOfRange { what, value, limits } => {
            ipc::Error::OutOfRange { what: what.to_owned(), value, min: limits.min().0, max: limits.max().0 }
        }
        Refusal::TooFast { value, max } => {
            ipc::Error::OutOfRange { what: "speed_counts_per_s".to_owned(), value, min: 0.0, max }
        }
        Refusal::SweepTooLong { sweep_s, .. } => {
            invalid("speed_counts_per_s", &format!("a sweep of {sweep_s:.1} s"), refusal)
        }
        Refusal::Window { index, .. } => invalid("windows", &format!("window {index}"), refusal),
        Refusal::NoSuchWindow { index, .. } => invalid("prefer", &index, refusal),
        Refusal::NoWindows { method } => invalid("method", &method, refusal),
        Refusal::Interval { interval_s, .. } => invalid("interval_us", &(interval_s * 1e6), refusal),
    }
}

/// The core's mode.
pub(crate) fn core_mode(mode: ipc::Mode) -> Mode {
    match mode {
        ipc::Mode::Manual => Mode::Manual,
        ipc::Mode::Auto => Mode::Auto,
        ipc::Mode::Continuous => Mode::Continuous,
    }
}

/// The socket's mode.
pub(crate) fn mode(mode: Mode) -> ipc::Mode {
    match mode {
        Mode::Manual => ipc::Mode::Manual,
        Mode::Auto => ipc::Mode::Auto,
        Mode::Continuous => ipc::Mode::Continuous,
    }
}

/// The socket's word for whether continuous mode is paused.
pub(crate) fn pause_state(state: PauseState) -> ipc::PauseState {
    match state {
        PauseState::Running => ipc::PauseState::Running,
        PauseState::Pausing => ipc::PauseState::Pausing,
        PauseState::Paused => ipc::PauseState::Paused,
    }
}

/// The socket's state.
pub(crate) fn state(state: FocusState) -> ipc::State {
    match state {
        FocusState::Idle => ipc::State::Idle,
        FocusState::Scanning => ipc::State::Scanning,
        FocusState::Focused => ipc::State::Focused,
        FocusState::Failed => ipc::State::Failed,
    }
}

/// The socket's phase.
pub(crate) fn phase(phase: Option<Phase>) -> ipc::Phase {
    match phase {
        None => ipc::Phase::None,
        Some(Phase::Homing) => ipc::Phase::Homing,
        Some(Phase::ToStart) => ipc::Phase::ToStart,
        Some(Phase::Resting) => ipc::Phase::Resting,
        Some(Phase::Sweeping) => ipc::Phase::Sweeping,
        Some(Phase::Returning) => ipc::Phase::Returning,
        Some(Phase::Searching) => ipc::Phase::Searching,
        Some(Phase::Approaching) => ipc::Phase::Approaching,
        Some(Phase::Verifying) => ipc::Phase::Verifying,
        Some(Phase::Restoring) => ipc::Phase::Restoring,
    }
}

/// The positions of `range`.
pub(crate) fn lens_range(range: LensRange) -> ipc::LensRange {
    ipc::LensRange { min: range.min().0, max: range.max().0 }
}
