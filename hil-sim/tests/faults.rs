//! Faults strike when they should and look as they would on a real rig.

use std::time::Duration;

use evfocus_core::{EventBatch, HostMicros, LensPosition};
use evfocus_hal::{Camera, Clock, DeviceErrorKind, Lens};
use hil_sim::{Fault, FaultKind, FaultTrigger, Light, MotionConfig, RigConfig};

use crate::sweep::{open, section_three, watch};

fn rig(kind: FaultKind, trigger: FaultTrigger) -> RigConfig {
    RigConfig {
        faults: vec![Fault { kind, trigger }],
        motion: MotionConfig::moving(100.0),
        ..section_three(Light::Light)
    }
}

fn after(millis: u64) -> FaultTrigger {
    FaultTrigger::After(Duration::from_millis(millis))
}

fn at(position: f64) -> FaultTrigger {
    FaultTrigger::AtPosition(LensPosition(position))
}

#[test]
fn an_unplugged_camera_is_gone_until_it_is_opened_again() {
    let (rig, mut camera, _, clock) = open(&rig(FaultKind::CameraUnplugged, after(50)));
    camera.start().unwrap();
    assert!(!watch(&mut camera, clock.as_ref(), Duration::from_millis(49)).0.is_empty());
    clock.advance_to(HostMicros(50_000));
    let mut batch = EventBatch::with_capacity(1000);
    for _ in 0..2 {
        let error = camera.read(&mut batch, Duration::from_millis(20)).unwrap_err();
        assert_eq!(error.kind, DeviceErrorKind::Disconnected);
    }
    assert_eq!(camera.start().unwrap_err().kind, DeviceErrorKind::Disconnected);
    rig.repair();
    assert_eq!(camera.start().unwrap_err().kind, DeviceErrorKind::Disconnected, "the old handle stays dead");
    let (mut camera, _) = rig.devices();
    camera.start().unwrap();
    assert!(!watch(&mut camera, clock.as_ref(), Duration::from_millis(50)).0.is_empty());
}

#[test]
fn a_camera_is_unplugged_in_the_middle_of_a_wait() {
    let mut config = rig(FaultKind::CameraUnplugged, after(50));
    config.motion = MotionConfig::default();
    config.sensor.leak_hz = 0.0;
    config.sensor.shot_noise_black_hz = 0.0;
    config.sensor.shot_noise_white_hz = 0.0;
    let (_, mut camera, _, clock) = open(&config);
    camera.start().unwrap();
    let error = camera.read(&mut EventBatch::with_capacity(10), Duration::from_secs(10)).unwrap_err();
    assert_eq!(error.kind, DeviceErrorKind::Disconnected);
    assert!(clock.now() < HostMicros(53_000), "noticed at {}", clock.now());
}

#[test]
fn a_time_reset_starts_the_camera_clock_again() {
    let (_, mut camera, _, clock) = open(&rig(FaultKind::CameraTimeReset, after(50)));
    camera.start().unwrap();
    let events = watch(&mut camera, clock.as_ref(), Duration::from_millis(100)).0;
    let backwards: Vec<_> = events.windows(2).filter(|pair| pair[1].t < pair[0].t).collect();
    assert_eq!(backwards.len(), 1);
    assert!(backwards[0][0].t.0 > 49_000 && backwards[0][1].t.0 < 1000);
}

#[test]
fn an_event_loss_is_counted_and_ends() {
    let reference = {
        let (_, mut camera, _, clock) = open(&rig(FaultKind::CameraTimeReset, after(10_000)));
        camera.start().unwrap();
        watch(&mut camera, clock.as_ref(), Duration::from_millis(100)).0
    };
    let loss = FaultKind::EventLoss { share: 0.5, duration: Duration::from_millis(20) };
    let (_, mut camera, _, clock) = open(&rig(loss, after(50)));
    camera.start().unwrap();
    let (events, lost) = watch(&mut camera, clock.as_ref(), Duration::from_millis(100));
    let during = |t: i64| (50_000..70_000).contains(&t);
    let hit = reference.iter().filter(|event| during(event.t.0)).count() as f64;
    assert_eq!(events.len() as u64 + lost, reference.len() as u64);
    assert!((lost as f64 / hit - 0.5).abs() < 0.1, "{lost} of {hit}");
    let spared = |events: &[evfocus_core::Event]| events.iter().filter(|event| !during(event.t.0)).count();
    assert_eq!(spared(&events), spared(&reference));
}

#[test]
fn an_unplugged_lens_is_gone_and_stands_still() {
    let (rig, _, mut lens, clock) = open(&rig(FaultKind::LensUnplugged, after(500)));
    lens.move_to(LensPosition(3750.0), lens.info().max_speed).unwrap();
    clock.advance_to(HostMicros(499_000));
    assert!(lens.sample().unwrap().moving);
    clock.advance_to(HostMicros(500_000));
    assert_eq!(lens.sample().unwrap_err().kind, DeviceErrorKind::Disconnected);
    assert_eq!(lens.stop().unwrap_err().kind, DeviceErrorKind::Disconnected);
    let there = rig.glass(HostMicros(500_000));
    assert_eq!(rig.glass(HostMicros(900_000)), there);
    clock.advance_to(HostMicros(1_000_000));
    rig.repair();
    assert_eq!(lens.sample().unwrap_err().kind, DeviceErrorKind::Disconnected, "the old handle stays dead");
    let mut lens = rig.devices().1;
    assert!(lens.sample().unwrap().position.distance(there) <= 0.5);
    lens.move_to(LensPosition(220.0), lens.info().max_speed).unwrap();
    clock.advance_to(HostMicros(3_000_000));
    assert_eq!(lens.sample().unwrap().position, LensPosition(220.0));
}

#[test]
fn a_stalled_lens_stays_where_it_is_from_a_time_or_a_position_on() {
    for (trigger, there) in [(after(0), 220.0), (at(1000.0), 1000.0), (at(220.0), 220.0)] {
        let (rig, _, mut lens, clock) = open(&rig(FaultKind::LensStalled, trigger));
        for target in [3750.0, 300.0] {
            lens.move_to(LensPosition(target), lens.info().max_speed).unwrap();
            clock.advance_to(clock.now() + Duration::from_secs(3));
            let sample = lens.sample().unwrap();
            assert!(
                sample.position.distance(LensPosition(there)) <= 0.5,
                "{trigger:?}: at {}",
                sample.position
            );
            assert!(!sample.moving);
            assert!(rig.glass(clock.now()).distance(LensPosition(there)) <= 0.001);
        }
    }
}

#[test]
fn a_position_that_is_never_reached_triggers_nothing() {
    let (_, _, mut lens, clock) = open(&rig(FaultKind::LensStalled, at(2000.0)));
    let speed = lens.info().max_speed;
    // Would pass 2000, but is turned round before; then a move that stops short of it.
    lens.move_to(LensPosition(3000.0), speed).unwrap();
    clock.advance_to(HostMicros(500_000));
    lens.move_to(LensPosition(500.0), speed).unwrap();
    clock.advance_to(HostMicros(3_000_000));
    lens.move_to(LensPosition(1999.0), speed).unwrap();
    clock.advance_to(HostMicros(6_000_000));
    assert_eq!(lens.sample().unwrap().position, LensPosition(1999.0));
}

#[test]
fn a_silent_lens_times_out_and_goes_on() {
    let (rig, _, mut lens, clock) = open(&rig(FaultKind::LensSilent, after(500)));
    lens.move_to(LensPosition(3750.0), lens.info().max_speed).unwrap();
    clock.advance_to(HostMicros(600_000));
    let before = clock.now();
    assert_eq!(lens.sample().unwrap_err().kind, DeviceErrorKind::TimedOut);
    assert_eq!(clock.now().since(before), Duration::from_millis(50));
    assert_eq!(lens.stop().unwrap_err().kind, DeviceErrorKind::TimedOut);
    assert_eq!(rig.glass(HostMicros(4_000_000)), LensPosition(3750.0));
}

#[test]
fn late_positions_are_those_of_the_past() {
    let late = FaultKind::LensPositionLate { by: Duration::from_millis(40) };
    let (rig, _, mut lens, clock) = open(&rig(late, at(1000.0)));
    lens.move_to(LensPosition(3750.0), lens.info().max_speed).unwrap();
    clock.advance_to(HostMicros(300_000));
    assert!(lens.sample().unwrap().position.distance(rig.glass(HostMicros(300_000))) <= 0.5);
    clock.advance_to(HostMicros(900_000));
    assert!(lens.sample().unwrap().position.distance(rig.glass(HostMicros(860_000))) <= 0.5);
}
