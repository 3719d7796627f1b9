//! Both drivers pass the suite that every camera must pass, and give the events that the pixels made.

use std::time::Duration;

use evfocus_camera::Driver;
use evfocus_core::{CameraMicros, Event, EventBatch};
use evfocus_hal::{Camera, Clock, conformance};
use hil_sim::UsbFaults;

use crate::common::Bench;

#[test]
fn drivers_conform() {
    for driver in Driver::ALL {
        for short_packets in [None, Some(3)] {
            let made = conformance::camera(|| {
                let bench = Bench::new(driver);
                bench.set_faults(UsbFaults { short_packets, ..UsbFaults::default() });
                (bench.open().unwrap(), bench.clock)
            });
            assert_eq!(made, Ok(()), "{driver}, packets of {short_packets:?}");
        }
    }
}

/// Times from the first event on.
fn relative(events: &[Event]) -> Vec<Event> {
    let first = events.first().map_or(0, |event| event.t.0);
    events.iter().map(|event| Event { t: CameraMicros(event.t.0 - first), ..*event }).collect()
}

#[test]
fn drivers_give_the_events_that_the_pixels_made() {
    for driver in Driver::ALL {
        let bench = Bench::new(driver);
        let mut camera = bench.open().unwrap();
        camera.start().unwrap();
        // The DAVIS346's pixels run 50 ms before the first of their events is sent.
        let lead = Duration::from_millis(if driver == Driver::Davis346 { 50 } else { 0 });
        let began = bench.clock.now() - lead;
        let (events, lost) = bench.watch(camera.as_mut(), Duration::from_millis(200)).unwrap();
        assert_eq!(lost, 0);
        // The same rig without the wire, started at the same time.
        let truth = Bench::new(driver);
        truth.clock.advance_to(began);
        let (mut pixels, _) = truth.rig.devices();
        pixels.start().unwrap();
        let mut made = Vec::new();
        let mut batch = EventBatch::with_capacity(65_536);
        while truth.clock.now() < bench.clock.now() {
            pixels.read(&mut batch, Duration::from_millis(5)).unwrap();
            made.extend(batch.events.iter());
        }
        // The end is still on the wire.
        let events = relative(&events);
        let place = made.windows(20).position(|window| relative(window) == events[..20]);
        // The wire's time begins anew.
        let made = relative(&made[place.expect("the stream's first events were made by the pixels")..]);
        let count = events.len().min(made.len());
        assert!(count > 2_000, "{driver}: {count} events");
        assert!(events[..count] == made[..count], "{driver}: the events differ");
    }
}
