//! Kinematics of the simulated lens, and its vices.

use std::time::Duration;

use evfocus_core::{HostMicros, LensPosition, LensSpeed};
use evfocus_hal::{Clock, DeviceErrorKind, Lens};
use hil_sim::{Fault, FaultKind, FaultTrigger, LensConfig, LensKind, Light, RigConfig};

use crate::sweep::{open, section_three};

fn rig(lens: LensConfig) -> RigConfig {
    RigConfig { lens: LensConfig { read_resolution: 0.0, ..lens }, ..section_three(Light::Light) }
}

/// One millisecond of a motion.
struct Instant {
    time: HostMicros,
    reported: f64,
    glass: f64,
}

/// Sends the lens through `targets` at full speed, each until it rests, and looks every millisecond.
fn trace(config: LensConfig, targets: &[f64]) -> Vec<Instant> {
    let (rig, _, mut lens, clock) = open(&rig(config));
    let mut trace = Vec::new();
    for &target in targets {
        lens.move_to(LensPosition(target), lens.info().max_speed).unwrap();
        loop {
            let sample = lens.sample().unwrap();
            let time = sample.time();
            let (reported, glass) = (sample.position.0, rig.glass(time).0);
            trace.push(Instant { time, reported, glass });
            if !sample.moving {
                break;
            }
            clock.sleep_until(time + Duration::from_millis(1));
        }
    }
    trace
}

fn steps(trace: &[Instant]) -> impl Iterator<Item = f64> {
    trace.windows(2).map(|pair| pair[1].reported - pair[0].reported)
}

#[test]
fn a_move_is_a_trapezoid_of_speed() {
    let config = LensConfig::default();
    let (speed, acceleration) = (config.max_speed.counts_per_second(), config.acceleration);
    let trace = trace(config, &[3750.0]);
    let took = trace.len() as f64 * 1e-3;
    let expected = 3530.0 / speed + speed / acceleration;
    assert!((took - expected).abs() < 0.003, "took {took} s, not {expected} s");
    assert!(steps(&trace).all(|step| step >= 0.0 && step <= speed * 1.0001e-3));
    // In the middle of the cruise, by the formula.
    let ramp = speed / acceleration;
    let cruise = 220.0 + speed * ramp / 2.0 + speed * (1.0 - ramp);
    assert!((trace[1000].reported - cruise).abs() < 0.01, "{} is not {cruise}", trace[1000].reported);
    assert!((trace.last().unwrap().reported - 3750.0).abs() < 1e-6);
}

#[test]
fn a_new_command_takes_over_without_a_jump() {
    let (_, _, mut lens, clock) = open(&rig(LensConfig::default()));
    let fast = lens.info().max_speed;
    let slow = LensSpeed::new(300.0).unwrap();
    let mut last = 220.0;
    for (target, speed) in [(3000.0, fast), (3500.0, slow), (250.0, fast), (260.0, fast), (2000.0, fast)] {
        lens.move_to(LensPosition(target), speed).unwrap();
        for _ in 0..200 {
            clock.sleep_until(clock.now() + Duration::from_millis(1));
            let position = lens.sample().unwrap().position.0;
            assert!((position - last).abs() <= 1.77, "from {last} to {position} within a millisecond");
            last = position;
        }
    }
    clock.sleep_until(clock.now() + Duration::from_secs(3));
    assert!((lens.sample().unwrap().position.0 - 2000.0).abs() < 1e-6);
    lens.stop().unwrap();
    assert!(!lens.sample().unwrap().moving);
}

#[test]
fn backlash_parts_glass_and_motor_on_the_way_down() {
    let trace = trace(LensConfig { backlash: 20.0, ..LensConfig::default() }, &[2000.0, 1000.0, 1500.0]);
    let turn = trace.iter().position(|instant| instant.reported > 1999.999).unwrap();
    for (index, instant) in trace.iter().enumerate() {
        let gap = instant.glass - instant.reported;
        assert!((-1e-9..=20.0 + 1e-9).contains(&gap));
        if index < turn {
            assert!(gap.abs() < 1e-9, "a gap of {gap} on the way up");
        }
    }
    let down =
        trace.iter().find(|instant| instant.time > trace[turn].time && instant.reported < 1700.0).unwrap();
    assert!((down.glass - down.reported - 20.0).abs() < 1e-9);
    assert!((trace.last().unwrap().glass - 1500.0).abs() < 1e-6, "the gap closes on the way up again");
}

#[test]
fn overshoot_runs_past_the_target_and_comes_back() {
    let trace = trace(LensConfig { overshoot: 12.0, ..LensConfig::default() }, &[2000.0]);
    let farthest = trace.iter().map(|instant| instant.reported).fold(0.0, f64::max);
    assert!((farthest - 2012.0).abs() < 0.5, "farthest {farthest}");
    assert!((trace.last().unwrap().reported - 2000.0).abs() < 1e-6);
}

#[test]
fn ripple_varies_the_speed_and_never_exceeds_the_one_asked() {
    let trace = trace(LensConfig { speed_ripple: 0.2, ..LensConfig::default() }, &[3750.0]);
    let cruise: Vec<f64> = steps(&trace[200..1800]).collect();
    let (slowest, fastest) = cruise.iter().fold((f64::MAX, 0.0_f64), |(a, b), &s| (a.min(s), b.max(s)));
    println!("speed from {:.0} to {:.0} counts/s", slowest * 1e3, fastest * 1e3);
    assert!(fastest <= 1.7651 && fastest > 1.74 && slowest > 1.04 && slowest < 1.08);
    assert!((trace.last().unwrap().reported - 3750.0).abs() < 1e-6);
}

#[test]
fn stick_slip_stands_still_and_catches_up() {
    let trace = trace(LensConfig { stick_slip: 0.5, ..LensConfig::default() }, &[3750.0]);
    let cruise: Vec<f64> = steps(&trace[200..1800]).collect();
    let still = cruise.iter().filter(|&&step| step < 1e-9).count();
    let quick = cruise.iter().filter(|&&step| step > 3.4).count();
    assert!(still > 700 && still < 850 && quick > 700, "{still} still, {quick} quick");
}

#[test]
fn an_accelerating_motor_comes_to_the_speed_asked_at_its_end() {
    for drift in [0.5, -0.5, 0.8] {
        let trace = trace(LensConfig { speed_drift: drift, ..LensConfig::default() }, &[3750.0]);
        let steps: Vec<f64> = steps(&trace).collect();
        let (early, late) = (steps[steps.len() / 5], steps[steps.len() * 8 / 10]);
        let share = |part: f64| if drift > 0.0 { 1.0 - drift * (1.0 - part) } else { 1.0 + drift * part };
        println!("drift {drift}: {:.0} then {:.0} counts/s in {} ms", early * 1e3, late * 1e3, steps.len());
        assert!((early / 1.765 - share(0.2)).abs() < 0.01 && (late / 1.765 - share(0.8)).abs() < 0.01);
        assert!(steps.iter().all(|step| (0.0..1.7651).contains(step)));
        let planned = 3530.0 / 1.765 + 1.765 / 20.0 * 1e3;
        assert!((steps.len() as f64 - planned / (1.0 - 0.5 * drift.abs())).abs() < 3.0);
        assert!((trace.last().unwrap().reported - 3750.0).abs() < 1e-6);
    }
}

#[test]
fn a_fault_strikes_where_it_should_with_every_kind_of_lens() {
    let there = LensPosition(2500.0);
    for &kind in LensKind::ALL {
        let stall = Fault { kind: FaultKind::LensStalled, trigger: FaultTrigger::AtPosition(there) };
        let (sim, _, mut lens, clock) = open(&RigConfig { faults: vec![stall], ..rig(kind.into()) });
        lens.move_to(LensPosition(3750.0), lens.info().max_speed).unwrap();
        clock.sleep_until(HostMicros(8_000_000));
        let stopped = sim.glass(clock.now());
        assert!((stopped.0 - there.0).abs() < 0.01, "the {kind} lens stands at {stopped}");
    }
}

#[test]
fn the_read_out_is_coarse_noisy_and_late_as_configured() {
    let lens = LensConfig {
        read_resolution: 0.5,
        read_noise: 2.0,
        read_lag: Duration::from_millis(12),
        round_trip: Duration::from_millis(1),
        ..LensConfig::default()
    };
    let (rig, _, mut device, clock) = open(&RigConfig { lens, ..section_three(Light::Light) });
    device.move_to(LensPosition(3750.0), device.info().max_speed).unwrap();
    clock.sleep_until(HostMicros(200_000));
    let mut errors = Vec::new();
    for _ in 0..1500 {
        let sample = device.sample().unwrap();
        assert_eq!(sample.replied.micros_since(sample.requested), 1000);
        assert!((sample.position.0 * 2.0).fract().abs() < 1e-9);
        errors.push(sample.position.0 - rig.glass(sample.time()).0);
    }
    let mean = errors.iter().sum::<f64>() / 1500.0;
    let deviation = (errors.iter().map(|error| (error - mean).powi(2)).sum::<f64>() / 1500.0).sqrt();
    println!("late by {:.1} counts, noise {deviation:.2}", -mean);
    assert!((mean + 0.012 * 1765.0).abs() < 0.5 && (deviation - 2.0).abs() < 0.12);
}

#[test]
fn a_lens_that_needs_homing_refuses_to_move_before() {
    let (_, _, mut lens, clock) =
        open(&rig(LensConfig { needs_homing: true, start: LensPosition(1000.0), ..LensConfig::default() }));
    let speed = lens.info().max_speed;
    assert_eq!(lens.move_to(LensPosition(500.0), speed).unwrap_err().kind, DeviceErrorKind::Fault);
    lens.home().unwrap();
    clock.sleep_until(HostMicros(2_000_000));
    assert!((lens.sample().unwrap().position.0 - 220.0).abs() < 1e-6);
    lens.move_to(LensPosition(500.0), speed).unwrap();
}

#[test]
fn speed_above_the_fastest_is_the_fastest() {
    let (_, _, mut lens, clock) = open(&rig(LensConfig::default()));
    lens.move_to(LensPosition(3750.0), LensSpeed::new(1e6).unwrap()).unwrap();
    clock.sleep_until(HostMicros(1_000_000));
    assert!(lens.sample().unwrap().position.0 < 2000.0);
    assert!(lens.sample().unwrap().moving);
}
