//! The event-rate controller drops what is beyond its cap, and the camera does not say so.

use std::collections::HashMap;
use std::time::Duration;

use evfocus_hal::Camera;
use hil_sim::{RateCap, RigConfig, SensorConfig};

use crate::sensor::{flickering, second, with};
use crate::sweep::{open, watch};

fn capped(cap: RateCap) -> RigConfig {
    with(flickering(), |sensor: &mut SensorConfig| sensor.rate_cap = Some(cap))
}

#[test]
fn no_period_has_more_events_than_the_cap() {
    let free = second(&flickering()).0;
    for cap in [
        RateCap { events: 20, period: Duration::from_micros(200) },
        RateCap { events: 1000, period: Duration::from_millis(7) },
    ] {
        let (rig, mut camera, _, clock) = open(&capped(cap));
        assert_eq!(camera.info().rate_ceiling, Some(cap.events_per_s() as u64));
        camera.start().unwrap();
        let (kept, lost) = watch(&mut camera, clock.as_ref(), Duration::from_secs(1));
        let dropped = rig.dropped_by_rate_cap();
        println!("{cap:?}: {} of {} events, {dropped} dropped", kept.len(), free.len());
        let mut periods: HashMap<i64, u32> = HashMap::new();
        for event in &kept {
            *periods.entry(event.t.0 / cap.period.as_micros() as i64).or_default() += 1;
        }
        assert_eq!(periods.values().max(), Some(&cap.events), "the busiest period is full");
        assert_eq!(lost, 0, "the camera does not know of them");
        assert_eq!(kept.len() as u64 + dropped, free.len() as u64);
    }
}

#[test]
fn a_cap_above_the_rate_changes_nothing() {
    assert!(second(&capped(RateCap::default())).0 == second(&flickering()).0);
}

#[test]
fn a_cap_is_made_from_a_rate() {
    assert_eq!(RateCap::at_rate(20e6), RateCap::default());
    assert_eq!(RateCap::at_rate(1.0).events, 1);
}
