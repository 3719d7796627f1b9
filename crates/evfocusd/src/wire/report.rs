//! The record of a run as the socket and the report file show it.

mod warnings;

use evfocus_core::controller::Pace;
use evfocus_core::{
    DelayModel, Directions, Failure, FocusPlan, LegReport, Outcome, Phase, RunReport, Window,
};
use evfocus_ipc as ipc;

use super::{lens_range, phase};
use crate::threads::control::EndedRun;
use crate::{parts_report, sweep_report};

fn plan(plan: &FocusPlan, pace: Pace) -> ipc::FocusRequest {
    let pixels = |window: &Window| ipc::FocusWindow {
        x: window.x.into(),
        y: window.y.into(),
        width: window.width.into(),
        height: window.height.into(),
        unit: Some(ipc::WindowUnit::Pixels),
    };
    ipc::FocusRequest {
        method: Some(plan.method.name().to_owned()),
        range: Some(lens_range(plan.range)),
        speed: Some(pace.name().to_owned()),
        speed_counts_per_s: Some(plan.speed.counts_per_second()),
        interval_us: u64::try_from(plan.interval.as_micros()).ok(),
        directions: match plan.directions {
            Directions::Forward => Some("forward".to_owned()),
            Directions::Both => Some("both".to_owned()),
            // It says so itself.
            Directions::BackIfUnsure => None,
        },
        windows: plan.windows.iter().flatten().map(pixels).collect(),
        prefer: Some(plan.prefer.to_string()),
    }
}

/// Who and when, which a run's record does not know.
#[derive(Debug, Clone)]
pub(crate) struct Circumstances {
    /// Seconds since 1970 at the start of the run.
    pub(crate) started_unix_s: f64,
    /// The devices.
    pub(crate) devices: ipc::RunDevices,
    /// What was measured of the lens.
    pub(crate) calibration: Option<ipc::Calibration>,
}

/// The record of a run as the socket and the report file show it.
pub(crate) fn report(ended: &EndedRun, circumstances: Circumstances) -> ipc::Report {
    let EndedRun { report: run, delays, pace } = ended;
    let sum = |count: fn(&LegReport) -> u64| run.sweeps().map(count).sum::<u64>();
    let (on, off) = (sum(|leg| leg.on), sum(|leg| leg.off));
    ipc::Report {
        format: ipc::REPORT_FORMAT,
        run_id: run.id.0,
        started_unix_s: circumstances.started_unix_s,
        elapsed_s: run.elapsed().as_secs_f64(),
        request: plan(&run.plan, *pace),
        devices: circumstances.devices,
        result: outcome(run),
        sweeps: run
            .sweeps()
            .zip([ipc::Direction::Forward, ipc::Direction::Backward])
            .map(sweep_report::sweep)
            .collect(),
        windows: run.windows().map(parts_report::window).collect(),
        map: run.map().as_ref().map(parts_report::map),
        delay_us: run.delay_us,
        rig_delay: Some(rig_delay(delays)),
        calibration: circumstances.calibration,
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
        warnings: warnings::of(run),
    }
}

/// What is known of the pixels' delay.
pub(crate) fn rig_delay(delays: &DelayModel) -> ipc::RigDelay {
    ipc::RigDelay {
        base_us: delays.base_s * 1e6,
        us_per_hz: delays.per_hz_s * 1e6,
        measurements: delays.measurements.into(),
    }
}

fn outcome(run: &RunReport) -> ipc::Outcome {
    let answer = run.answer;
    let outcome = ipc::Outcome {
        state: ipc::State::Focused,
        reason: None,
        message: String::new(),
        position: None,
        lens_position: Some(run.position_after.0),
        position_before: run.position_before.0,
        method: Some(run.plan.method.name().to_owned()),
        decided_by: answer.map(|answer| answer.decided_by.name().to_owned()),
        error_bar: answer.and_then(|answer| answer.error_bar),
        confidence: answer.and_then(|answer| answer.confidence),
        flags: answer
            .into_iter()
            .flat_map(|answer| answer.flags.iter())
            .map(|flag| flag.name().to_owned())
            .collect(),
        second_depth: answer.and_then(|answer| answer.second_depth).map(|second| second.0),
        window: answer.and_then(|answer| answer.window).map(u64::from),
    };
    match run.outcome {
        Outcome::Focused { position } => {
            ipc::Outcome { message: format!("focused at {position}"), position: Some(position.0), ..outcome }
        }
        Outcome::Failed(failure) => {
            // An answer that is not to be believed tells the caller where to look all the same.
            let (position, error_bar) = if let Failure::Unsure { position, error_bar } = failure {
                (Some(position.0), Some(error_bar))
            } else if let Failure::PeakAtEdge { position } = failure {
                (Some(position.0), None)
            } else {
                (None, outcome.error_bar)
            };
            ipc::Outcome {
                state: ipc::State::Failed,
                reason: Some(failure.name().to_owned()),
                message: failure.to_string(),
                position,
                error_bar,
                ..outcome
            }
        }
        Outcome::Aborted => ipc::Outcome {
            state: ipc::State::Idle,
            reason: Some("aborted".to_owned()),
            message: "aborted; the lens stands where it was stopped".to_owned(),
            ..outcome
        },
    }
}
