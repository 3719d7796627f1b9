//! Each way to fail: the name it is given, and what becomes of the lens.

use core::time::Duration;

use evfocus_core::controller::{Action, DeviceFailure, FocusState, Input, OnFailure, Pace};
use evfocus_core::{ControllerConfig, Failure, Method, Outcome, Phase, SweepCapacity};

use crate::rig::{CameraFault, LensFault, Rig, config};

/// What becomes of the lens: back to where it was before the run, or stopped where it is.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Lens {
    Restored,
    Stopped,
}

/// Runs `rig`, whose fault `at_phase` brings about, and looks what becomes of the lens.
fn fails(mut rig: Rig, at_phase: impl FnMut(&mut Rig, Phase), lens: Lens) -> Failure {
    let before = rig.position;
    rig.focus();
    let outcome = rig.finish(at_phase);
    let Outcome::Failed(failure) = outcome else { panic!("{outcome:?}") };
    assert_eq!(rig.controller.snapshot().state, FocusState::Failed);
    let restored = rig.phases.last() == Some(&Phase::Restoring) && (rig.position - before).abs() < 3.0;
    let stopped = rig.done.ends_with(&[Action::StopLens, Action::RunEnded]);
    assert_eq!((restored, stopped), (lens == Lens::Restored, lens == Lens::Stopped), "{failure:?}");
    failure
}

fn forward() -> ControllerConfig {
    ControllerConfig { pace: Pace::Fast, ..config() }
}

/// A fault of the lens from `phase` on.
fn lens_fault(phase: Phase, fault: LensFault) -> impl FnMut(&mut Rig, Phase) {
    move |rig, now| {
        if now == phase {
            rig.lens_fault = fault;
        }
    }
}

fn camera_fault(phase: Phase, fault: CameraFault) -> impl FnMut(&mut Rig, Phase) {
    move |rig, now| {
        if now == phase {
            rig.camera_fault = fault;
        }
    }
}

const MOVING: [Phase; 4] = [Phase::ToStart, Phase::Sweeping, Phase::Returning, Phase::Approaching];
const WITH_CAMERA: [Phase; 6] =
    [Phase::ToStart, Phase::Resting, Phase::Sweeping, Phase::Returning, Phase::Approaching, Phase::Verifying];

#[test]
fn a_lens_that_does_not_move() {
    for phase in MOVING {
        let failure = fails(Rig::new(config()), lens_fault(phase, LensFault::Stuck), Lens::Stopped);
        assert_eq!(failure, Failure::LensNotMoving, "{}", phase.name());
    }
}

#[test]
fn a_lens_that_stops_short() {
    for (phase, at) in [(Phase::ToStart, 100.0), (Phase::Sweeping, 700.0), (Phase::Returning, 300.0)] {
        let failure = fails(Rig::new(config()), lens_fault(phase, LensFault::Blocked(at)), Lens::Stopped);
        assert_eq!(failure, Failure::LensStoppedShort, "{}", phase.name());
    }
    let failure =
        fails(Rig::new(config()), lens_fault(Phase::Verifying, LensFault::Slips(-5.0)), Lens::Stopped);
    assert_eq!(failure, Failure::LensStoppedShort);
}

#[test]
fn a_lens_that_overshoots_or_hunts() {
    for fault in [LensFault::Overshoots(50.0), LensFault::NeverArrives] {
        for phase in MOVING {
            let failure = fails(Rig::new(config()), lens_fault(phase, fault), Lens::Stopped);
            assert_eq!(failure, Failure::LensOvershoot, "{}", phase.name());
        }
    }
    let failure =
        fails(Rig::new(config()), lens_fault(Phase::Verifying, LensFault::Slips(5.0)), Lens::Stopped);
    assert_eq!(failure, Failure::LensOvershoot);
}

#[test]
fn a_lens_that_says_nothing_or_nonsense() {
    for phase in WITH_CAMERA {
        let failure = fails(Rig::new(config()), lens_fault(phase, LensFault::Silent), Lens::Stopped);
        assert_eq!(failure, Failure::LensSilent, "{}", phase.name());
        let failure = fails(Rig::new(config()), lens_fault(phase, LensFault::NotANumber), Lens::Stopped);
        assert_eq!(failure, Failure::LensFault, "{}", phase.name());
    }
}

#[test]
fn a_lens_that_takes_too_long() {
    for phase in MOVING {
        let creeps = LensFault::Creeps(12.0);
        let failure = fails(Rig::new(config()), lens_fault(phase, creeps), Lens::Stopped);
        assert_eq!(failure, Failure::TimedOut(phase));
    }
    let homing = ControllerConfig { needs_homing: true, homing_timeout: Duration::from_secs(3), ..config() };
    let failure = fails(Rig::new(homing), lens_fault(Phase::Homing, LensFault::NeverArrives), Lens::Stopped);
    assert_eq!(failure, Failure::TimedOut(Phase::Homing));
}

#[test]
fn a_sweep_that_takes_longer_than_counts_are_kept() {
    let capacity = SweepCapacity { longest: Duration::from_millis(1_500), ..config().capacity };
    let rig = Rig::new(ControllerConfig { capacity, ..config() });
    let failure = fails(rig, lens_fault(Phase::Sweeping, LensFault::Creeps(100.0)), Lens::Restored);
    assert_eq!(failure, Failure::SweepTooLong);
}

#[test]
fn devices_that_fail() {
    let cases = [
        (DeviceFailure::Gone, Failure::CameraLost, Failure::LensLost),
        (DeviceFailure::Fault, Failure::CameraFault, Failure::LensFault),
        (DeviceFailure::Silent, Failure::CameraSilent, Failure::LensSilent),
    ];
    for (device_failure, of_camera, of_lens) in cases {
        for phase in WITH_CAMERA.into_iter().chain([Phase::Searching]) {
            let at = |input: Input<'static>| {
                move |rig: &mut Rig, now| {
                    if now == phase {
                        rig.input(input);
                    }
                }
            };
            let failure = fails(Rig::new(config()), at(Input::CameraFailed(device_failure)), Lens::Restored);
            assert_eq!(failure, of_camera, "{}", phase.name());
            let failure = fails(Rig::new(config()), at(Input::LensFailed(device_failure)), Lens::Stopped);
            assert_eq!(failure, of_lens, "{}", phase.name());
        }
    }
}

#[test]
fn a_camera_that_says_nothing() {
    for phase in [Phase::ToStart, Phase::Sweeping, Phase::Searching, Phase::Returning] {
        let creeps = |rig: &mut Rig, now| {
            // Slow enough that the phase outlasts the silence.
            if now == phase && phase != Phase::Searching {
                rig.lens_fault = LensFault::Creeps(150.0);
            }
            camera_fault(phase, CameraFault::Silent)(rig, now);
            if now == Phase::Restoring {
                rig.lens_fault = LensFault::None;
            }
        };
        assert_eq!(
            fails(Rig::new(config()), creeps, Lens::Restored),
            Failure::CameraSilent,
            "{}",
            phase.name()
        );
    }
}

#[test]
fn a_camera_whose_time_does_not_go_on() {
    let still = camera_fault(Phase::Searching, CameraFault::TimeStandsStill);
    assert_eq!(fails(Rig::new(forward()), still, Lens::Stopped), Failure::TimedOut(Phase::Searching));
}

#[test]
fn a_camera_clock_that_starts_anew() {
    for shift in [500_000_000, -60_000_000] {
        for phase in [Phase::Sweeping, Phase::Returning] {
            let jump = |rig: &mut Rig, now| {
                if now == phase {
                    rig.clock_offset_us += shift;
                }
            };
            let failure = fails(Rig::new(config()), jump, Lens::Restored);
            assert_eq!(failure, Failure::ClockUnusable, "{}", phase.name());
        }
        // Before the sweep it does no harm.
        let mut rig = Rig::new(config());
        rig.focus();
        let outcome = rig.finish(|rig, now| {
            if now == Phase::Resting {
                rig.clock_offset_us += shift;
            }
        });
        assert!(matches!(outcome, Outcome::Focused { .. }), "{outcome:?}");
    }
}

#[test]
fn sweeps_that_are_not_fit_to_be_searched() {
    let with = |change: fn(&mut Rig)| {
        let mut rig = Rig::new(config());
        change(&mut rig);
        fails(rig, |_, _| {}, Lens::Restored)
    };
    let few = with(|rig| (rig.scene.floor_rate, rig.scene.peak_rate) = (500.0, 0.0));
    assert!(matches!(few, Failure::TooFewEvents { needed: 2_000, events: 300..700 }), "{few:?}");
    assert_eq!(with(|rig| (rig.scene.floor_rate, rig.scene.peak_rate) = (2e4, 0.0)), Failure::Flat);
    let capped = with(|rig| (rig.scene.floor_rate, rig.scene.highest_rate) = (4e4, 5e4));
    assert_eq!(capped, Failure::Saturated);
    assert_eq!(with(|rig| rig.scene.flicker = 0.9), Failure::Flicker { hz: 100 });
    let lost = with(|rig| rig.camera_fault = CameraFault::Loses(10));
    assert!(matches!(lost, Failure::EventsLost { lost: 2_000..3_000, .. }), "{lost:?}");
    for focus in [-100.0, 3.0, 998.0, 1_100.0] {
        let mut rig = Rig::new(config());
        rig.scene.focus = focus;
        rig.scene.peak_rate = 1e6;
        let edge = fails(rig, |_, _| {}, Lens::Restored);
        assert!(matches!(edge, Failure::PeakAtEdge { .. }), "{focus}: {edge:?}");
    }
    let mismatch = with(|rig| rig.scene.hysteresis = -400.0);
    assert!(matches!(mismatch, Failure::DirectionMismatch { .. }), "{mismatch:?}");
}

#[test]
fn a_search_without_an_answer() {
    let fixed =
        ControllerConfig { method: Method::ErFixed, interval: Duration::from_millis(900), ..config() };
    let mut rig = Rig::new(fixed);
    rig.scene.floor_rate = 0.0;
    let failure = fails(rig, |_, _| {}, Lens::Restored);
    assert!(matches!(failure, Failure::NoAnswer(_)), "{failure:?}");
    let full = SweepCapacity { events: 100, ..config().capacity };
    let squared = ControllerConfig { method: Method::ErSquared, capacity: full, ..config() };
    let failure = fails(Rig::new(squared), |_, _| {}, Lens::Restored);
    assert!(matches!(failure, Failure::NoAnswer(_)), "{failure:?}");
}

#[test]
fn the_lens_stays_where_it_is_if_that_is_what_was_configured() {
    let mut rig = Rig::new(ControllerConfig { on_failure: OnFailure::Stay, ..config() });
    rig.scene.peak_rate = 0.0;
    rig.scene.floor_rate = 500.0;
    assert!(matches!(fails(rig, |_, _| {}, Lens::Stopped), Failure::TooFewEvents { .. }));
}

#[test]
fn a_failure_on_the_way_back_does_not_hide_the_first() {
    let faults = [LensFault::Stuck, LensFault::Silent, LensFault::Creeps(12.0), LensFault::NotANumber];
    for fault in faults {
        let mut rig = Rig::new(config());
        rig.scene.peak_rate = 0.0;
        rig.scene.floor_rate = 500.0;
        rig.focus();
        let outcome = rig.finish(lens_fault(Phase::Restoring, fault));
        assert!(matches!(outcome, Outcome::Failed(Failure::TooFewEvents { .. })), "{outcome:?}");
        assert!(rig.done.ends_with(&[Action::StopLens, Action::RunEnded]));
    }
}
