//! GRBL: driver against model.

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::{LensPosition, LensRange, LensSpeed};
use evfocus_hal::{DeviceError, DeviceErrorKind, Lens, conformance};
use evfocus_lens::grbl::protocol::Axis;
use evfocus_lens::grbl::{BAUD, GrblConfig};
use evfocus_lens::{Grbl, Port};
use hil_sim::LensConfig;
use hil_sim::wire::{Protocol, Server, WireFault};

use crate::bench::{Bench, says, stands};

pub(crate) fn motor(needs_homing: bool) -> LensConfig {
    LensConfig {
        max_speed: LensSpeed::new(1000.0).unwrap(),
        needs_homing,
        start: LensPosition(1000.0),
        ..LensConfig::default()
    }
}

pub(crate) fn config(needs_homing: bool) -> GrblConfig {
    let range = LensRange::new(LensPosition(220.0), LensPosition(3750.0)).unwrap();
    GrblConfig { axis: Axis::X, range, needs_homing }
}

fn bench() -> Bench {
    Bench::new(Protocol::Grbl, motor(false))
}

fn open(bench: &Bench) -> Result<Grbl, DeviceError> {
    Grbl::open(bench.port(), config(false), Arc::clone(&bench.clock))
}

fn fast() -> LensSpeed {
    LensSpeed::new(1000.0).unwrap()
}

#[test]
fn it_conforms() {
    for needs_homing in [false, true] {
        conformance::lens(|| {
            let bench = Bench::new(Protocol::Grbl, motor(needs_homing));
            let lens = Grbl::open(bench.port(), config(needs_homing), Arc::clone(&bench.clock));
            (Box::new(lens.unwrap()), bench.clock)
        })
        .unwrap();
    }
}

#[test]
fn its_settings_are_read() {
    let lens = open(&bench()).unwrap();
    assert!((lens.info().max_speed.counts_per_second() - 1000.0).abs() < 1e-6);
}

#[test]
fn what_is_wrong_with_the_line_is_named() {
    for (fault, kind, words) in [
        (WireFault::Silence, DeviceErrorKind::TimedOut, &["no status report", "300ms"][..]),
        (WireFault::Garbage, DeviceErrorKind::TimedOut, &["no status report"]),
        (WireFault::HalfReplies, DeviceErrorKind::TimedOut, &["no status report"]),
        (WireFault::Unplugged, DeviceErrorKind::Disconnected, &["GRBL", "unplugged"]),
        (WireFault::PositionJump(-700.0), DeviceErrorKind::Fault, &["leapt from 1000.0 to 300.0"]),
    ] {
        let bench = bench();
        let mut lens = open(&bench).unwrap();
        lens.sample().unwrap();
        bench.wire.strike(fault);
        let error = lens.sample().unwrap_err();
        assert_eq!(error.kind, kind, "{fault:?}: {error}");
        says(&error, words);
        bench.wire.repair();
        lens.sample().unwrap();
    }
}

#[test]
fn a_reset_in_a_motion_is_named_and_the_lens_goes_on_after_it() {
    let bench = bench();
    let mut lens = open(&bench).unwrap();
    lens.move_to(LensPosition(3000.0), fast()).unwrap();
    bench.wait(Duration::from_millis(500));
    lens.sample().unwrap();
    bench.wire.strike(WireFault::Reset);
    assert_eq!(lens.sample().unwrap_err().kind, DeviceErrorKind::TimedOut, "it boots");
    bench.wait(Duration::from_secs(2));
    says(&lens.sample().unwrap_err(), &["reset", "home it"]);
    stands(&bench);
}

#[test]
fn a_locked_machine_says_so_and_homing_unlocks_it() {
    let bench = Bench::new(Protocol::Grbl, motor(true));
    let mut lens = Grbl::open(bench.port(), config(true), Arc::clone(&bench.clock)).unwrap();
    assert!(!lens.sample().unwrap().moving);
    says(&lens.move_to(LensPosition(500.0), fast()).unwrap_err(), &["error:9", "locked", "home"]);
    lens.home().unwrap();
    bench.wait(Duration::from_millis(100));
    assert!(lens.sample().unwrap().moving);
    lens.stop().unwrap();
    stands(&bench);
    lens.home().unwrap();
    bench.rest(&mut lens, Duration::from_secs(10));
    lens.move_to(LensPosition(500.0), fast()).unwrap();
    assert!(bench.rest(&mut lens, Duration::from_secs(10)).position.distance(LensPosition(500.0)) < 1.0);
}

#[test]
fn a_machine_without_switches_is_not_homed() {
    let error = Grbl::open(bench().port(), config(true), bench().clock).unwrap_err();
    says(&error, &["homing is off", "$22=1"]);
}

#[test]
fn limits_that_are_wider_than_the_machine_are_named() {
    let bench = bench();
    let range = LensRange::new(LensPosition(0.0), LensPosition(9000.0)).unwrap();
    let mut lens =
        Grbl::open(bench.port(), GrblConfig { range, ..config(false) }, Arc::clone(&bench.clock)).unwrap();
    says(&lens.move_to(LensPosition(8000.0), fast()).unwrap_err(), &["error:15", "outside of its travel"]);
    assert!(!lens.sample().unwrap().moving);
}

#[test]
fn dropping_it_stops_it() {
    let bench = bench();
    let mut lens = open(&bench).unwrap();
    lens.move_to(LensPosition(3750.0), fast()).unwrap();
    bench.wait(Duration::from_millis(300));
    drop(lens);
    stands(&bench);
    assert!(bench.glass().0 < 1500.0);
}

#[test]
fn it_works_over_a_pseudo_terminal() {
    let bench = Bench::live(Protocol::Grbl, motor(false));
    let server = Server::pty(bench.wire.clone()).unwrap();
    let port = Port::serial(server.address(), BAUD, Arc::clone(&bench.clock));
    let mut lens = Grbl::open(port, config(false), Arc::clone(&bench.clock)).unwrap();
    lens.move_to(LensPosition(1100.0), fast()).unwrap();
    assert!(bench.rest(&mut lens, Duration::from_secs(20)).position.distance(LensPosition(1100.0)) < 1.0);
}
