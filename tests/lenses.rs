//! Whole focus runs through each lens driver and the model of its device, in virtual time: bytes on a line between the
//! controller and the lens that the simulated camera looks through.

#![expect(clippy::print_stdout, reason = "the figures belong in the output")]

use std::time::Duration;

use anyhow::{Context, Result};
use evfocus_core::Outcome;
use evfocus_core::controller::FocusRequest;
use evfocus_hal::DeviceErrorKind;
use evfocus_tests::lens_faults::{Aftermath, MidSweep, Opening, open_error, strike};
use evfocus_tests::lenses::{LENSES, config, section};
use evfocusd::config::LensBackend;
use evfocusd::{Config, VirtualRig};

/// Mean errors below this are good enough, whatever the plain lens does: a blur of one pixel is 50 counts here.
const GOOD_ENOUGH: f64 = 1.0;
/// How much worse than the plain simulated lens a lens may be behind its protocol.
const LARGEST_RATIO: f64 = 1.5;

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
fn compare(name: &str) -> Result<()> {
    let (mut behind, mut plain) = (0.0, 0.0);
    let seeds = [1, 2];
    for seed in seeds {
        let wired = config(section(name)?, seed)?;
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

#[test]
fn moonlite_focuses_as_well_as_the_plain_lens() -> Result<()> {
    compare("moonlite")
}

#[test]
fn optotune_focuses_as_well_as_the_plain_lens() -> Result<()> {
    compare("optotune")
}

#[test]
fn grbl_focuses_as_well_as_the_plain_lens() -> Result<()> {
    compare("grbl")
}

#[test]
fn firmata_focuses_as_well_as_the_plain_lens() -> Result<()> {
    compare("firmata")
}

#[test]
fn labjack_focuses_as_well_as_the_plain_lens() -> Result<()> {
    compare("labjack")
}

#[test]
fn indi_focuses_as_well_as_the_plain_lens() -> Result<()> {
    compare("indi")
}

/// How much longer than its stopping time a lens may move after a fault that leaves it able to hear.
const REACTION: Duration = Duration::from_millis(100);

/// Strikes with `fault` in the middle of a sweep through every driver; the reasons, in the order of [`LENSES`].
fn strike_all(fault: MidSweep) -> Result<Vec<Aftermath>> {
    LENSES
        .iter()
        .map(|lens| {
            let came = strike(lens, fault)?;
            println!("{}, {}: {came}", fault.name(), lens.name);
            assert!(
                came.moved_on <= REACTION + came.stopping || fault == MidSweep::Unplugged,
                "{}: {came}",
                lens.name
            );
            Ok(came)
        })
        .collect()
}

#[test]
fn a_cable_pulled_in_mid_sweep_is_a_lost_lens_and_comes_back() -> Result<()> {
    for came in strike_all(MidSweep::Unplugged)? {
        assert_eq!((came.reason, came.afterwards.as_str()), ("lens-lost", "focused"), "{came}");
    }
    Ok(())
}

#[test]
fn a_lens_that_falls_silent_in_mid_sweep_is_named_stopped_and_comes_back() -> Result<()> {
    for came in strike_all(MidSweep::Silence)? {
        assert_eq!((came.reason, came.afterwards.as_str()), ("lens-silent", "focused"), "{came}");
    }
    Ok(())
}

#[test]
fn garbage_in_mid_sweep_is_named_and_the_lens_stopped() -> Result<()> {
    for came in strike_all(MidSweep::Garbage)? {
        assert!(["lens-silent", "lens-fault", "lens-lost"].contains(&came.reason), "{came}");
        assert_eq!(came.afterwards, "focused", "{came}");
    }
    Ok(())
}

#[test]
fn a_lens_that_sticks_in_mid_sweep_does_not_focus() -> Result<()> {
    for (lens, came) in LENSES.iter().zip(strike_all(MidSweep::Stalled)?) {
        // A lens without read-back is where it was told to be, as far as anybody can tell.
        let is_seen = lens.name != "optotune";
        assert!(!is_seen || !["focused", "aborted", "none"].contains(&came.reason), "{came}");
    }
    Ok(())
}

#[test]
fn what_is_wrong_at_the_start_has_its_name() -> Result<()> {
    for lens in &LENSES {
        let is_tcp = ["labjack", "indi"].contains(&lens.name);
        for (opening, kinds) in [
            (Opening::NoSuchPort, &[DeviceErrorKind::Disconnected][..]),
            (Opening::InUse, &[DeviceErrorKind::Busy]),
            (Opening::OtherDevice, &[DeviceErrorKind::TimedOut, DeviceErrorKind::Protocol]),
            (Opening::Silence, &[DeviceErrorKind::TimedOut]),
            (Opening::WrongBaud, &[DeviceErrorKind::TimedOut, DeviceErrorKind::Protocol]),
        ] {
            if is_tcp && opening == Opening::InUse {
                // A TCP port takes many; what is behind it may not, and then says nothing.
                continue;
            }
            let error = open_error(lens, opening)?;
            assert!(kinds.contains(&error.kind), "{}, {}: {error}", lens.name, opening.name());
        }
    }
    Ok(())
}
