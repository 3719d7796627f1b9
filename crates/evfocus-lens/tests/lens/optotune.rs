//! Optotune: driver against model.

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::{LensPosition, LensSpeed};
use evfocus_hal::{DeviceError, DeviceErrorKind, Lens, conformance};
use evfocus_lens::optotune::{BAUD, OptotuneConfig, Quantity, ResponseConfig};
use evfocus_lens::{Optotune, Port};
use hil_sim::LensConfig;
use hil_sim::wire::{Protocol, Server, WireFault};

use crate::bench::{Bench, says, stands};

pub(crate) fn config(quantity: Quantity) -> OptotuneConfig {
    OptotuneConfig {
        quantity,
        max_speed: LensSpeed::new(1765.0).unwrap(),
        response: ResponseConfig::default(),
    }
}

fn bench() -> Bench {
    Bench::new(Protocol::Optotune, LensConfig::default())
}

fn open(bench: &Bench) -> Result<Optotune, DeviceError> {
    Optotune::open(bench.port(), config(Quantity::Current), Arc::clone(&bench.clock))
}

#[test]
fn it_conforms() {
    for quantity in [Quantity::Current, Quantity::FocalPower] {
        conformance::lens(|| {
            let bench = bench();
            let lens = Optotune::open(bench.port(), config(quantity), Arc::clone(&bench.clock));
            (Box::new(lens.unwrap()), bench.clock)
        })
        .unwrap();
    }
}

#[test]
fn the_response_model_says_where_the_glass_is() {
    let bench = bench();
    let mut lens = open(&bench).unwrap();
    lens.move_to(LensPosition(3750.0), lens.info().max_speed).unwrap();
    let (mut worst, mut samples) = (0.0_f64, 0);
    let began = bench.now();
    while lens.sample().unwrap().moving {
        let sample = lens.sample().unwrap();
        worst = worst.max(sample.position.distance(bench.rig.glass(sample.time())));
        samples += 2;
        bench.wait(Duration::from_millis(1));
    }
    let rate = f64::from(samples) / bench.now().since(began).as_secs_f64();
    println!("within {worst:.2} counts at {rate:.0} samples/s");
    assert!(worst < 2.0 && rate > 400.0, "{worst} at {rate}");
}

#[test]
fn what_is_wrong_with_the_line_is_named() {
    for (fault, kind, words) in [
        (WireFault::Silence, DeviceErrorKind::TimedOut, &["no answer to", "100ms"][..]),
        (WireFault::Garbage, DeviceErrorKind::Protocol, &["checksum is wrong", "baud rate"]),
        (WireFault::WrongBit, DeviceErrorKind::Protocol, &["checksum is wrong", "asked 3 times"]),
        (WireFault::Unplugged, DeviceErrorKind::Disconnected, &["Optotune", "unplugged"]),
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
fn a_reset_is_noticed_and_the_device_set_up_anew() {
    for quantity in [Quantity::Current, Quantity::FocalPower] {
        let bench = bench();
        let mut lens = Optotune::open(bench.port(), config(quantity), Arc::clone(&bench.clock)).unwrap();
        lens.move_to(LensPosition(2000.0), lens.info().max_speed).unwrap();
        bench.rest(&mut lens, Duration::from_secs(4));
        bench.wire.strike(WireFault::Reset);
        says(&lens.sample().unwrap_err(), &["was set to 2000, and says 220", "reset"]);
        lens.move_to(LensPosition(1000.0), lens.info().max_speed).unwrap();
        bench.rest(&mut lens, Duration::from_secs(4));
        assert!(bench.glass().distance(LensPosition(1000.0)) < 1.0);
    }
}

#[test]
fn a_sweep_ends_where_the_samples_do() {
    let bench = bench();
    let mut lens = open(&bench).unwrap();
    lens.move_to(LensPosition(3750.0), lens.info().max_speed).unwrap();
    for _ in 0..50 {
        lens.sample().unwrap();
    }
    drop(lens);
    stands(&bench);
    assert!(bench.glass().0 < 1000.0, "{}", bench.glass());
}

#[test]
fn it_works_over_a_pseudo_terminal() {
    let bench = Bench::live(Protocol::Optotune, LensConfig::default());
    let server = Server::pty(bench.wire.clone()).unwrap();
    let port = Port::serial(server.address(), BAUD, Arc::clone(&bench.clock));
    let mut lens = Optotune::open(port, config(Quantity::Current), Arc::clone(&bench.clock)).unwrap();
    assert_eq!(lens.info().serial, "SIM00001");
    lens.move_to(LensPosition(320.0), lens.info().max_speed).unwrap();
    assert!(bench.rest(&mut lens, Duration::from_secs(20)).position.distance(LensPosition(320.0)) < 1.5);
}
