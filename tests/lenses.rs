//! Whole focus runs through each lens driver and the model of its device, in virtual time: bytes on a line between the
//! controller and the lens that the simulated camera looks through.

#![expect(clippy::print_stdout, reason = "the figures belong in the output")]

use std::path::Path;

use anyhow::{Context, Result};
use evfocus_core::controller::FocusRequest;
use evfocus_core::{LensPosition, Outcome};
use evfocusd::config::LensBackend;
use evfocusd::{Config, VirtualRig};
use hil_sim::{Fault, FaultKind, FaultTrigger};

/// Mean errors below this are good enough, whatever the plain lens does: a blur of one pixel is 50 counts here.
const GOOD_ENOUGH: f64 = 1.0;
/// How much worse than the plain simulated lens a lens may be behind its protocol.
const LARGEST_RATIO: f64 = 1.5;

fn config(lens: &str, seed: u64) -> Result<Config> {
    Ok(Config::parse(&format!("[simulation]\nseed = {seed}\n[lens]\n{lens}"), Path::new("(in the test)"))?)
}

/// Error against truth, counts, and the run's length, seconds.
fn focus(config: &Config) -> Result<(f64, f64)> {
    let mut rig = VirtualRig::new(config)?;
    let report = rig.focus(FocusRequest::default(), |_, _, _| {})?;
    let truth = rig.truth();
    let truth = truth.first().context("a truth")?;
    match report.outcome {
        Outcome::Focused { position } => Ok((position.counts_from(*truth), report.elapsed().as_secs_f64())),
        Outcome::Failed(_) | Outcome::Aborted => anyhow::bail!("not focused: {:?}", report.outcome),
    }
}

/// Runs the lens of `section` and the plain one of the same range and speed on several seeds, prints both, and compares.
fn compare(name: &str, section: &str) -> Result<()> {
    let (mut behind, mut plain) = (0.0, 0.0);
    let seeds = [1, 2];
    for seed in seeds {
        let wired = config(section, seed)?;
        let direct = Config { lens: LensBackend::Simulated, ..wired.clone() };
        let ((error, elapsed), (plain_error, plain_elapsed)) = (focus(&wired)?, focus(&direct)?);
        println!(
            "{name}, seed {seed}: error {error:+.2} in {elapsed:.1} s; plain lens {plain_error:+.2} in {plain_elapsed:.1} s"
        );
        behind += error.abs() / seeds.len() as f64;
        plain += plain_error.abs() / seeds.len() as f64;
    }
    println!("{name}: mean error {behind:.2}; plain lens {plain:.2}");
    assert!(behind <= (LARGEST_RATIO * plain).max(GOOD_ENOUGH), "{name}: {behind:.2} against {plain:.2}");
    Ok(())
}

/// Each driver before the model of its device.
const MOONLITE: &str =
    "backend = \"moonlite\"\nport = \"emulated\"\nmin_counts = 220\nmax_counts = 3750\npoll_ms = 1
    [lens.moonlite]\nmax_speed_counts_per_s = 1000";
const OPTOTUNE: &str = "backend = \"optotune\"\nport = \"emulated\"\npoll_ms = 1
    [lens.optotune]\nmax_speed_counts_per_s = 1765";
const GRBL: &str =
    "backend = \"grbl\"\nport = \"emulated\"\nmin_counts = 220\nmax_counts = 3750\npoll_ms = 20";
const FIRMATA: &str =
    "backend = \"firmata\"\nport = \"emulated\"\nmin_counts = 220\nmax_counts = 3750\npoll_ms = 2";
const LABJACK: &str =
    "backend = \"labjack\"\naddress = \"emulated\"\nmin_counts = 220\nmax_counts = 3750\npoll_ms = 2";
const INDI: &str = "backend = \"indi\"\naddress = \"emulated\"\npoll_ms = 2
    [lens.indi]\ndevice = \"Focuser\"\nmax_speed_counts_per_s = 1765";

#[test]
fn moonlite_focuses_as_well_as_the_plain_lens() -> Result<()> {
    compare("moonlite", MOONLITE)
}

#[test]
fn optotune_focuses_as_well_as_the_plain_lens() -> Result<()> {
    compare("optotune", OPTOTUNE)
}

#[test]
fn grbl_focuses_as_well_as_the_plain_lens() -> Result<()> {
    compare("grbl", GRBL)
}

#[test]
fn firmata_focuses_as_well_as_the_plain_lens() -> Result<()> {
    compare("firmata", FIRMATA)
}

#[test]
fn labjack_focuses_as_well_as_the_plain_lens() -> Result<()> {
    compare("labjack", LABJACK)
}

#[test]
fn indi_focuses_as_well_as_the_plain_lens() -> Result<()> {
    compare("indi", INDI)
}

/// A run in which `kind` strikes in the middle of the first sweep: the reason that it gives, and how far the glass went on.
fn fail(section: &str, kind: FaultKind) -> Result<(&'static str, f64)> {
    let mut config = config(section, 1)?;
    let struck = LensPosition(1500.0);
    config.rig.faults = vec![Fault { kind, trigger: FaultTrigger::AtPosition(struck) }];
    let mut rig = VirtualRig::new(&config)?;
    let report = rig.focus(FocusRequest::default(), |_, _, _| {})?;
    let reason = match report.outcome {
        Outcome::Failed(failure) => failure.name(),
        Outcome::Focused { .. } => "focused",
        Outcome::Aborted => "aborted",
    };
    Ok((reason, rig.rig().glass(rig.now()).distance(struck)))
}

#[test]
fn a_cable_pulled_in_mid_sweep_is_a_lost_lens() -> Result<()> {
    for section in [MOONLITE, OPTOTUNE, GRBL, FIRMATA, LABJACK, INDI] {
        assert_eq!(fail(section, FaultKind::LensUnplugged)?.0, "lens-lost", "{section}");
    }
    Ok(())
}

#[test]
fn a_lens_that_falls_silent_in_mid_sweep_is_named() -> Result<()> {
    for section in [MOONLITE, OPTOTUNE, GRBL, FIRMATA, LABJACK] {
        let (reason, further) = fail(section, FaultKind::LensSilent)?;
        println!("{section}: {reason}, {further:.0} counts further");
        assert_eq!(reason, "lens-silent", "{section}");
    }
    // A server that says nothing of a motion is one whose focuser does not move.
    assert_eq!(fail(INDI, FaultKind::LensSilent)?.0, "lens-stopped-short");
    Ok(())
}

#[test]
fn a_lens_that_sticks_in_mid_sweep_does_not_focus() -> Result<()> {
    for section in [MOONLITE, OPTOTUNE, GRBL, FIRMATA, LABJACK, INDI] {
        let (reason, further) = fail(section, FaultKind::LensStalled)?;
        println!("{section}: {reason}, {further:.0} counts further");
        assert!(!["focused", "aborted"].contains(&reason), "{section}: {reason}");
    }
    Ok(())
}
