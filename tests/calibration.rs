//! Lenses are calibrated through their drivers and the models of their devices, in virtual time: what is measured against what is so.

#![expect(clippy::print_stdout, reason = "the figures belong in the output")]

use std::time::Duration;

use anyhow::{Context, Result};
use evfocus_core::controller::FocusRequest;
use evfocus_core::{HostMicros, LensPosition, LensRange, LensSpeed, Outcome};
use evfocus_ipc::Calibration;
use evfocus_tests::lenses::{config, section};
use evfocusd::VirtualRig;
use hil_sim::{Fault, FaultKind, FaultTrigger};

/// Calibrates a lens with `play` counts between what it says and the glass.
fn calibrate(name: &str, play: f64) -> Result<(VirtualRig, Calibration)> {
    let mut config = config(section(name)?, 1)?;
    config.rig.lens.backlash = play;
    let mut rig = VirtualRig::new(&config)?;
    let known = rig.calibrate().map_err(|failure| anyhow::anyhow!("{failure:?}"))?;
    println!("{name}, play {play}: {known:?}");
    Ok((rig, known))
}

/// What a lens is truly like.
struct Truth {
    speed: f64,
    play: f64,
    /// Positions per second, at least and at most.
    read_back_hz: [f64; 2],
    /// From order to motion, and from the order to stop to standstill, milliseconds, at most.
    obeys_ms: f64,
    stops_ms: [f64; 2],
}

fn check(name: &str, truth: &Truth) -> Result<()> {
    let (rig, known) = calibrate(name, truth.play)?;
    assert!((known.range.min - 220.0).abs() <= 3.0 && (known.range.max - 3750.0).abs() <= 3.0, "{known:?}");
    assert!((known.speed_counts_per_s / truth.speed - 1.0).abs() < 0.02, "{name}: {known:?}");
    let [least, most] = truth.read_back_hz;
    assert!((least..=most).contains(&known.read_back_hz), "{name}: {known:?}");
    assert!(known.command_latency_us <= truth.obeys_ms * 1e3, "{name}: {known:?}");
    let [least, most] = truth.stops_ms;
    assert!((least..=most).contains(&(known.stop_us * 1e-3)), "{name}: {known:?}");
    let backlash = known.backlash.context("the play")?;
    assert!((backlash - truth.play).abs() <= 5.0, "{name}: {backlash} counts of {}", truth.play);
    // It stands where it stood.
    let glass = rig.rig().glass(rig.now());
    assert!(glass.distance(LensPosition(220.0 + truth.play)) <= 3.0, "{glass}");
    // The settings are those of a calibrated lens.
    let settings = rig.controller().config();
    assert!((settings.backlash - backlash).abs() < 1e-9);
    Ok(())
}

#[test]
fn moonlite() -> Result<()> {
    // 20 000 counts/s^2: 50 ms from full speed.
    check(
        "moonlite",
        &Truth {
            speed: 1000.0,
            play: 40.0,
            read_back_hz: [40.0, 110.0],
            obeys_ms: 60.0,
            stops_ms: [30.0, 80.0],
        },
    )
}

#[test]
fn optotune() -> Result<()> {
    // Glass without a motor has no play; it stops where its set-point does.
    check(
        "optotune",
        &Truth {
            speed: 1765.0,
            play: 0.0,
            read_back_hz: [300.0, 1000.0],
            obeys_ms: 10.0,
            stops_ms: [0.0, 20.0],
        },
    )
}

#[test]
fn grbl() -> Result<()> {
    check(
        "grbl",
        &Truth {
            speed: 1765.0,
            play: 40.0,
            read_back_hz: [35.0, 50.0],
            obeys_ms: 40.0,
            stops_ms: [60.0, 120.0],
        },
    )
}

#[test]
fn firmata() -> Result<()> {
    check(
        "firmata",
        &Truth {
            speed: 900.0,
            play: 15.0,
            read_back_hz: [400.0, 1000.0],
            obeys_ms: 60.0,
            stops_ms: [20.0, 80.0],
        },
    )
}

#[test]
fn labjack() -> Result<()> {
    check(
        "labjack",
        &Truth {
            speed: 900.0,
            play: 15.0,
            read_back_hz: [400.0, 1000.0],
            obeys_ms: 60.0,
            stops_ms: [20.0, 80.0],
        },
    )
}

#[test]
fn indi() -> Result<()> {
    check(
        "indi",
        &Truth {
            speed: 1765.0,
            play: 40.0,
            read_back_hz: [40.0, 60.0],
            obeys_ms: 40.0,
            stops_ms: [60.0, 140.0],
        },
    )
}

/// A MoonLite that is four times slower than its configuration says: runs time out, and after a calibration they do not.
#[test]
fn a_lens_that_is_slower_than_it_is_said_to_be_focuses_once_it_is_calibrated() -> Result<()> {
    let mut config = config(section("moonlite")?, 1)?;
    config.rig.lens.max_speed = LensSpeed::new(250.0)?;
    config.rig.lens.backlash = 30.0;
    let mut rig = VirtualRig::new(&config)?;
    let known = rig.calibrate().map_err(|failure| anyhow::anyhow!("{failure:?}"))?;
    println!("{known:?}");
    assert!((known.speed_counts_per_s - 250.0).abs() < 5.0, "{known:?}");
    assert!((rig.controller().config().sweep_speed.counts_per_second() - 250.0).abs() < 5.0);
    let report = rig.focus(FocusRequest::default(), |_, _, _| {})?;
    let truth = *rig.truth().first().context("a truth")?;
    let Outcome::Focused { position } = report.outcome else { anyhow::bail!("{:?}", report.outcome) };
    println!("focused at {position}, truth {truth}");
    assert!(position.distance(truth) < 5.0, "{position} for {truth}");
    Ok(())
}

/// Where the glass goes after the calibration has ended.
fn goes_on(rig: &mut VirtualRig) -> f64 {
    rig.run_for(Duration::from_millis(400));
    let before = rig.rig().glass(rig.now());
    rig.run_for(Duration::from_secs(1));
    rig.rig().glass(rig.now()).distance(before)
}

#[test]
fn a_fault_on_the_way_ends_it_with_its_name_and_the_lens_stopped() -> Result<()> {
    for (name, kind, reasons) in [
        ("moonlite", FaultKind::LensUnplugged, &["lens-lost"][..]),
        ("grbl", FaultKind::LensUnplugged, &["lens-lost"]),
        ("indi", FaultKind::LensUnplugged, &["lens-lost"]),
        ("labjack", FaultKind::LensSilent, &["lens-silent"]),
        ("firmata", FaultKind::LensStalled, &["lens-not-moving"]),
    ] {
        let mut config = config(section(name)?, 1)?;
        let trigger = FaultTrigger::AtPosition(LensPosition(1500.0));
        config.rig.faults = vec![Fault { kind, trigger }];
        let mut rig = VirtualRig::new(&config)?;
        let Err(failure) = rig.calibrate() else { anyhow::bail!("{name} was calibrated") };
        println!("{name}: {failure:?}");
        assert!(reasons.contains(&failure.reason), "{name}: {failure:?}");
        if kind != FaultKind::LensSilent {
            assert!(goes_on(&mut rig) < 1.0, "{name}");
        }
    }
    Ok(())
}

#[test]
fn soft_limits_are_kept_to() -> Result<()> {
    let mut config = config(section("indi")?, 1)?;
    config.lens_max = Some(LensPosition(3000.0));
    let mut rig = VirtualRig::new(&config)?;
    let known = rig.calibrate().map_err(|failure| anyhow::anyhow!("{failure:?}"))?;
    assert!((known.range.max - 3000.0).abs() < 2.0, "{known:?}");
    assert!(rig.now() > HostMicros(0));
    Ok(())
}

/// A rig whose lens comes to the ends of its way, at 400 and 3300 counts, before its limits.
fn too_short(name: &str) -> Result<VirtualRig> {
    let mut config = config(section(name)?, 1)?;
    config.rig.lens.ends = Some(LensRange::new(LensPosition(400.0), LensPosition(3300.0))?);
    config.rig.lens.start = LensPosition(1000.0);
    Ok(VirtualRig::new(&config)?)
}

#[test]
fn a_lens_that_reads_its_position_finds_the_ends_of_its_way_and_keeps_off_them() -> Result<()> {
    for name in ["firmata", "labjack"] {
        let mut rig = too_short(name)?;
        let known = rig.calibrate().map_err(|failure| anyhow::anyhow!("{name}: {failure:?}"))?;
        println!("{name}: {known:?}");
        assert!((400.0..440.0).contains(&known.range.min), "{known:?}");
        assert!((3260.0..3300.0).contains(&known.range.max), "{known:?}");
        assert_eq!(
            known.notes.iter().filter(|note| note.contains("an end of its way")).count(),
            2,
            "{known:?}"
        );
        assert!((known.speed_counts_per_s / 900.0 - 1.0).abs() < 0.02, "{known:?}");
        assert!(known.backlash.is_some(), "{known:?}");
        // Runs keep off them too.
        let report = rig.focus(FocusRequest::default(), |_, _, _| {})?;
        let truth = *rig.truth().first().context("a truth")?;
        let Outcome::Focused { position } = report.outcome else { anyhow::bail!("{:?}", report.outcome) };
        println!("{name}: focused at {position}, truth {truth}");
        assert!(position.distance(truth) < 5.0, "{position} for {truth}");
    }
    Ok(())
}

/// A stepper slips at an end and counts on. Nothing on its line tells; that the ways up and down disagree does.
#[test]
fn a_lens_that_counts_steps_and_lost_some_at_an_end_is_not_taken_for_calibrated() -> Result<()> {
    for name in ["moonlite", "indi"] {
        let mut rig = too_short(name)?;
        let Err(failure) = rig.calibrate() else { anyhow::bail!("{name} was calibrated") };
        println!("{name}: {failure:?}");
        assert_eq!(failure.reason, "direction-mismatch", "{name}: {failure:?}");
        assert!(failure.message.contains("narrow lens.min_counts"), "{failure:?}");
        assert!(goes_on(&mut rig) < 1.0, "{name}");
    }
    Ok(())
}

#[test]
fn a_limit_switch_within_the_limits_ends_it_with_the_lens_stopped() -> Result<()> {
    let mut rig = too_short("grbl")?;
    let Err(failure) = rig.calibrate() else { anyhow::bail!("it was calibrated") };
    println!("{failure:?}: {:?}", rig.lens_error());
    assert_eq!(failure.reason, "lens-fault", "{failure:?}");
    assert!(failure.message.contains("narrow lens.min_counts"), "{failure:?}");
    assert!(rig.lens_error().is_some_and(|error| error.what.contains("ALARM:1")), "{:?}", rig.lens_error());
    assert!(goes_on(&mut rig) < 1.0);
    Ok(())
}

/// An open loop is where it was told to be. All that it can say is that it cannot say it.
#[test]
fn a_liquid_lens_that_sticks_is_not_seen_and_the_calibration_says_so() -> Result<()> {
    let mut config = config(section("optotune")?, 1)?;
    let trigger = FaultTrigger::AtPosition(LensPosition(1500.0));
    config.rig.faults = vec![Fault { kind: FaultKind::LensStalled, trigger }];
    let mut rig = VirtualRig::new(&config)?;
    let known = rig.calibrate().map_err(|failure| anyhow::anyhow!("{failure:?}"))?;
    println!("{known:?}");
    assert!(known.notes.iter().any(|note| note.contains("one that sticks is not seen")), "{known:?}");
    assert!(known.notes.iter().any(|note| note.contains("play was not measured")), "{known:?}");
    assert_eq!(known.backlash, None);
    Ok(())
}
