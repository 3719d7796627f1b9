//! Continuous mode on the simulated rig, in virtual time: it refocuses when focus is lost, and leaves the lens alone otherwise.

use std::path::Path;
use std::time::Duration;

use anyhow::{Context, Result};
use evfocus_core::LensPosition;
use evfocus_core::controller::{Command, FocusState, Mode, Pause, PauseState};
use evfocus_tests::continuous::{CHANGES_AT, Ended, Happening, Trial};
use evfocusd::{Config, VirtualRig};

fn config() -> Result<Config> {
    Ok(Config::parse("[simulation]\nshake_px_rms = 2", Path::new("(in the test)"))?)
}

fn ended(happening: Happening) -> Result<Ended> {
    Trial::new(happening, config()?).run()
}

#[test]
fn a_lens_that_is_knocked_is_brought_back_into_focus() -> Result<()> {
    for by in [-700.0, 250.0] {
        let ended = ended(Happening::Focus(by))?;
        assert!(ended.began_focused);
        let after = ended.noticed_after.context("noticed")?;
        println!("{by} counts: noticed after {after:?}, error then {:+.1}", ended.error);
        assert!(after < Duration::from_secs(4), "{after:?}");
        assert!(ended.error.abs() < 30.0, "{ended:?}");
    }
    Ok(())
}

#[test]
fn a_scene_that_moves_otherwise_or_is_lit_otherwise_is_left_alone() -> Result<()> {
    for happening in [Happening::Nothing, Happening::Pace(0.0), Happening::Pace(3.0), Happening::Light(0.6)] {
        let ended = ended(happening)?;
        assert!(ended.began_focused);
        assert_eq!(ended.runs, 0, "{happening:?}: {ended:?}");
        let sharpness = ended.sharpness.context("known")?;
        println!("{happening:?}: sharpness {sharpness:.2}");
        assert!((0.75..1.25).contains(&sharpness), "{happening:?}: {sharpness}");
    }
    Ok(())
}

#[test]
fn while_paused_nothing_starts_and_afterwards_what_was_lost_is_found() -> Result<()> {
    let by = 500.0;
    let mut rig = VirtualRig::new(&Trial::new(Happening::Focus(by), config()?).config)?;
    rig.command(Command::SetMode(Mode::Continuous))?;
    rig.step();
    assert_eq!(rig.controller().snapshot().state, FocusState::Scanning, "at once");
    rig.command(Command::Pause(Pause::Deferred))?;
    assert_eq!(rig.controller().snapshot().pause, PauseState::Pausing);
    rig.run_for(CHANGES_AT + Duration::from_secs(5));
    let snapshot = rig.controller().snapshot();
    assert_eq!((snapshot.state, snapshot.pause), (FocusState::Focused, PauseState::Paused));
    assert_eq!((snapshot.continuous_runs, snapshot.sharpness), (1, None));
    let focus = rig.truth().first().context("a truth")?.0;
    assert!(rig.rig().glass(rig.now()).distance(LensPosition(focus)) < 30.0, "where it was sharp");
    // Nothing is known of sharpness in focus: it was paused as soon as focus was found. What is lost later is found.
    rig.command(Command::Pause(Pause::Resume))?;
    rig.command(Command::SetMode(Mode::Auto))?;
    rig.command(Command::SetMode(Mode::Continuous))?;
    rig.run_for(Duration::from_secs(9));
    assert!(rig.rig().glass(rig.now()).distance(LensPosition(focus + by)) < 30.0);
    Ok(())
}

#[test]
fn a_lens_moved_by_hand_is_focused_again() -> Result<()> {
    let mut rig = VirtualRig::new(&config()?)?;
    rig.command(Command::SetMode(Mode::Continuous))?;
    rig.run_for(Duration::from_secs(9));
    assert_eq!(rig.controller().snapshot().continuous_runs, 1);
    rig.command(Command::MoveTo(LensPosition(3000.0)))?;
    rig.run_for(Duration::from_secs(9));
    let snapshot = rig.controller().snapshot();
    assert_eq!((snapshot.continuous_runs, snapshot.state), (2, FocusState::Focused));
    let focus = rig.truth().first().context("a truth")?.0;
    assert!(rig.rig().glass(rig.now()).distance(LensPosition(focus)) < 30.0);
    Ok(())
}

#[test]
fn where_there_is_nothing_to_focus_on_runs_become_rare() -> Result<()> {
    let text = "[simulation]\nscene = \"blank-wall\"\nlight = \"dark\"\n[continuous]\nlongest_rest_s = 30";
    let mut rig = VirtualRig::new(&Config::parse(text, Path::new("(in the test)"))?)?;
    rig.command(Command::SetMode(Mode::Continuous))?;
    let mut runs = Vec::new();
    for _ in 0..2 {
        let before = rig.controller().snapshot().continuous_runs;
        rig.run_for(Duration::from_secs(40));
        runs.push(rig.controller().snapshot().continuous_runs - before);
    }
    println!("runs in each 40 s: {runs:?}");
    // Rests of 4, 8, 16, 30, 30 s between runs of a few seconds.
    assert!(runs[0] <= 4 && runs[1] <= 2 && runs[1] >= 1, "{runs:?}");
    Ok(())
}
