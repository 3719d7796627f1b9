//! Firmata: driver and closed loop against model and motor.

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::{LensPosition, LensRange, LensSpeed};
use evfocus_hal::{DeviceError, DeviceErrorKind, Lens, conformance};
use evfocus_lens::drive::DriveConfig;
use evfocus_lens::firmata::{BAUD, FirmataConfig};
use evfocus_lens::{Firmata, Port};
use hil_sim::wire::{Protocol, Server, WireFault};
use hil_sim::{Fault, FaultKind, FaultTrigger, LensConfig};

use crate::bench::{Bench, says, stands};

const SPEED: f64 = 900.0;

pub(crate) fn motor() -> LensConfig {
    LensConfig {
        max_speed: LensSpeed::new(SPEED).unwrap(),
        start: LensPosition(1000.0),
        read_noise: 1.0,
        ..LensConfig::default()
    }
}

pub(crate) fn drive() -> DriveConfig {
    DriveConfig {
        range: LensRange::new(LensPosition(260.0), LensPosition(3710.0)).unwrap(),
        max_speed: LensSpeed::new(SPEED).unwrap(),
        acceleration: 4000.0,
        dead_band: 0.12,
        tolerance: 2.0,
        at_zero: 0.0,
        at_full: 4095.0,
        reversed: false,
    }
}

pub(crate) fn config() -> FirmataConfig {
    FirmataConfig { pwm_pin: 3, direction_pin: 4, channel: 0, drive: drive() }
}

fn bench() -> Bench {
    Bench::new(Protocol::Firmata, motor())
}

fn open(bench: &Bench, config: FirmataConfig) -> Result<Firmata, DeviceError> {
    Firmata::open(bench.port(), config, Arc::clone(&bench.clock))
}

fn fast() -> LensSpeed {
    LensSpeed::new(SPEED).unwrap()
}

/// Samples for `duration`, every 2 ms.
fn steer(bench: &Bench, lens: &mut Firmata, duration: Duration) -> Result<(), DeviceError> {
    let end = bench.now() + duration;
    while bench.now() < end {
        lens.sample()?;
        bench.wait(Duration::from_millis(2));
    }
    Ok(())
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
fn readings_belong_to_their_time_and_the_speed_is_kept() {
    let bench = bench();
    let mut lens = open(&bench, config()).unwrap();
    lens.move_to(LensPosition(3700.0), LensSpeed::new(600.0).unwrap()).unwrap();
    let (mut sum, mut count) = (0.0, 0);
    let (mut began, mut ended) = (None, bench.now());
    while lens.sample().unwrap().moving {
        let sample = lens.sample().unwrap();
        sum += sample.position.counts_from(bench.rig.glass(sample.time()));
        count += 1;
        if sample.position.0 > 1270.0 && sample.position.0 < 3430.0 {
            began.get_or_insert((bench.now(), bench.glass()));
            ended = bench.now();
        }
        bench.wait(Duration::from_millis(2));
    }
    let (start, from) = began.unwrap();
    let seconds = ended.since(start).as_secs_f64();
    let speed = bench.rig.glass(ended).counts_from(from) / seconds;
    let mean = sum / f64::from(count);
    println!("mean error of {mean:+.2} counts, {speed:.1} counts/s of 600");
    assert!(mean.abs() < 1.0, "{mean}");
    assert!((speed / 600.0 - 1.0).abs() < 0.05, "{speed}");
}

#[test]
fn it_rests_within_a_step_of_the_converter() {
    let (mut worst, mut within, mut count) = ([0.0_f64; 2], [0; 2], [0; 2]);
    for seed in 0..200 {
        // A potentiometer without noise tells nothing between the steps.
        let quiet = usize::from(seed % 4 == 0);
        let read_noise = 1.0 - quiet as f64;
        let bench = Bench::seeded(Protocol::Firmata, LensConfig { read_noise, ..motor() }, seed);
        let mut lens = open(&bench, config()).unwrap();
        for target in [3000.0, 301.0, 1503.0, 1509.0, 300.0 + (37 * seed % 3400) as f64] {
            lens.move_to(LensPosition(target), fast()).unwrap();
            bench.rest(&mut lens, Duration::from_secs(8));
            let off = bench.glass().counts_from(LensPosition(target)).abs();
            worst[quiet] = worst[quiet].max(off);
            within[quiet] += i32::from(off <= 2.0);
            count[quiet] += 1;
            // A step of the 10-bit converter is 4 counts.
            assert!(off <= 4.0, "seed {seed}: {off:.2} off {target}");
        }
    }
    println!("with noise and without: within 2 {within:?} of {count:?}, at most {worst:.2?}");
}

#[test]
fn what_is_wrong_is_named_and_the_motor_cut() {
    for (fault, kind, words) in [
        (WireFault::Silence, DeviceErrorKind::TimedOut, &["no reading of channel A0", "cut off"][..]),
        (WireFault::Reset, DeviceErrorKind::TimedOut, &["no reading", "reset?"]),
        (WireFault::PositionJump(600.0), DeviceErrorKind::Fault, &["leapt"]),
    ] {
        let bench = bench();
        let mut lens = open(&bench, config()).unwrap();
        lens.move_to(LensPosition(3700.0), fast()).unwrap();
        steer(&bench, &mut lens, Duration::from_millis(400)).unwrap();
        bench.wire.strike(fault);
        let error = steer(&bench, &mut lens, Duration::from_millis(400)).unwrap_err();
        assert_eq!(error.kind, kind, "{fault:?}: {error}");
        says(&error, words);
        stands(&bench);
        assert!(bench.glass().0 < 1600.0, "{fault:?}: {}", bench.glass());
        bench.wire.repair();
        bench.wait(Duration::from_secs(2));
        bench.rest(&mut lens, Duration::from_secs(4));
    }
}

#[test]
fn a_stalled_motor_is_cut() {
    let bench = bench();
    let faults =
        vec![Fault { kind: FaultKind::LensStalled, trigger: FaultTrigger::AtPosition(LensPosition(2000.0)) }];
    let bench = bench.with_faults(Protocol::Firmata, faults);
    let mut lens = open(&bench, config()).unwrap();
    lens.move_to(LensPosition(3700.0), fast()).unwrap();
    let error = steer(&bench, &mut lens, Duration::from_secs(4)).unwrap_err();
    assert_eq!(error.kind, DeviceErrorKind::Fault);
    says(&error, &["stands still at 200", "cut off", "end of its way"]);
}

#[test]
fn a_motor_that_is_wired_the_wrong_way_round_is_cut_early() {
    let bench = bench();
    let reversed = FirmataConfig { drive: DriveConfig { reversed: true, ..drive() }, ..config() };
    let mut lens = open(&bench, reversed).unwrap();
    lens.move_to(LensPosition(3700.0), fast()).unwrap();
    says(
        &steer(&bench, &mut lens, Duration::from_secs(4)).unwrap_err(),
        &["moves the other way", "reversed"],
    );
    stands(&bench);
    assert!(bench.glass().0 > 700.0, "{}", bench.glass());
}

#[test]
fn pins_that_cannot_do_their_work_are_named() {
    let bench = bench();
    let error = open(&bench, FirmataConfig { pwm_pin: 7, ..config() }).unwrap_err();
    says(&error, &["pin 7 cannot do PWM"]);
    says(&open(&bench, FirmataConfig { channel: 9, ..config() }).unwrap_err(), &["channel A9"]);
}

#[test]
fn dropping_it_stops_it() {
    let bench = bench();
    let mut lens = open(&bench, config()).unwrap();
    lens.move_to(LensPosition(3700.0), fast()).unwrap();
    steer(&bench, &mut lens, Duration::from_millis(400)).unwrap();
    drop(lens);
    stands(&bench);
    assert!(bench.glass().0 < 1600.0, "{}", bench.glass());
}

#[test]
fn it_works_over_a_pseudo_terminal() {
    let bench = Bench::live(Protocol::Firmata, motor());
    let server = Server::pty(bench.wire.clone()).unwrap();
    let port = Port::serial(server.address(), BAUD, Arc::clone(&bench.clock));
    let mut lens = Firmata::open(port, config(), Arc::clone(&bench.clock)).unwrap();
    lens.move_to(LensPosition(1200.0), fast()).unwrap();
    assert!(bench.rest(&mut lens, Duration::from_secs(20)).position.distance(LensPosition(1200.0)) < 20.0);
}
