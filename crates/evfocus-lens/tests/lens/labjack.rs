//! LabJack: driver against model.

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::{LensPosition, LensSpeed};
use evfocus_hal::{DeviceError, DeviceErrorKind, Lens, conformance};
use evfocus_lens::labjack::LabJackConfig;
use evfocus_lens::{LabJack, Port};
use hil_sim::LensConfig;
use hil_sim::wire::{Protocol, Server, WireFault};

use crate::bench::{Bench, says, stands};
use crate::firmata::drive;

pub(crate) fn motor() -> LensConfig {
    LensConfig {
        max_speed: drive().max_speed,
        start: LensPosition(1000.0),
        read_noise: 0.5,
        read_resolution: 0.0,
        ..LensConfig::default()
    }
}

pub(crate) fn config() -> LabJackConfig {
    LabJackConfig {
        channel: 0,
        reference_volts: 5.0,
        full_drive_volts: 5.0,
        direction_volts: 5.0,
        drive: drive(),
    }
}

fn bench() -> Bench {
    Bench::new(Protocol::LabJack, motor())
}

fn open(bench: &Bench) -> Result<LabJack, DeviceError> {
    LabJack::open(bench.port(), config(), Arc::clone(&bench.clock))
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
fn it_rests_within_two_counts_and_sweeps_at_the_speed_asked() {
    let mut worst: f64 = 0.0;
    for seed in 0..100 {
        let bench = Bench::seeded(Protocol::LabJack, motor(), seed);
        let mut lens = open(&bench).unwrap();
        assert_eq!(lens.info().serial, "470010042");
        for target in [300.0, 3700.0, 2000.0, 2003.0, 300.0 + (37 * seed % 3400) as f64] {
            let (from, began) = (bench.glass(), bench.now());
            lens.move_to(LensPosition(target), LensSpeed::new(500.0).unwrap()).unwrap();
            bench.rest(&mut lens, Duration::from_secs(12));
            let off = bench.glass().counts_from(LensPosition(target));
            let (way, seconds) = (from.distance(bench.glass()), bench.now().since(began).as_secs_f64());
            worst = worst.max(off.abs());
            assert!(off.abs() <= 2.0, "seed {seed}: {off:+.2} off {target}");
            assert!(
                way < 505.0 * seconds && seconds < way / 500.0 + 0.6,
                "seed {seed}: {way} counts in {seconds} s"
            );
        }
    }
    println!("at most {worst:.2} counts off");
}

#[test]
fn what_is_wrong_is_named_and_the_motor_cut_where_it_can_be() {
    for (fault, kind, words) in [
        (WireFault::Silence, DeviceErrorKind::TimedOut, &["no answer to", "30ms"][..]),
        (WireFault::Garbage, DeviceErrorKind::Protocol, &["not Modbus TCP"]),
        (WireFault::HalfReplies, DeviceErrorKind::Protocol, &["is no answer to"]),
        (WireFault::PositionJump(600.0), DeviceErrorKind::Fault, &["leapt"]),
    ] {
        let bench = bench();
        let mut lens = open(&bench).unwrap();
        lens.move_to(LensPosition(3700.0), config().drive.max_speed).unwrap();
        for _ in 0..100 {
            lens.sample().unwrap();
            bench.wait(Duration::from_millis(2));
        }
        bench.wire.strike(fault);
        let error = lens.sample().unwrap_err();
        assert_eq!(error.kind, kind, "{fault:?}: {error}");
        says(&error, words);
        stands(&bench);
        bench.wire.repair();
        bench.rest(&mut lens, Duration::from_secs(4));
    }
}

#[test]
fn dropping_it_stops_it() {
    let bench = bench();
    let mut lens = open(&bench).unwrap();
    lens.move_to(LensPosition(3700.0), config().drive.max_speed).unwrap();
    for _ in 0..100 {
        lens.sample().unwrap();
        bench.wait(Duration::from_millis(2));
    }
    drop(lens);
    stands(&bench);
}

#[test]
fn an_address_that_nobody_listens_at_is_named() {
    let bench = bench();
    // A port that was free a moment ago.
    let address = Server::tcp(bench.wire.clone()).unwrap().address().to_owned();
    let port = Port::tcp(&address, Arc::clone(&bench.clock));
    let error = LabJack::open(port, config(), Arc::clone(&bench.clock)).unwrap_err();
    assert_eq!(error.kind, DeviceErrorKind::Disconnected);
    says(&error, &[&address, "cannot connect", "running"]);
    let error = LabJack::open(Port::tcp("nowhere", Arc::clone(&bench.clock)), config(), bench.clock);
    says(&error.unwrap_err(), &["nowhere", "host:port"]);
}

#[test]
fn it_works_over_a_socket_and_notices_when_it_closes() {
    let bench = Bench::live(Protocol::LabJack, motor());
    let server = Server::tcp(bench.wire.clone()).unwrap();
    let port = Port::tcp(server.address(), Arc::clone(&bench.clock));
    let mut lens = LabJack::open(port, config(), Arc::clone(&bench.clock)).unwrap();
    lens.move_to(LensPosition(1200.0), config().drive.max_speed).unwrap();
    assert!(bench.rest(&mut lens, Duration::from_secs(20)).position.distance(LensPosition(1200.0)) < 20.0);
    drop(server);
    let error = lens.sample().unwrap_err();
    assert_eq!(error.kind, DeviceErrorKind::Disconnected, "{error}");
}
