//! Runs that end in focus.

use core::time::Duration;

use evfocus_core::controller::{Accepted, Action, Command, FocusRequest, FocusState, Input, Mode, Pace};
use evfocus_core::{ControllerConfig, LensPosition, LensRange, Method, Outcome, Phase, RunId};

use Phase::{Approaching, Resting, Returning, Searching, Sweeping, ToStart, Verifying};

use crate::rig::{CameraFault, LensFault, Rig, config};

fn focused_at(rig: &Rig) -> f64 {
    let Outcome::Focused { position } = rig.controller.report().unwrap().outcome else {
        panic!("{:?}", rig.controller.report());
    };
    assert_eq!(rig.controller.snapshot().state, FocusState::Focused);
    assert!((rig.position - position.0).abs() <= rig.controller.config().position_tolerance);
    position.0
}

#[test]
fn one_way_goes_through_its_phases_in_order() {
    let mut rig = Rig::new(ControllerConfig { pace: Pace::Fast, ..config() });
    rig.focus();
    rig.finish(|_, _| {});
    let answer = focused_at(&rig);
    assert!((answer - 600.0).abs() < 15.0, "{answer}");
    assert_eq!(rig.phases, [ToStart, Resting, Sweeping, Searching, Approaching, Verifying]);
    let report = rig.controller.report().unwrap();
    assert_eq!((report.sweeps().count(), report.delay_us), (1, None));
    assert_eq!(report.elapsed(), report.phases.iter().sum::<Duration>());
}

#[test]
fn a_camera_that_has_just_been_started_is_waited_for() {
    let mut rig = Rig::with_silent_camera(config());
    rig.focus();
    rig.until(Resting);
    rig.steps(300);
    assert_eq!(rig.controller.snapshot().phase, Some(Resting), "longer than the rest");
    rig.camera_fault = CameraFault::None;
    rig.finish(|_, _| {});
    focused_at(&rig);
}

#[test]
fn both_ways_cancel_what_is_late() {
    for hysteresis in [0.0, -60.0, 60.0] {
        let mut rig = Rig::new(config());
        rig.scene.hysteresis = hysteresis;
        rig.focus();
        rig.finish(|_, _| {});
        let answer = focused_at(&rig);
        assert!((answer - 600.0 - hysteresis / 2.0).abs() < 15.0, "{answer}");
        let there = [ToStart, Resting, Sweeping, Searching, Returning, Searching];
        assert_eq!(rig.phases[..6], there);
        assert_eq!(rig.phases[6..], [Approaching, Verifying]);
        // Half the difference, at 1000 counts a second.
        let delay_us = rig.controller.report().unwrap().delay_us.unwrap();
        assert!((delay_us + hysteresis / 2.0 * 1e3).abs() < 15_000.0, "{delay_us}");
    }
}

#[test]
fn the_last_approach_goes_in_the_direction_of_the_first_sweep() {
    // After a sweep forward the lens must go back further than the answer; after one back it comes from there anyway.
    for (pace, run_up) in [(Pace::Fast, true), (Pace::Accurate, false)] {
        let mut rig = Rig::new(ControllerConfig { pace, ..config() });
        rig.focus();
        rig.finish(|_, _| {});
        let target = |action: &Action| match action {
            Action::MoveLens { target, .. } => Some(target.0),
            Action::Home | Action::StopLens | Action::RunEnded => None,
        };
        let targets: Vec<f64> = rig.done.iter().filter_map(target).collect();
        let answer = focused_at(&rig);
        let before = if run_up { answer - 20.0 } else { 0.0 };
        assert_eq!(targets.len(), 4);
        assert!((targets[2] - before).abs() < 1e-9 && (targets[3] - answer).abs() < 1e-9, "{targets:?}");
    }
}

#[test]
fn a_lens_that_needs_homing_is_homed_once() {
    let mut rig = Rig::new(ControllerConfig { needs_homing: true, ..config() });
    for first in [true, false] {
        rig.phases.clear();
        rig.focus();
        rig.finish(|_, _| {});
        focused_at(&rig);
        assert_eq!(rig.phases[0] == Phase::Homing, first);
    }
    assert_eq!(rig.done.iter().filter(|&&action| action == Action::Home).count(), 1);
}

#[test]
fn every_method_focuses() {
    for method in Method::ALL {
        let mut rig = Rig::new(ControllerConfig { method, ..config() });
        rig.focus();
        rig.finish(|_, _| {});
        let answer = focused_at(&rig);
        assert!((answer - 600.0).abs() < 20.0, "{method}: {answer}");
        let report = rig.controller.report().unwrap();
        for leg in report.sweeps() {
            for other in Method::ALL {
                let asked = match other {
                    Method::Egs | Method::EgsOfficial | Method::ErFixed => true,
                    Method::Structure | Method::MirrorPairs => method.reads_every_event(),
                    Method::ErSquared | Method::Auto => other == method,
                };
                assert_eq!(leg.estimate(other).is_some(), asked);
            }
        }
    }
}

#[test]
fn a_narrower_range_is_swept_and_nothing_else() {
    let mut rig = Rig::new(config());
    let range = LensRange::new(LensPosition(400.0), LensPosition(900.0)).unwrap();
    let request = FocusRequest { range: Some(range), ..FocusRequest::default() };
    assert_eq!(rig.command(Command::Focus(request)), Ok(Accepted::Started(RunId(1))));
    rig.finish(|_, _| {});
    assert!((focused_at(&rig) - 600.0).abs() < 15.0);
    for leg in rig.controller.report().unwrap().sweeps() {
        assert!(leg.from.0 >= 397.0 && leg.to.0 <= 903.0 || leg.to.0 >= 397.0 && leg.from.0 <= 903.0);
    }
}

#[test]
fn a_lens_that_slips_once_is_sent_again() {
    let mut rig = Rig::new(config());
    rig.lens_fault = LensFault::Slips(5.0);
    rig.focus();
    let mut verified = 0;
    rig.finish(|rig, phase| {
        verified += u32::from(phase == Phase::Verifying);
        if verified == 2 {
            rig.lens_fault = LensFault::None;
        }
    });
    focused_at(&rig);
    assert_eq!(verified, 2);
}

#[test]
fn the_live_curve_follows_the_sweep() {
    let mut rig = Rig::new(config());
    rig.focus();
    rig.until(Phase::Sweeping);
    rig.steps(800);
    let curve = rig.controller.live_curve();
    assert!((35..=40).contains(&curve.len()), "{}", curve.len());
    let highest = curve.iter().max_by(|a, b| a.rate.0.total_cmp(&b.rate.0)).unwrap();
    assert!(highest.position.distance(LensPosition(600.0)) < 30.0);
}

#[test]
fn runs_are_numbered_on_and_moves_forget_focus() {
    let mut rig = Rig::new(config());
    rig.controller.number_runs_from(RunId(40));
    assert_eq!(rig.command(Command::Focus(FocusRequest::default())), Ok(Accepted::Started(RunId(40))));
    rig.finish(|_, _| {});
    focused_at(&rig);
    assert_eq!(rig.command(Command::MoveTo(LensPosition(100.0))), Ok(Accepted::Done));
    rig.steps(1_000);
    assert_eq!(rig.controller.snapshot().state, FocusState::Idle);
    assert!((rig.position - 100.0).abs() < 1e-9);
    assert_eq!(rig.command(Command::Focus(FocusRequest::default())), Ok(Accepted::Started(RunId(41))));
}

#[test]
fn nothing_moves_without_a_trigger() {
    let mut rig = Rig::new(config());
    rig.steps(3_000);
    assert_eq!(rig.done, []);
    rig.input(Input::CameraReady);
    rig.input(Input::LensReady);
    assert_eq!(rig.command(Command::SetMode(Mode::Manual)), Ok(Accepted::Done));
    rig.steps(3_000);
    assert_eq!(rig.done, []);
}
