//! The whole focus loop on the simulated rig, in virtual time: what it finds, and what it says when it cannot.

use std::path::Path;

use anyhow::{Context, Result};
use evfocus_core::controller::{Command, FocusRequest, FocusState, Mode, Pace, Refusal};
use evfocus_core::{
    Directions, Failure, Flag, LensPosition, LensSpeed, Method, Outcome, Phase, Prefer, RunReport, Suspicion,
    Window, Windows,
};
use evfocusd::{Config, VirtualRig, VirtualRigError};
use hil_sim::{Fault, FaultKind, FaultTrigger, Flicker};

fn config(text: &str) -> Result<Config> {
    Ok(Config::parse(text, Path::new("(in the test)"))?)
}

fn run(config: &Config) -> Result<(VirtualRig, RunReport)> {
    let mut rig = VirtualRig::new(config)?;
    let report = rig.focus(FocusRequest::default(), |_, _, _| {})?;
    Ok((rig, report))
}

fn error_of(rig: &VirtualRig, report: &RunReport) -> Result<f64> {
    let truth = rig.truth();
    let truth = truth.first().context("a truth")?;
    match report.outcome {
        Outcome::Focused { position } => Ok(position.counts_from(*truth)),
        Outcome::Failed(_) | Outcome::Aborted => anyhow::bail!("not focused: {:?}", report.outcome),
    }
}

fn reason_of(report: &RunReport) -> &'static str {
    match report.outcome {
        Outcome::Failed(failure) => failure.name(),
        Outcome::Focused { .. } => "focused",
        Outcome::Aborted => "aborted",
    }
}

fn fault(kind: FaultKind, trigger: FaultTrigger) -> Result<Config> {
    let mut config = config("")?;
    config.rig.faults = vec![Fault { kind, trigger }];
    Ok(config)
}

const MIDWAY: FaultTrigger = FaultTrigger::AtPosition(LensPosition(1500.0));

#[test]
fn a_still_scene_is_focused_and_the_lens_stands_there() -> Result<()> {
    let (rig, report) = run(&config("")?)?;
    let error = error_of(&rig, &report)?;
    println!("still scene: error {error:+.1}, delay {:?} us", report.delay_us);
    // A blur of one pixel is 50 counts here.
    assert!(error.abs() < 10.0, "{error}");
    let tolerance = rig.controller().config().position_tolerance;
    let Outcome::Focused { position } = report.outcome else { anyhow::bail!("not focused") };
    assert!(rig.rig().glass(rig.now()).distance(position) <= tolerance);
    assert_eq!(rig.controller().snapshot().state, FocusState::Focused);
    for phase in [Phase::Sweeping, Phase::Returning, Phase::Approaching, Phase::Verifying] {
        assert!(!report.phases[phase as usize].is_zero(), "{phase:?}");
    }
    Ok(())
}

#[test]
fn the_same_seed_gives_the_same_run_and_another_seed_another() -> Result<()> {
    let (_, first) = run(&config("[simulation]\nshake_px_rms = 1.5")?)?;
    let (_, again) = run(&config("[simulation]\nshake_px_rms = 1.5")?)?;
    let (_, other) = run(&config("[simulation]\nshake_px_rms = 1.5\nseed = 2")?)?;
    assert_eq!(first, again);
    assert_ne!(first.outcome, other.outcome);
    Ok(())
}

#[test]
fn a_worn_lens_is_brought_to_its_answer_past_backlash() -> Result<()> {
    let (rig, report) = run(&config("[simulation]\nlens = \"worn\"")?)?;
    let Outcome::Focused { position } = report.outcome else { anyhow::bail!("{:?}", report.outcome) };
    let glass = rig.rig().glass(rig.now());
    // Come from below, the glass is where the lens says; come from above it would be 15 counts off.
    assert!(
        glass.distance(position) <= rig.controller().config().position_tolerance + 3.0,
        "{glass} {position}"
    );
    Ok(())
}

#[test]
fn play_is_found_and_once_it_is_known_taken_off() -> Result<()> {
    let with_play = |known: f64| -> Result<(VirtualRig, RunReport)> {
        let mut config = config(&format!("[lens]\nbacklash_counts = {known}"))?;
        config.rig.lens.backlash = 80.0;
        run(&config)
    };
    let (_, report) = with_play(0.0)?;
    let Outcome::Failed(failure) = report.outcome else { anyhow::bail!("{:?}", report.outcome) };
    println!("{failure}");
    assert_eq!(failure.name(), "direction-mismatch");
    let Failure::DirectionMismatch { suspicion: Suspicion::Backlash { counts }, .. } = failure else {
        anyhow::bail!("{failure:?}")
    };
    assert!((counts - 80.0).abs() < 16.0, "{counts}");
    let (rig, report) = with_play(80.0)?;
    let error = error_of(&rig, &report)?;
    assert!(error.abs() < 10.0, "{error}");
    Ok(())
}

#[test]
fn one_way_is_half_the_way() -> Result<()> {
    let mut rig = VirtualRig::new(&config("")?)?;
    let request = FocusRequest { directions: Some(Directions::Forward), ..FocusRequest::default() };
    let report = rig.focus(request, |_, _, _| {})?;
    assert_eq!(report.sweeps().count(), 1);
    assert!(report.delay_us.is_none());
    assert_eq!(report.phases[Phase::Returning as usize], std::time::Duration::ZERO);
    Ok(())
}

#[test]
fn the_faster_the_shorter_and_every_speed_is_right() -> Result<()> {
    let mut elapsed = Vec::new();
    for pace in Pace::ALL {
        let mut rig = VirtualRig::new(&config("")?)?;
        let request = FocusRequest { pace: Some(pace), ..FocusRequest::default() };
        let report = rig.focus(request, |_, _, _| {})?;
        let answer = report.answer.context("an answer")?;
        let (error, bar) = (error_of(&rig, &report)?, answer.error_bar.context("an error bar")?);
        println!("{}: error {error:+.1} of {bar:.1} in {:?}", pace.name(), report.elapsed());
        assert!(error.abs() < 3.0 * bar && bar < 30.0, "{}: {error} of {bar}", pace.name());
        assert!(answer.confidence.is_some_and(|confidence| confidence > 0.5));
        assert_eq!(report.sweeps().count(), if pace == Pace::Fast { 1 } else { 2 });
        elapsed.push(report.elapsed());
    }
    assert!(elapsed.is_sorted() && elapsed[0] * 3 < elapsed[2] * 2, "{elapsed:?}");
    Ok(())
}

#[test]
fn fast_goes_back_in_the_dark_until_the_delay_is_known() -> Result<()> {
    let dark = config("[simulation]\nlight = \"dark\"\n[focus]\nspeed = \"fast\"")?;
    let mut rig = VirtualRig::new(&dark)?;
    let mut sweeps = Vec::new();
    for _ in 0..2 {
        let report = rig.focus(FocusRequest::default(), |_, _, _| {})?;
        let answer = report.answer.context("an answer")?;
        println!(
            "{} sweeps: error {:+.1}, bar {:.1?}, confidence {:.2?}",
            report.sweeps().count(),
            error_of(&rig, &report)?,
            answer.error_bar,
            answer.confidence
        );
        sweeps.push(report.sweeps().count());
    }
    assert_eq!(sweeps, [2, 1]);
    Ok(())
}

#[test]
fn of_two_depths_the_one_asked_for_is_focused() -> Result<()> {
    let scene = "[simulation]\nscene = \"two-depths\"\nfocus_counts = 1500\nsecond_focus_counts = 2500\n";
    // Quicker runs end beyond the first depth that they are sure of.
    let accurate = config(&format!("{scene}[focus]\nspeed = \"accurate\""))?;
    let both = run(&accurate)?.1.answer.context("an answer")?;
    assert!(both.flags.contains(Flag::TwoDepths));
    let second = both.second_depth.context("a second depth")?;
    assert!((both.position.distance(second) - 1000.0).abs() < 50.0, "{both:?}");
    let windows = |rectangles: &[(u16, u16)]| {
        let mut windows = Windows::default();
        for (place, &(x, width)) in windows.iter_mut().zip(rectangles) {
            *place = Some(Window { x, y: 0, width, height: 260 });
        }
        windows
    };
    let (left, right) = ((0, 160), (186, 160));
    let nearest = Some(Prefer::Nearest);
    for (pace, nearest_at, windows, prefer, expected) in [
        (Pace::Normal, "max", windows(&[]), nearest, 2500.0),
        (Pace::Fast, "min", windows(&[]), nearest, 1500.0),
        (Pace::Fast, "max", windows(&[left]), None, 1500.0),
        (Pace::Normal, "max", windows(&[right]), None, 2500.0),
        (Pace::Fast, "max", windows(&[left, right]), nearest, 2500.0),
        (Pace::Accurate, "min", windows(&[left, right]), nearest, 1500.0),
        (Pace::Normal, "max", windows(&[left, right]), Some(Prefer::Window(0)), 1500.0),
    ] {
        let text = format!("{scene}[focus]\nnearest_at = \"{nearest_at}\"");
        let mut rig = VirtualRig::new(&config(&text)?)?;
        let request = FocusRequest { windows, prefer, pace: Some(pace), ..FocusRequest::default() };
        let report = rig.focus(request, |_, _, _| {})?;
        let case = format!("{} {nearest_at} {prefer:?} {windows:?}: {:?}", pace.name(), report.outcome);
        let Outcome::Focused { position } = report.outcome else { anyhow::bail!(case) };
        assert!(position.distance(LensPosition(expected)) < 30.0, "{case}");
        let window = report.answer.and_then(|answer| answer.window);
        assert_eq!(window.is_some(), windows[0].is_some(), "{case}");
    }
    Ok(())
}

#[test]
fn a_way_back_that_says_nothing_leaves_the_answer_of_the_way_there() -> Result<()> {
    let text = "[simulation]\nscene = \"text\"\nfocus_counts = 2146\nshake_px_rms = 2\nseed = 2";
    let mut shaken = config(text)?;
    shaken.rig.motion.roll_rad_rms = 0.003;
    let (rig, report) = run(&shaken)?;
    let answer = report.answer.context("an answer")?;
    assert!(answer.flags.contains(Flag::Weak), "{answer:?}");
    let error = error_of(&rig, &report)?;
    assert!(error.abs() < 3.0 * answer.error_bar.context("an error bar")?, "{error}: {answer:?}");
    Ok(())
}

#[test]
fn sweeps_there_and_back_teach_the_delay() -> Result<()> {
    let mut rig = VirtualRig::new(&config("")?)?;
    let unsure = rig.controller().delays().at(0.0).uncertainty_s;
    for runs in 1..=3 {
        rig.focus(FocusRequest::default(), |_, _, _| {})?;
        assert_eq!(rig.controller().delays().measurements, runs);
    }
    assert!(rig.controller().delays().at(0.0).uncertainty_s < 0.7 * unsure);
    let one_way = FocusRequest { pace: Some(Pace::Fast), ..FocusRequest::default() };
    let report = rig.focus(one_way, |_, _, _| {})?;
    assert!(error_of(&rig, &report)?.abs() < 5.0);
    assert_eq!(rig.controller().delays().measurements, 3, "one way says nothing of the delay");
    Ok(())
}

#[test]
fn every_method_runs_through_the_loop() -> Result<()> {
    for method in Method::ALL {
        let mut rig = VirtualRig::new(&config("")?)?;
        let request = FocusRequest {
            method: Some(method),
            directions: Some(Directions::Forward),
            ..FocusRequest::default()
        };
        let report = rig.focus(request, |_, _, _| {})?;
        let error = error_of(&rig, &report)?;
        println!("{method}: error {error:+.1}");
        // The event rate has its humps beside focus.
        let limit = if method.reads_every_event() && method != Method::ErSquared { 20.0 } else { 500.0 };
        assert!(error.abs() < limit, "{method}: {error}");
    }
    Ok(())
}

#[test]
fn what_the_rig_cannot_do_ends_with_its_named_reason() -> Result<()> {
    let second = std::time::Duration::from_secs(1);
    let lost = FaultKind::EventLoss { share: 0.5, duration: 10 * second };
    let late = FaultKind::LensPositionLate { by: 3 * second / 10 };
    let cases = vec![
        ("lens-not-moving", fault(FaultKind::LensStalled, FaultTrigger::After(second / 2))?),
        ("lens-stopped-short", fault(FaultKind::LensStalled, MIDWAY)?),
        ("lens-lost", fault(FaultKind::LensUnplugged, MIDWAY)?),
        ("lens-silent", fault(FaultKind::LensSilent, MIDWAY)?),
        ("camera-lost", fault(FaultKind::CameraUnplugged, MIDWAY)?),
        ("clock-unusable", fault(FaultKind::CameraTimeReset, MIDWAY)?),
        ("events-lost", fault(lost, MIDWAY)?),
        ("direction-mismatch", fault(late, FaultTrigger::After(second))?),
        ("too-few-events", config("[focus]\nfewest_events = 100000000")?),
        ("peak-at-edge", config("[simulation]\nfocus_counts = 235\nvelocity_px_per_s = 60")?),
        ("saturated", saturated()?),
        ("flicker", flickering()?),
        ("weak", config("[simulation]\nscene = \"low-texture\"\nlight = \"dark\"")?),
        ("flat", config("[simulation]\nscene = \"blank-wall\"\nlight = \"dark\"")?),
    ];
    for (expected, config) in cases {
        let (rig, report) = run(&config).with_context(|| expected)?;
        println!("{expected}: {:?} at {}", report.outcome, report.position_after);
        assert_eq!(reason_of(&report), expected);
        assert_eq!(rig.controller().snapshot().state, FocusState::Failed, "{expected}");
        let Outcome::Failed(failure) = report.outcome else { anyhow::bail!("{expected}") };
        let went_back = report.position_after.distance(report.position_before)
            <= rig.controller().config().position_tolerance;
        assert!(went_back || failure.is_of_lens(), "{expected}: the lens is at {}", report.position_after);
    }
    Ok(())
}

/// A read-out that is slower than the scene.
fn saturated() -> Result<Config> {
    let mut config = config("[simulation]\nshake_px_rms = 3.0\n[focus]\nlargest_lost_share = 1.0")?;
    config.rig.sensor.readout_events_per_s = 150_000.0;
    Ok(config)
}

/// Lamps that make nearly all events.
fn flickering() -> Result<Config> {
    let mut config = config("")?;
    config.rig.flicker = Some(Flicker { hertz: 100.0, depth: 0.5 });
    config.rig.sensor.cutoff_hz = 1000.0;
    Ok(config)
}

#[test]
fn hot_pixels_are_learnt_at_rest_and_left_out() -> Result<()> {
    let clean = run(&config("")?)?.1;
    let mut with_hot_pixels = config("[simulation]\nhot_pixels = 40")?;
    with_hot_pixels.rig.sensor.hot_pixel_hz = 3000.0;
    let report = run(&with_hot_pixels)?.1;
    assert_eq!((clean.hot_pixels, report.hot_pixels), (0, 40));
    // Left in, they would add 40 x 3 kHz x 2 s = 240,000 events to the first sweep.
    let events = |report: &RunReport| report.sweeps().next().map_or(0, |leg| leg.on + leg.off);
    let surplus = events(&report).abs_diff(events(&clean));
    assert!(surplus < 20_000, "{surplus}");
    Ok(())
}

#[test]
fn abort_leaves_the_lens_where_it_is() -> Result<()> {
    let mut rig = VirtualRig::new(&config("")?)?;
    rig.command(Command::Focus(FocusRequest::default()))?;
    rig.run_for(std::time::Duration::from_millis(1200));
    rig.command(Command::Abort)?;
    rig.run_for(std::time::Duration::from_millis(500));
    let stopped = rig.rig().glass(rig.now());
    assert!(stopped.0 > 1000.0 && stopped.0 < 3000.0, "in the middle of the sweep: {stopped}");
    rig.run_for(std::time::Duration::from_millis(500));
    assert_eq!(rig.rig().glass(rig.now()), stopped);
    assert_eq!(rig.controller().snapshot().state, FocusState::Idle);
    let report = rig.controller().report().context("a report")?;
    assert_eq!(report.outcome, Outcome::Aborted);
    let leg = report.sweeps().next().context("the unfinished sweep")?;
    assert!(leg.on + leg.off > 10_000, "what was counted is in the report: {} events", leg.on + leg.off);
    assert!(!leg.curve.points().is_empty());
    Ok(())
}

#[test]
fn a_lens_is_homed_before_its_first_run_and_not_moved_before() -> Result<()> {
    let homing = config("[simulation]\nlens_needs_homing = true")?;
    let mut rig = VirtualRig::new(&homing)?;
    assert!(matches!(rig.command(Command::MoveTo(LensPosition(500.0))), Err(Refusal::NotHomed)));
    let report = rig.focus(FocusRequest::default(), |_, _, _| {})?;
    assert!(error_of(&rig, &report)?.abs() < 10.0);
    assert!(!report.phases[Phase::Homing as usize].is_zero());
    let again = rig.focus(FocusRequest::default(), |_, _, _| {})?;
    assert!(again.phases[Phase::Homing as usize].is_zero(), "once is enough");
    Ok(())
}

#[test]
fn a_second_trigger_joins_the_run_and_another_request_is_refused() -> Result<()> {
    let mut rig = VirtualRig::new(&config("")?)?;
    let first = rig.command(Command::Focus(FocusRequest::default()))?;
    rig.run_for(std::time::Duration::from_millis(200));
    let again = rig.command(Command::Focus(FocusRequest::default()))?;
    assert_ne!(first, again, "started, then under way");
    let slower = FocusRequest { speed: Some(LensSpeed::new(500.0)?), ..FocusRequest::default() };
    assert!(matches!(rig.command(Command::Focus(slower)), Err(Refusal::Busy { .. })));
    assert!(matches!(rig.command(Command::MoveTo(LensPosition(500.0))), Err(Refusal::Busy { .. })));
    Ok(())
}

#[test]
fn the_lens_moves_when_told_and_only_within_its_limits() -> Result<()> {
    let mut rig = VirtualRig::new(&config("")?)?;
    rig.command(Command::SetMode(Mode::Manual))?;
    assert!(matches!(rig.focus(FocusRequest::default(), |_, _, _| {}), Err(VirtualRigError::Refused(_))));
    rig.command(Command::MoveTo(LensPosition(3000.0)))?;
    rig.run_for(std::time::Duration::from_secs(3));
    assert!(rig.rig().glass(rig.now()).distance(LensPosition(3000.0)) < 2.0);
    assert!(matches!(rig.command(Command::MoveTo(LensPosition(3751.0))), Err(Refusal::OutOfRange { .. })));
    Ok(())
}
