//! INDI: driver against model.

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::{LensPosition, LensSpeed};
use evfocus_hal::{DeviceError, DeviceErrorKind, Lens, conformance};
use evfocus_lens::indi::{IndiConfig, Setting};
use evfocus_lens::{Indi, Port};
use hil_sim::LensConfig;
use hil_sim::wire::{Protocol, Server, WireFault};

use crate::bench::{Bench, says, stands};

pub(crate) fn motor() -> LensConfig {
    LensConfig {
        max_speed: LensSpeed::new(1000.0).unwrap(),
        start: LensPosition(1000.0),
        ..LensConfig::default()
    }
}

pub(crate) fn config() -> IndiConfig {
    IndiConfig {
        device: "Focuser".to_owned(),
        settings: vec![Setting {
            property: "DEVICE_PORT".to_owned(),
            member: "PORT".to_owned(),
            value: "/dev/ttyUSB3".to_owned(),
        }],
        polling: Duration::from_millis(20),
        max_speed: LensSpeed::new(1000.0).unwrap(),
        set_speed: true,
        without_abort: false,
    }
}

fn bench() -> Bench {
    Bench::new(Protocol::Indi, motor())
}

fn open(bench: &Bench, config: IndiConfig) -> Result<Indi, DeviceError> {
    Indi::open(bench.port(), config, Arc::clone(&bench.clock))
}

#[test]
fn it_conforms() {
    conformance::lens(|| {
        let bench = bench();
        (Box::new(open(&bench, config()).unwrap()), bench.clock)
    })
    .unwrap();
}

#[test]
fn updates_are_dated_by_their_arrival() {
    let bench = bench();
    let mut lens = open(&bench, config()).unwrap();
    lens.move_to(LensPosition(3700.0), config().max_speed).unwrap();
    lens.sample().unwrap();
    let mut worst = 0.0_f64;
    for _ in 0..50 {
        let sample = lens.sample().unwrap();
        worst = worst.max(sample.position.distance(bench.rig.glass(sample.time())));
    }
    println!("within {worst:.2} counts at 1000 counts/s");
    assert!(worst < 1.5, "{worst}");
}

#[test]
fn what_is_missing_is_named() {
    let bench = bench();
    let error = open(&bench, IndiConfig { device: "Telescope".to_owned(), ..config() }).unwrap_err();
    assert_eq!(error.kind, DeviceErrorKind::TimedOut);
    says(&error, &["\"Telescope\" has no CONNECTION", "spelt"]);
    let mut wrong = config();
    wrong.settings[0].property = "SIMULATION".to_owned();
    says(&open(&bench, wrong).unwrap_err(), &["has no SIMULATION", "correct its name"]);
}

#[test]
fn what_goes_wrong_is_named() {
    let bench = bench();
    let mut lens = open(&bench, config()).unwrap();
    lens.sample().unwrap();
    bench.wire.strike(WireFault::PositionJump(500.0));
    lens.move_to(LensPosition(1200.0), config().max_speed).unwrap();
    says(&lens.sample().unwrap_err(), &["leapt from 1000.0 to"]);
    bench.wire.strike(WireFault::Unplugged);
    assert_eq!(lens.sample().unwrap_err().kind, DeviceErrorKind::Disconnected);
    bench.wire.repair();
    bench.rest(&mut lens, Duration::from_secs(2));
    bench.wire.strike(WireFault::Silence);
    lens.move_to(LensPosition(3000.0), config().max_speed).unwrap();
    let end = bench.now() + Duration::from_secs(20);
    let error = loop {
        match lens.sample() {
            Ok(_) => assert!(bench.now() < end),
            Err(error) => break error,
        }
    };
    assert_eq!(error.kind, DeviceErrorKind::TimedOut);
    says(&error, &["is not at 3000", "long after"]);
}

#[test]
fn dropping_it_stops_it() {
    let bench = bench();
    let mut lens = open(&bench, config()).unwrap();
    lens.move_to(LensPosition(3700.0), config().max_speed).unwrap();
    bench.wait(Duration::from_millis(300));
    drop(lens);
    stands(&bench);
    assert!(bench.glass().0 < 1500.0);
}

#[test]
fn it_works_over_a_socket() {
    let bench = Bench::live(Protocol::Indi, motor());
    let server = Server::tcp(bench.wire.clone()).unwrap();
    let port = Port::tcp(server.address(), Arc::clone(&bench.clock));
    let mut lens = Indi::open(port, config(), Arc::clone(&bench.clock)).unwrap();
    lens.move_to(LensPosition(1100.0), config().max_speed).unwrap();
    assert!(bench.rest(&mut lens, Duration::from_secs(20)).position.distance(LensPosition(1100.0)) < 1.0);
}
