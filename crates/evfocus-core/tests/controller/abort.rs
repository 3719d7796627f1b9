//! Whatever a run is doing, an abort stops the lens where it is.

use evfocus_core::controller::{Accepted, Action, Command, FocusState, Mode};
use evfocus_core::{ControllerConfig, LensPosition, Outcome, Phase};

use crate::rig::{Rig, config};

fn in_phase(phase: Phase) -> Rig {
    let mut rig = Rig::new(ControllerConfig { needs_homing: true, ..config() });
    if phase == Phase::Restoring {
        rig.scene.peak_rate = 0.0;
        rig.scene.floor_rate = 0.0;
    }
    rig.focus();
    rig.until(phase);
    rig
}

#[test]
fn an_abort_stops_the_lens_in_every_phase() {
    for phase in Phase::ALL {
        for command in [Command::Abort, Command::SetMode(Mode::Manual)] {
            let mut rig = in_phase(phase);
            rig.done.clear();
            assert_eq!(rig.command(command), Ok(Accepted::Done));
            assert_eq!(rig.done, [Action::StopLens, Action::RunEnded], "{}", phase.name());
            assert_eq!(rig.controller.report().unwrap().outcome, Outcome::Aborted);
            let there = rig.position;
            rig.steps(2_000);
            assert!((rig.position - there).abs() < 1e-9);
            let snapshot = rig.controller.snapshot();
            assert_eq!((snapshot.state, snapshot.phase, snapshot.run), (FocusState::Idle, None, None));
            assert_eq!(rig.done.len(), 2, "{:?}", rig.done);
        }
    }
}

#[test]
fn after_an_abort_the_next_run_focuses() {
    for phase in Phase::ALL {
        let mut rig = in_phase(phase);
        assert_eq!(rig.command(Command::Abort), Ok(Accepted::Done));
        rig.scene = Rig::new(config()).scene;
        rig.focus();
        let outcome = rig.finish(|_, _| {});
        assert!(matches!(outcome, Outcome::Focused { .. }), "{}: {outcome:?}", phase.name());
    }
}

#[test]
fn a_move_can_be_aborted_and_an_abort_of_nothing_stops_the_lens_all_the_same() {
    let mut rig = Rig::new(config());
    assert_eq!(rig.command(Command::Abort), Ok(Accepted::Done));
    // It may be moving without the controller's knowledge.
    assert_eq!(rig.done, [Action::StopLens]);
    assert_eq!(rig.command(Command::MoveTo(LensPosition(900.0))), Ok(Accepted::Done));
    rig.steps(100);
    assert_eq!(rig.command(Command::Abort), Ok(Accepted::Done));
    assert_eq!(rig.done.last(), Some(&Action::StopLens));
    assert!(rig.position < 600.0);
}
