//! Continuous mode: when runs start by themselves, and when they must not.

use evfocus_core::controller::{
    Accepted, Command, DeviceFailure, FocusRequest, FocusState, Input, Mode, Pause, PauseState, Refusal,
};
use evfocus_core::{ControllerConfig, LensPosition, Outcome, Phase};

use crate::rig::{Rig, config};

/// Stripes that read as sharp, and blurred ones.
const SHARP: u16 = 3;
const BLURRED: u16 = 8;

fn continuous(config: ControllerConfig) -> Rig {
    let mut rig = Rig::new(config);
    rig.scene.stripe = SHARP;
    assert_eq!(rig.command(Command::SetMode(Mode::Continuous)), Ok(Accepted::Done));
    rig
}

/// In focus, and what that looks like has been learnt.
fn watching() -> Rig {
    watching_with(config())
}

fn watching_with(config: ControllerConfig) -> Rig {
    let mut rig = continuous(config);
    rig.step();
    rig.finish(|_, _| {});
    rig.steps(4_000);
    assert_eq!(runs(&rig), 1);
    let sharpness = rig.controller.snapshot().sharpness.unwrap();
    assert!((sharpness - 1.0).abs() < 0.2, "{sharpness}");
    rig
}

fn runs(rig: &Rig) -> u64 {
    rig.controller.snapshot().continuous_runs
}

fn state(rig: &Rig) -> (FocusState, PauseState) {
    let snapshot = rig.controller.snapshot();
    (snapshot.state, snapshot.pause)
}

/// How many milliseconds until a run starts, up to `most`.
fn until_run(rig: &mut Rig, most: u32) -> Option<u32> {
    let before = runs(rig);
    (1..=most).find(|_| {
        rig.step();
        runs(rig) > before
    })
}

#[test]
fn a_run_starts_at_once_unless_the_lens_stands_in_focus() {
    let mut rig = continuous(config());
    assert_eq!(until_run(&mut rig, 10), Some(1));
    rig.finish(|_, _| {});
    let mut rig = Rig::new(config());
    rig.focus();
    rig.finish(|_, _| {});
    rig.command(Command::SetMode(Mode::Continuous)).unwrap();
    assert_eq!(state(&rig), (FocusState::Focused, PauseState::Running));
    assert_eq!(until_run(&mut rig, 10_000), None);
    rig.command(Command::SetMode(Mode::Manual)).unwrap();
    assert_eq!(state(&rig).0, FocusState::Idle);
    rig.command(Command::SetMode(Mode::Continuous)).unwrap();
    assert_eq!(until_run(&mut rig, 10), Some(1), "in manual mode nothing is known of focus");
}

#[test]
fn lost_sharpness_starts_a_run_after_a_while_and_passing_blur_does_not() {
    let mut rig = watching();
    rig.scene.stripe = BLURRED;
    rig.steps(600);
    assert!(rig.controller.snapshot().sharpness.unwrap() < 0.5);
    rig.scene.stripe = SHARP;
    assert_eq!(until_run(&mut rig, 5_000), None);
    rig.scene.stripe = BLURRED;
    let after = until_run(&mut rig, 5_000).unwrap();
    assert!((1_000..2_500).contains(&after), "{after} ms");
    assert_eq!(rig.controller.snapshot().sharpness, None, "during a run nothing is known of it");
    assert!(matches!(rig.finish(|_, _| {}), Outcome::Focused { .. }));
}

#[test]
fn more_events_fewer_or_none_start_nothing() {
    for share in [4.0, 0.2, 0.0] {
        let mut rig = watching();
        rig.scene.peak_rate *= share;
        rig.scene.floor_rate *= share;
        assert_eq!(until_run(&mut rig, 10_000), None, "{share}");
    }
}

#[test]
fn a_lens_that_stands_elsewhere_starts_a_run_after_a_while() {
    let mut rig = watching();
    rig.position += 50.0;
    let after = until_run(&mut rig, 5_000).unwrap();
    assert!((1_000..1_100).contains(&after), "{after} ms");
    // Told to go elsewhere, it has lost focus for certain.
    let mut rig = watching();
    assert_eq!(rig.command(Command::MoveTo(LensPosition(100.0))), Ok(Accepted::Done));
    assert!(until_run(&mut rig, 1_000).is_some());
    assert!(rig.position < 101.0, "it came there first");
}

#[test]
fn a_pause_ends_a_run_at_once_or_lets_it_end() {
    let mut rig = continuous(config());
    rig.until(Phase::Sweeping);
    rig.command(Command::Pause(Pause::Immediate)).unwrap();
    assert_eq!(rig.controller.report().unwrap().outcome, Outcome::Aborted);
    assert_eq!(state(&rig), (FocusState::Idle, PauseState::Paused));
    assert_eq!(until_run(&mut rig, 10_000), None);
    rig.command(Command::Pause(Pause::Resume)).unwrap();
    assert_eq!(until_run(&mut rig, 10), Some(1));
    rig.until(Phase::Sweeping);
    rig.command(Command::Pause(Pause::Deferred)).unwrap();
    assert_eq!(state(&rig), (FocusState::Scanning, PauseState::Pausing));
    assert!(matches!(rig.finish(|_, _| {}), Outcome::Focused { .. }));
    assert_eq!(state(&rig), (FocusState::Focused, PauseState::Paused));
    // Asked for, a run is made all the same, and the pause goes on.
    rig.focus();
    rig.finish(|_, _| {});
    assert_eq!(state(&rig), (FocusState::Focused, PauseState::Paused));
    rig.command(Command::Pause(Pause::Deferred)).unwrap();
    assert_eq!(state(&rig), (FocusState::Focused, PauseState::Paused));
}

#[test]
fn what_is_lost_while_paused_is_noticed_afterwards() {
    let mut rig = watching();
    rig.command(Command::Pause(Pause::Immediate)).unwrap();
    rig.scene.stripe = BLURRED;
    assert_eq!(until_run(&mut rig, 10_000), None);
    assert_eq!(rig.controller.snapshot().sharpness, None);
    rig.command(Command::Pause(Pause::Resume)).unwrap();
    let after = until_run(&mut rig, 5_000).unwrap();
    assert!(after >= 1_000, "{after} ms");
}

#[test]
fn only_continuous_mode_can_be_paused() {
    let mut rig = Rig::new(config());
    for pause in [Pause::Immediate, Pause::Deferred, Pause::Resume] {
        assert_eq!(rig.command(Command::Pause(pause)), Err(Refusal::NotContinuous { mode: Mode::Auto }));
    }
}

#[test]
fn an_abort_pauses_and_a_change_of_mode_begins_anew() {
    let mut rig = continuous(config());
    rig.until(Phase::Sweeping);
    rig.command(Command::Abort).unwrap();
    assert_eq!(state(&rig), (FocusState::Idle, PauseState::Paused));
    assert_eq!(until_run(&mut rig, 10_000), None);
    rig.command(Command::SetMode(Mode::Auto)).unwrap();
    assert_eq!(until_run(&mut rig, 10_000), None);
    rig.command(Command::SetMode(Mode::Continuous)).unwrap();
    assert_eq!(until_run(&mut rig, 10), Some(1));
    rig.command(Command::SetMode(Mode::Auto)).unwrap();
    assert_eq!(rig.controller.report().unwrap().outcome, Outcome::Aborted);
    assert_eq!(state(&rig), (FocusState::Idle, PauseState::Running));
}

#[test]
fn a_client_joins_a_run_that_nobody_asked_for() {
    let mut rig = continuous(config());
    rig.until(Phase::Sweeping);
    let run = rig.controller.snapshot().run.unwrap();
    assert_eq!(rig.command(Command::Focus(FocusRequest::default())), Ok(Accepted::UnderWay(run)));
    assert_eq!(rig.command(Command::MoveTo(LensPosition(1.0))), Err(Refusal::Busy { run }));
}

#[test]
fn runs_that_fail_become_rare() {
    let mut rig = continuous(config());
    (rig.scene.peak_rate, rig.scene.floor_rate) = (0.0, 0.0);
    rig.step();
    for seconds in [4, 8, 16, 32, 60, 60] {
        assert!(matches!(rig.finish(|_, _| {}), Outcome::Failed(_)));
        assert_eq!(until_run(&mut rig, 61_000), Some(1_000 * seconds));
    }
}

#[test]
fn runs_that_find_what_was_there_before_become_rare_too() {
    // The event rate of this rig finds focus to within some 10 counts.
    let mut rig = watching_with(ControllerConfig { depth_of_focus: 40.0, ..config() });
    rig.scene.stripe = BLURRED;
    until_run(&mut rig, 5_000).unwrap();
    for seconds in [4, 8, 16] {
        // It looks sharp again after the run, and soon it does not.
        rig.scene.stripe = SHARP;
        assert!(matches!(rig.finish(|_, _| {}), Outcome::Focused { .. }));
        rig.steps(2_400);
        rig.scene.stripe = BLURRED;
        assert_eq!(until_run(&mut rig, 61_000), Some(1_000 * seconds - 2_400));
    }
    // One that was needed makes up for all of them.
    rig.scene.stripe = SHARP;
    rig.finish(|_, _| {});
    rig.steps(2_400);
    rig.position += 100.0;
    assert_eq!(until_run(&mut rig, 61_000), Some(32_000 - 2_400));
    rig.finish(|_, _| {});
    rig.steps(2_400);
    rig.scene.stripe = BLURRED;
    assert!(until_run(&mut rig, 2_500).is_some());
}

#[test]
fn without_camera_or_lens_nothing_starts_until_they_are_back() {
    for (failed, ready) in [
        (Input::CameraFailed(DeviceFailure::Gone), Input::CameraReady),
        (Input::LensFailed(DeviceFailure::Gone), Input::LensReady),
    ] {
        let mut rig = watching();
        rig.scene.stripe = BLURRED;
        until_run(&mut rig, 5_000).unwrap();
        rig.until(Phase::Sweeping);
        rig.input(failed);
        rig.finish(|_, _| {});
        assert_eq!(state(&rig).0, FocusState::Failed);
        assert_eq!(until_run(&mut rig, 100_000), None);
        rig.input(ready);
        let after = until_run(&mut rig, 5_000).unwrap();
        assert!((1_900..2_100).contains(&after), "{after} ms");
    }
}
