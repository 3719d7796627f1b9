//! Each effect of the sensor can be seen in the events, and only where it is switched on.

use std::collections::HashMap;
use std::time::Duration;

use evfocus_core::{Event, Geometry};
use evfocus_hal::Camera;
use hil_sim::{CameraModel, Flicker, Light, LinkConfig, MotionConfig, RigConfig, Scene, SensorConfig};

use crate::sweep::{open, section_three, watch};

pub(crate) const PIXELS: f64 = 64.0 * 48.0;

/// A sensor without vices before a blank wall, 128 DN bright.
pub(crate) fn quiet() -> RigConfig {
    let sensor = SensorConfig {
        geometry: Geometry { width: 64, height: 48 },
        threshold_mismatch: 0.0,
        leak_hz: 0.0,
        leak_spread_decades: 0.0,
        shot_noise_black_hz: 0.0,
        shot_noise_white_hz: 0.0,
        refractory: Duration::ZERO,
        latency: Duration::ZERO,
        jitter: Duration::ZERO,
        readout_events_per_s: 1e9,
        ..SensorConfig::preset(CameraModel::Davis346, Light::Light)
    };
    RigConfig { sensor, scene: Scene::BlankWall, ..section_three(Light::Light) }
}

/// The same in flickering light, which makes events everywhere.
pub(crate) fn flickering() -> RigConfig {
    RigConfig { flicker: Some(Flicker { hertz: 100.0, depth: 0.8 }), ..quiet() }
}

pub(crate) fn with(base: RigConfig, change: impl FnOnce(&mut SensorConfig)) -> RigConfig {
    let mut config = base;
    change(&mut config.sensor);
    config
}

/// The events of one second, and how many were lost.
pub(crate) fn second(config: &RigConfig) -> (Vec<Event>, u64) {
    let (_, mut camera, _, clock) = open(config);
    camera.start().unwrap();
    watch(&mut camera, clock.as_ref(), Duration::from_secs(1))
}

pub(crate) fn on_share(events: &[Event]) -> f64 {
    events.iter().filter(|event| event.polarity.is_on()).count() as f64 / events.len() as f64
}

pub(crate) fn by_pixel(events: &[Event]) -> HashMap<(u16, u16), Vec<i64>> {
    let mut pixels: HashMap<_, Vec<i64>> = HashMap::new();
    for event in events {
        pixels.entry((event.x, event.y)).or_default().push(event.t.0);
    }
    pixels
}

fn shortest_interval(events: &[Event]) -> i64 {
    by_pixel(events).values().flat_map(|times| times.windows(2).map(|pair| pair[1] - pair[0])).min().unwrap()
}

#[test]
fn nothing_happens_without_cause() {
    assert_eq!(second(&quiet()).0.len(), 0);
}

#[test]
fn leak_is_all_on() {
    let (events, _) = second(&with(quiet(), |sensor| sensor.leak_hz = 20.0));
    assert!((on_share(&events) - 1.0).abs() < 1e-9);
    let hertz = events.len() as f64 / PIXELS;
    // In the mean half an event is saved at first, when the memory lies anywhere between the thresholds.
    assert!((hertz - 19.5).abs() < 0.2, "{hertz} Hz");
    // No beat with the grid on which it is booked.
    let mut phases = [0; 16];
    for event in &events {
        phases[(event.t.0 / 1000).rem_euclid(16) as usize] += 1;
    }
    let mean = events.len() / 16;
    assert!(phases.iter().all(|&count| count > mean * 8 / 10 && count < mean * 12 / 10), "{phases:?}");
}

#[test]
fn leak_spreads_between_pixels() {
    let counts = |spread| {
        let config = with(quiet(), |sensor| (sensor.leak_hz, sensor.leak_spread_decades) = (50.0, spread));
        let pixels = by_pixel(&second(&config).0);
        let rates = || pixels.values().map(|times| times.len() as f64);
        let mean = rates().sum::<f64>() / PIXELS;
        (rates().map(|rate| (rate - mean).powi(2)).sum::<f64>() / PIXELS).sqrt() / mean
    };
    let (even, spread) = (counts(0.0), counts(0.1));
    assert!(even < 0.03 && (spread - 0.235).abs() < 0.04, "{even} and {spread}");
}

#[test]
fn shot_noise_has_both_polarities_and_depends_on_the_brightness() {
    let noisy = |black, white| {
        let config =
            with(quiet(), |sensor| (sensor.shot_noise_black_hz, sensor.shot_noise_white_hz) = (black, white));
        second(&config).0
    };
    let events = noisy(8.0, 2.0);
    let (hertz, expected) = (events.len() as f64 / PIXELS, 8.0 - 6.0 * 128.0 / 255.0);
    assert!((hertz - expected).abs() < 0.2, "{hertz} Hz, not {expected}");
    assert!((on_share(&events) - 0.5).abs() < 0.03);
    let reversed = noisy(2.0, 8.0).len() as f64 / PIXELS;
    assert!((reversed - 5.0).abs() < 0.2, "{reversed} Hz");
}

#[test]
fn the_refractory_time_bounds_the_rate_of_a_pixel() {
    let free = second(&flickering()).0;
    let bound = second(&with(flickering(), |sensor| sensor.refractory = Duration::from_millis(2))).0;
    println!("shortest interval {} us, then {} us", shortest_interval(&free), shortest_interval(&bound));
    assert!(shortest_interval(&free) < 1000);
    assert!(shortest_interval(&bound) >= 1999);
    assert!(bound.len() < free.len());
}

#[test]
fn hot_pixels_fire_by_themselves() {
    let config = with(quiet(), |sensor| (sensor.hot_pixels, sensor.hot_pixel_hz) = (3, 300.0));
    let pixels = by_pixel(&second(&config).0);
    assert_eq!(pixels.len(), 3);
    assert!(pixels.values().all(|times| (240..360).contains(&times.len())));
}

#[test]
fn the_read_out_delays_then_loses_and_counts() {
    let (free, none_lost) = second(&flickering());
    let narrow = with(flickering(), |sensor| {
        sensor.readout_events_per_s = 3e5;
        sensor.readout_queue = 100;
    });
    let (kept, lost) = second(&narrow);
    println!("{} events, of which {} were read out and {lost} lost", free.len(), kept.len());
    assert_eq!(none_lost, 0);
    assert!(lost > 0);
    let waiting = free.len() as i64 - kept.len() as i64 - lost as i64;
    assert!((0..=101).contains(&waiting), "{waiting} unaccounted for");
    let busiest = kept.windows(301).map(|events| events[300].t.0 - events[0].t.0).min().unwrap();
    assert!(busiest >= 998, "301 events within {busiest} us at 3e5 a second");
    // A long queue only delays.
    let patient = with(flickering(), |sensor| {
        sensor.readout_events_per_s = 8e5;
        sensor.readout_queue = 1_000_000;
    });
    assert_eq!(second(&patient).1, 0);
}

#[test]
fn latency_shifts_and_jitter_scatters_the_time_stamps() {
    let prompt = second(&flickering()).0;
    let late = second(&with(flickering(), |sensor| sensor.latency = Duration::from_millis(5))).0;
    assert!(late.len() > 1000);
    let shifted: Vec<_> = late.iter().map(|event| (event.t.0 - 5000, event.x, event.y)).collect();
    let original: Vec<_> = prompt.iter().map(|event| (event.t.0, event.x, event.y)).collect();
    assert!(shifted[..] == original[..shifted.len()]);
    let jittered = second(&with(flickering(), |sensor| {
        sensor.latency = Duration::from_millis(5);
        sensor.jitter = Duration::from_micros(300);
    }))
    .0;
    assert!(jittered.windows(2).all(|pair| pair[0].t <= pair[1].t));
    assert!(jittered != late);
}

#[test]
fn time_stamps_have_the_configured_step() {
    let config = with(flickering(), |sensor| sensor.time_resolution = Duration::from_micros(64));
    assert!(second(&config).0.iter().all(|event| event.t.0 % 64 == 0));
}

#[test]
fn camera_time_has_its_own_origin_and_rate() {
    let link =
        LinkConfig { clock_offset: Duration::from_millis(1200), clock_drift_ppm: 1000.0, ..quiet().link };
    let base = second(&flickering()).0;
    let own = second(&RigConfig { link, ..flickering() }).0;
    for (base, own) in base.iter().zip(&own) {
        let expected = 1.2e6 + base.t.0 as f64 * 1.001;
        assert!((own.t.0 as f64 - expected).abs() <= 1.0);
    }
}

#[test]
fn a_slow_pixel_filters_the_flicker() {
    let fast = second(&flickering()).0.len();
    let slow = second(&with(flickering(), |sensor| sensor.cutoff_hz = 10.0)).0.len();
    assert!(slow * 20 < fast, "{slow} of {fast}");
}

#[test]
fn mismatch_spreads_the_pixels() {
    let spread = |mismatch| {
        let pixels = by_pixel(&second(&with(flickering(), |sensor| sensor.threshold_mismatch = mismatch)).0);
        let mean = pixels.values().map(|times| times.len() as f64).sum::<f64>() / PIXELS;
        (pixels.values().map(|times| (times.len() as f64 - mean).powi(2)).sum::<f64>() / PIXELS).sqrt() / mean
    };
    let (even, uneven) = (spread(0.0), spread(0.04));
    println!("spread of the pixels' rates: {even:.3}, with mismatch {uneven:.3}");
    assert!(uneven > 0.08 && uneven > 2.0 * even);
}

#[test]
fn several_thresholds_within_a_step_make_several_events() {
    let config = with(flickering(), |sensor| {
        sensor.geometry = Geometry { width: 16, height: 12 };
        (sensor.on_threshold, sensor.off_threshold) = (0.03, 0.03);
    });
    let (events, _) = second(&config);
    let busiest = by_pixel(&events)
        .values()
        .flat_map(|times| times.chunk_by(|a, b| a / 1000 == b / 1000).map(<[i64]>::len).collect::<Vec<_>>())
        .max();
    assert!(busiest.unwrap() >= 4, "{busiest:?}");
}

#[test]
fn shake_and_vibration_make_events() {
    let count = |motion| {
        let config = RigConfig { motion, scene: Scene::Text, ..quiet() };
        let start = RigConfig { lens: hil_sim::LensConfig { start: config.focus, ..config.lens }, ..config };
        second(&start).0.len()
    };
    assert_eq!(count(MotionConfig::default()), 0);
    let (vibrating, shaken) = (count(MotionConfig::fixed_rig()), count(MotionConfig::hand_held()));
    println!("{vibrating} events from vibration, {shaken} from shake");
    assert!(vibrating > 100 && shaken > vibrating);
}
