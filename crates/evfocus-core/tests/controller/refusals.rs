//! What is refused changes nothing.

use core::time::Duration;

use evfocus_core::controller::{Accepted, Command, DeviceFailure, FocusRequest, Input, Mode, Refusal};
use evfocus_core::{Directions, LensPosition, LensRange, LensSpeed, Method, RunId};

use crate::rig::{GEOMETRY, Rig, config};

fn request(range: (f64, f64), speed: f64) -> FocusRequest {
    FocusRequest {
        range: LensRange::new(LensPosition(range.0), LensPosition(range.1)).ok(),
        speed: LensSpeed::new(speed).ok(),
        ..FocusRequest::default()
    }
}

fn refused(rig: &mut Rig, command: Command) -> Refusal {
    let before = (rig.controller.snapshot(), rig.done.clone());
    let refusal = rig.command(command).unwrap_err();
    assert_eq!((rig.controller.snapshot(), rig.done.clone()), before);
    refusal
}

#[test]
fn values_that_do_not_suit_the_lens_are_refused() {
    let mut rig = Rig::new(config());
    let limits = config().limits;
    let focus = |request| Command::Focus(request);
    let out = |what, value| Refusal::OutOfRange { what, value, limits };
    assert_eq!(refused(&mut rig, focus(request((-1.0, 500.0), 1e3))), out("range start", -1.0));
    assert_eq!(refused(&mut rig, focus(request((0.0, 1_000.5), 1e3))), out("range end", 1_000.5));
    assert_eq!(
        refused(&mut rig, focus(request((0.0, 1e3), 2_001.0))),
        Refusal::TooFast { value: 2_001.0, max: 2e3 }
    );
    let too_long = Refusal::SweepTooLong { sweep_s: 10.0, longest_s: 5.0 };
    assert_eq!(refused(&mut rig, focus(request((0.0, 1e3), 100.0))), too_long);
    assert_eq!(refused(&mut rig, Command::MoveTo(LensPosition(1_001.0))), out("position", 1_001.0));
    for nonsense in [f64::NAN, f64::INFINITY] {
        let refusal = refused(&mut rig, Command::MoveTo(LensPosition(nonsense)));
        assert!(matches!(refusal, Refusal::OutOfRange { .. }));
    }
}

#[test]
fn an_interval_must_fit_the_sweep_of_the_fixed_search_and_of_no_other() {
    let mut rig = Rig::new(config());
    for interval in [Duration::ZERO, Duration::from_secs(1)] {
        let fixed = FocusRequest {
            method: Some(Method::ErFixed),
            interval: Some(interval),
            ..FocusRequest::default()
        };
        let refusal = refused(&mut rig, Command::Focus(fixed));
        assert_eq!(refusal, Refusal::Interval { interval_s: interval.as_secs_f64(), sweep_s: 1.0 });
        let egs = FocusRequest { method: Some(Method::Egs), ..fixed };
        assert!(egs.resolve(&config(), GEOMETRY).is_ok());
    }
}

#[test]
fn focus_is_refused_in_manual_mode_and_moves_are_not() {
    let mut rig = Rig::new(config());
    assert_eq!(rig.command(Command::SetMode(Mode::Manual)), Ok(Accepted::Done));
    assert_eq!(refused(&mut rig, Command::Focus(FocusRequest::default())), Refusal::ManualMode);
    assert_eq!(rig.command(Command::MoveTo(LensPosition(500.0))), Ok(Accepted::Done));
}

#[test]
fn without_a_device_there_is_no_run() {
    let mut rig = Rig::new(config());
    rig.input(Input::CameraFailed(DeviceFailure::Gone));
    assert_eq!(refused(&mut rig, Command::Focus(FocusRequest::default())), Refusal::NoCamera);
    assert_eq!(rig.command(Command::MoveTo(LensPosition(400.0))), Ok(Accepted::Done));
    rig.input(Input::CameraReady);
    rig.input(Input::LensFailed(DeviceFailure::Gone));
    assert_eq!(refused(&mut rig, Command::Focus(FocusRequest::default())), Refusal::NoLens);
    assert_eq!(refused(&mut rig, Command::MoveTo(LensPosition(400.0))), Refusal::NoLens);
    // Back, but it has not said where it is.
    rig.input(Input::LensReady);
    assert_eq!(refused(&mut rig, Command::Focus(FocusRequest::default())), Refusal::NoLens);
    rig.steps(10);
    rig.focus();
}

#[test]
fn while_a_run_is_under_way_the_same_request_joins_it_and_others_are_refused() {
    let mut rig = Rig::new(config());
    rig.focus();
    rig.steps(200);
    let run = RunId(1);
    let default = FocusRequest::default();
    let spelt_out = FocusRequest { method: Some(Method::Egs), directions: Some(Directions::Both), ..default };
    for same in [default, spelt_out] {
        assert_eq!(rig.command(Command::Focus(same)), Ok(Accepted::UnderWay(run)));
    }
    let other = FocusRequest { directions: Some(Directions::Forward), ..default };
    assert_eq!(refused(&mut rig, Command::Focus(other)), Refusal::Busy { run });
    assert_eq!(refused(&mut rig, Command::MoveTo(LensPosition(1.0))), Refusal::Busy { run });
}
