//! MoonLite: driver against model.

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::{LensPosition, LensRange, LensSpeed};
use evfocus_hal::{DeviceError, DeviceErrorKind, Lens, conformance};
use evfocus_lens::Port;
use evfocus_lens::moonlite::{BAUD, MoonLite, MoonLiteConfig};
use hil_sim::LensConfig;
use hil_sim::wire::{Protocol, Server, WireFault};

use crate::bench::{Bench, says, stands};

const SPEED: f64 = 1000.0;

/// A stepper: fast for its kind, so that tests are short.
pub(crate) fn motor() -> LensConfig {
    LensConfig { max_speed: LensSpeed::new(SPEED).unwrap(), ..LensConfig::default() }
}

pub(crate) fn config() -> MoonLiteConfig {
    MoonLiteConfig {
        range: LensRange::new(LensPosition(220.0), LensPosition(3750.0)).unwrap(),
        max_speed: LensSpeed::new(SPEED).unwrap(),
        step_mode: None,
    }
}

fn bench() -> Bench {
    Bench::new(Protocol::MoonLite, motor())
}

fn open(bench: &Bench) -> Result<MoonLite, DeviceError> {
    MoonLite::open(bench.port(), config(), Arc::clone(&bench.clock))
}

#[test]
fn it_conforms() {
    conformance::lens(|| {
        let bench = bench();
        (Box::new(open(&bench).unwrap()), bench.clock)
    })
    .unwrap();
}

#[test]
fn positions_come_at_the_rate_of_the_line_and_belong_to_their_time() {
    let bench = bench();
    let mut lens = open(&bench).unwrap();
    lens.move_to(LensPosition(3750.0), config().max_speed).unwrap();
    bench.wait(Duration::from_millis(500));
    let began = bench.now();
    for _ in 0..100 {
        let sample = lens.sample().unwrap();
        let glass = bench.rig.glass(sample.time());
        assert!(sample.position.distance(glass) <= 1.2, "{} while at {glass}", sample.position);
    }
    let rate = 100.0 / bench.now().since(began).as_secs_f64();
    println!("{rate:.0} positions/s");
    assert!(rate > 90.0, "{rate}");
}

#[test]
fn what_is_wrong_with_the_line_is_named() {
    for (fault, kind, words) in [
        (WireFault::Silence, DeviceErrorKind::TimedOut, &["no answer to \":GP#\"", "300ms", "baud rate"][..]),
        (WireFault::Garbage, DeviceErrorKind::Protocol, &["is no answer to \":GP#\"", "baud rate"]),
        (WireFault::HalfReplies, DeviceErrorKind::Protocol, &["is no answer to"]),
        (WireFault::Unplugged, DeviceErrorKind::Disconnected, &["MoonLite focuser simulated", "unplugged"]),
        (WireFault::PositionJump(500.0), DeviceErrorKind::Fault, &["leapt from", "reset"]),
    ] {
        let bench = bench();
        let mut lens = open(&bench).unwrap();
        lens.sample().unwrap();
        bench.wire.strike(fault);
        let error = lens.sample().unwrap_err();
        assert_eq!(error.kind, kind, "{fault:?}");
        says(&error, words);
        bench.wire.repair();
        lens.sample().unwrap();
    }
}

#[test]
fn slow_answers_are_waited_for() {
    let bench = bench();
    let mut lens = open(&bench).unwrap();
    bench.wire.strike(WireFault::SlowReplies(Duration::from_millis(15)));
    lens.move_to(LensPosition(1000.0), config().max_speed).unwrap();
    assert!(bench.rest(&mut lens, Duration::from_secs(3)).position.distance(LensPosition(1000.0)) < 1.0);
}

#[test]
fn a_lens_that_comes_back_is_stopped_and_goes_on() {
    let bench = bench();
    let mut lens = open(&bench).unwrap();
    lens.move_to(LensPosition(3750.0), config().max_speed).unwrap();
    bench.wait(Duration::from_millis(300));
    bench.wire.strike(WireFault::Unplugged);
    assert_eq!(lens.sample().unwrap_err().kind, DeviceErrorKind::Disconnected);
    assert_eq!(lens.stop().unwrap_err().kind, DeviceErrorKind::Disconnected);
    bench.wire.repair();
    lens.sample().unwrap();
    stands(&bench);
    lens.move_to(LensPosition(400.0), config().max_speed).unwrap();
    bench.rest(&mut lens, Duration::from_secs(6));
    assert!(bench.glass().distance(LensPosition(400.0)) < 1.0);
}

#[test]
fn a_controller_that_resets_in_a_motion_is_noticed() {
    let bench = bench();
    let mut lens = open(&bench).unwrap();
    lens.move_to(LensPosition(3000.0), config().max_speed).unwrap();
    bench.wait(Duration::from_secs(1));
    lens.sample().unwrap();
    bench.wire.strike(WireFault::Reset);
    assert_eq!(lens.sample().unwrap_err().kind, DeviceErrorKind::TimedOut, "it boots");
    bench.wait(Duration::from_secs(2));
    says(&lens.sample().unwrap_err(), &["forgotten its target 3000 for 0", "reset"]);
    lens.sample().unwrap();
    stands(&bench);
}

#[test]
fn dropping_it_stops_it() {
    let bench = bench();
    let mut lens = open(&bench).unwrap();
    lens.move_to(LensPosition(3750.0), config().max_speed).unwrap();
    bench.wait(Duration::from_millis(300));
    drop(lens);
    stands(&bench);
    assert!(bench.glass().0 < 1000.0);
}

#[test]
fn a_port_that_is_not_there_is_named() {
    let bench = bench();
    let port = Port::serial("/dev/no-such-port", BAUD, Arc::clone(&bench.clock));
    let error = MoonLite::open(port, config(), Arc::clone(&bench.clock)).unwrap_err();
    assert_eq!(error.kind, DeviceErrorKind::Disconnected);
    says(&error, &["/dev/no-such-port", "no such port", "serial ports"]);
}

#[test]
fn another_device_on_the_port_is_named() {
    let bench = bench();
    bench.wire.strike(WireFault::Garbage);
    let error = open(&bench).unwrap_err();
    assert_eq!(error.kind, DeviceErrorKind::Protocol);
    says(&error, &["\":GV#\"", "MoonLite"]);
}

#[test]
fn it_works_over_a_pseudo_terminal_which_only_one_can_hold() {
    let bench = Bench::live(Protocol::MoonLite, motor());
    let server = Server::pty(bench.wire.clone()).unwrap();
    let serial = || Port::serial(server.address(), BAUD, Arc::clone(&bench.clock));
    let mut lens = MoonLite::open(serial(), config(), Arc::clone(&bench.clock)).unwrap();
    lens.move_to(LensPosition(320.0), config().max_speed).unwrap();
    assert!(bench.rest(&mut lens, Duration::from_secs(20)).position.distance(LensPosition(320.0)) < 1.0);
    let error = MoonLite::open(serial(), config(), Arc::clone(&bench.clock)).unwrap_err();
    assert_eq!(error.kind, DeviceErrorKind::Busy, "{error}");
}
