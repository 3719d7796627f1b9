//! Between the core's types and those of the socket.

use std::time::Duration;

use evfocus_core::controller::{FocusRequest, FocusState, Mode, Refusal};
use evfocus_core::{
    Directions, Estimate, Failure, FocusPlan, LegReport, LensPosition, LensRange, LensSpeed, Method, Outcome,
    Phase, RunReport, SearchError,
};
use evfocus_ipc as ipc;

/// The request that a client means.
pub(crate) fn focus_request(request: &ipc::FocusRequest) -> Result<FocusRequest, ipc::Error> {
    let invalid = |name: &str, value: String, remedy: String| ipc::Error::InvalidArgument {
        name: name.to_owned(),
        value,
        remedy,
    };
    let method = match &request.method {
        None => None,
        Some(given) => Some(given.parse::<Method>().map_err(|_| ipc::Error::UnknownMethod {
            given: given.clone(),
            known: Method::ALL.iter().map(|method| method.name().to_owned()).collect(),
        })?),
    };
    let range = request
        .range
        .map(|range| {
            LensRange::new(LensPosition(range.min), LensPosition(range.max)).map_err(|error| {
                invalid("range", format!("{} to {}", range.min, range.max), error.to_string())
            })
        })
        .transpose()?;
    let speed = request
        .speed_counts_per_s
        .map(|speed| {
            LensSpeed::new(speed)
                .map_err(|error| invalid("speed_counts_per_s", speed.to_string(), error.to_string()))
        })
        .transpose()?;
    let directions = request
        .directions
        .as_deref()
        .map(|directions| match directions {
            "both" => Ok(Directions::Both),
            "forward" => Ok(Directions::Forward),
            other => {
                Err(invalid("directions", other.to_owned(), "it must be \"both\" or \"forward\"".to_owned()))
            }
        })
        .transpose()?;
    Ok(FocusRequest {
        method,
        interval: request.interval_us.map(Duration::from_micros),
        range,
        speed,
        directions,
    })
}

/// A refused command as a typed error.
pub(crate) fn refusal(refusal: &Refusal) -> ipc::Error {
    match *refusal {
        Refusal::Busy { run } => ipc::Error::Busy { run_id: run.0 },
        Refusal::ManualMode => ipc::Error::WrongMode { mode: ipc::Mode::Manual, needed: ipc::Mode::Auto },
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
        Refusal::SweepTooLong { sweep_s, .. } => ipc::Error::InvalidArgument {
            name: "speed_counts_per_s".to_owned(),
            value: format!("a sweep of {sweep_s:.1} s"),
            remedy: refusal.to_string(),
        },
        Refusal::Interval { interval_s, .. } => ipc::Error::InvalidArgument {
            name: "interval_us".to_owned(),
            value: (interval_s * 1e6).to_string(),
            remedy: refusal.to_string(),
        },
    }
}

/// The core's mode.
pub(crate) fn core_mode(mode: ipc::Mode) -> Mode {
    match mode {
        ipc::Mode::Manual => Mode::Manual,
        ipc::Mode::Auto => Mode::Auto,
    }
}

/// The socket's mode.
pub(crate) fn mode(mode: Mode) -> ipc::Mode {
    match mode {
        Mode::Manual => ipc::Mode::Manual,
        Mode::Auto => ipc::Mode::Auto,
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

fn plan(plan: &FocusPlan) -> ipc::FocusRequest {
    ipc::FocusRequest {
        method: Some(plan.method.name().to_owned()),
        range: Some(lens_range(plan.range)),
        speed_counts_per_s: Some(plan.speed.counts_per_second()),
        interval_us: u64::try_from(plan.interval.as_micros()).ok(),
        directions: Some(
            match plan.directions {
                Directions::Forward => "forward",
                Directions::Both => "both",
            }
            .to_owned(),
        ),
    }
}

/// Who and when, which a run's record does not know.
#[derive(Debug, Clone)]
pub(crate) struct Circumstances {
    /// Seconds since 1970 at the start of the run.
    pub(crate) started_unix_s: f64,
    /// The devices.
    pub(crate) devices: ipc::RunDevices,
}

/// The record of a run as the socket and the report file show it.
pub(crate) fn report(run: &RunReport, circumstances: Circumstances) -> ipc::Report {
    let sum = |count: fn(&LegReport) -> u64| run.sweeps().map(count).sum::<u64>();
    let (on, off) = (sum(|leg| leg.on), sum(|leg| leg.off));
    ipc::Report {
        format: ipc::REPORT_FORMAT,
        run_id: run.id.0,
        started_unix_s: circumstances.started_unix_s,
        elapsed_s: run.elapsed().as_secs_f64(),
        request: plan(&run.plan),
        devices: circumstances.devices,
        result: outcome(run),
        sweeps: run.sweeps().zip([ipc::Direction::Forward, ipc::Direction::Backward]).map(sweep).collect(),
        delay_us: run.delay_us,
        hot_pixels: run.hot_pixels as u64,
        clock_map: (run.clock.observations > 0).then_some(ipc::ClockMap {
            offset_us: run.clock.offset_us,
            drift_ppm: run.clock.drift_ppm,
            residual_us: run.clock.residual_us,
            mean_delay_us: run.clock.mean_delay_us,
            resets: u64::from(run.clock.resets),
        }),
        events: ipc::EventCounts {
            counted: on + off,
            on,
            off,
            lost: sum(|leg| leg.lost),
            dropped_from_buffer: sum(|leg| leg.not_kept),
        },
        timings: Phase::ALL
            .into_iter()
            .zip(run.phases)
            .filter(|(_, spent)| !spent.is_zero())
            .map(|(name, spent)| ipc::PhaseTiming { phase: phase(Some(name)), seconds: spent.as_secs_f64() })
            .collect(),
        warnings: warnings(run),
    }
}

fn outcome(run: &RunReport) -> ipc::Outcome {
    let (state, reason, message, position) = match run.outcome {
        Outcome::Focused { position } => {
            (ipc::State::Focused, None, format!("focused at {position}"), Some(position.0))
        }
        Outcome::Failed(failure) => {
            // An answer at the edge of the range tells the caller where to look.
            let at_edge =
                if let Failure::PeakAtEdge { position } = failure { Some(position.0) } else { None };
            (ipc::State::Failed, Some(failure.name().to_owned()), failure.to_string(), at_edge)
        }
        Outcome::Aborted => (
            ipc::State::Idle,
            Some("aborted".to_owned()),
            "aborted; the lens stands where it was stopped".to_owned(),
            None,
        ),
    };
    ipc::Outcome {
        state,
        reason,
        message,
        position,
        lens_position: Some(run.position_after.0),
        position_before: run.position_before.0,
        method: Some(run.plan.method.name().to_owned()),
    }
}

fn sweep((leg, direction): (&LegReport, ipc::Direction)) -> ipc::Sweep {
    let points = leg.curve.points();
    ipc::Sweep {
        direction,
        from: leg.from.0,
        to: leg.to.0,
        start_us: leg.start.0,
        end_us: leg.end.0,
        curve: ipc::Curve {
            position: points.iter().map(|point| point.position.0).collect(),
            rate: points.iter().map(|point| point.rate.0).collect(),
            t_us: points.iter().map(|point| point.t_us.round() as i64).collect(),
        },
        estimators: Method::ALL
            .into_iter()
            .filter_map(|method| Some(estimate(method, leg.estimate(method)?, leg.on + leg.off)))
            .collect(),
        quality: ipc::Quality {
            share_at_ceiling: leg.quality.share_at_ceiling,
            regularity: leg.quality.regularity,
            dispersion: leg.quality.dispersion,
            flicker_hz: u64::from(leg.quality.flicker_hz),
            flicker_depth: leg.quality.flicker_depth,
        },
    }
}

fn estimate(method: Method, said: Result<Estimate, SearchError>, events: u64) -> ipc::Estimate {
    let found = said.ok();
    ipc::Estimate {
        method: method.name().to_owned(),
        state: if found.is_some() { ipc::State::Focused } else { ipc::State::Failed },
        reason: said.err().map(|error| error.to_string()),
        position: found.map(|estimate| estimate.position.0),
        t_us: found.map(|estimate| estimate.t_us.round() as i64),
        iterations: found.map_or(0, |estimate| u64::from(estimate.iterations)),
        events,
    }
}

fn warnings(run: &RunReport) -> Vec<String> {
    let mut warnings = Vec::new();
    for leg in run.sweeps() {
        let way = format!("sweep from {} to {}", leg.from, leg.to);
        if leg.quality.has_flicker() {
            warnings.push(format!(
                "{way}: the light flickers at {} Hz, depth {:.2}",
                leg.quality.flicker_hz, leg.quality.flicker_depth
            ));
        }
        if leg.lost > 0 {
            warnings.push(format!("{way}: {} events were lost, {} arrived", leg.lost, leg.on + leg.off));
        }
        if leg.not_kept > 0 {
            warnings.push(format!(
                "{way}: {} events were counted but not kept; raise focus.events_kept",
                leg.not_kept
            ));
        }
    }
    if run.hot_pixels > 0 {
        warnings.push(format!("{} hot pixels were left out", run.hot_pixels));
    }
    warnings
}
