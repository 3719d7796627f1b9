//! The same seed gives the same events, however they are fetched.

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::{Event, EventBatch, HostMicros, LensPosition};
use evfocus_hal::{Camera, Clock, Lens, VirtualClock};
use hil_sim::{
    Fault, FaultKind, FaultTrigger, LensConfig, Light, MotionConfig, Rig, RigConfig, SensorConfig,
};

use crate::sweep::section_three;

/// A rig in which everything that is random is switched on.
fn busy(seed: u64) -> RigConfig {
    let base = section_three(Light::Dark);
    let loss = FaultKind::EventLoss { share: 0.3, duration: Duration::from_millis(60) };
    RigConfig {
        sensor: SensorConfig { hot_pixels: 5, readout_events_per_s: 5e5, readout_queue: 300, ..base.sensor },
        motion: MotionConfig { vibration_px_rms: 0.1, ..MotionConfig::hand_held() },
        lens: LensConfig::worn(),
        faults: vec![Fault { kind: loss, trigger: FaultTrigger::AtPosition(LensPosition(600.0)) }],
        seed,
        ..base
    }
}

/// The events of 600 ms, fetched by `fetch` up to a given time, with lens commands at 0, 250.123 and 400 ms.
fn record(
    config: RigConfig,
    mut fetch: impl FnMut(&mut dyn Camera, &VirtualClock, HostMicros, &mut Vec<Event>),
) -> Vec<Event> {
    let clock = Arc::new(VirtualClock::new());
    let rig = Rig::new(config, Arc::clone(&clock) as Arc<dyn Clock>).unwrap();
    let (mut camera, mut lens) = rig.devices();
    let speed = lens.info().max_speed;
    camera.start().unwrap();
    let mut events = Vec::new();
    for (target, until) in [(1500.0, 250_123), (300.0, 400_000), (1985.0, 600_000)] {
        lens.move_to(LensPosition(target), speed).unwrap();
        fetch(&mut camera, &clock, HostMicros(until), &mut events);
        clock.advance_to(HostMicros(until));
    }
    // What the last fetch left behind.
    drain(&mut camera, &mut EventBatch::with_capacity(10_000), &mut events);
    events
}

fn drain(camera: &mut dyn Camera, batch: &mut EventBatch, events: &mut Vec<Event>) {
    loop {
        camera.read(batch, Duration::ZERO).unwrap();
        if batch.events.is_empty() {
            return;
        }
        events.extend(batch.events.iter());
    }
}

fn patiently(camera: &mut dyn Camera, clock: &VirtualClock, until: HostMicros, events: &mut Vec<Event>) {
    let mut batch = EventBatch::with_capacity(10_000);
    while clock.now() < until {
        camera.read(&mut batch, until.since(clock.now())).unwrap();
        events.extend(batch.events.iter());
    }
}

fn in_haste(camera: &mut dyn Camera, clock: &VirtualClock, until: HostMicros, events: &mut Vec<Event>) {
    let mut batch = EventBatch::with_capacity(17);
    while clock.now() < until {
        drain(camera, &mut batch, events);
        clock.advance_to(until.min(clock.now() + Duration::from_micros(730)));
    }
}

fn seldom(camera: &mut dyn Camera, clock: &VirtualClock, until: HostMicros, events: &mut Vec<Event>) {
    clock.advance_to(until);
    drain(camera, &mut EventBatch::with_capacity(1000), events);
}

#[test]
fn slicing_does_not_change_the_events() {
    let reference = record(busy(5), patiently);
    println!("{} events", reference.len());
    assert!(reference.len() > 20_000);
    assert!(reference == record(busy(5), patiently));
    assert!(reference == record(busy(5), in_haste));
    assert!(reference == record(busy(5), seldom));
}

#[test]
fn another_seed_makes_other_events() {
    assert!(record(busy(5), patiently) != record(busy(6), patiently));
}
