//! What spoils a sweep is seen, and what does not spoil it is not.

use core::f64::consts::TAU;
use core::time::Duration;

use evfocus_core::{CameraMicros, Event, EventList, HotPixels, Polarity, SweepQuality};

use crate::random::Xorshift;
use crate::stream::{GEOMETRY, event, poisson, position_is_time, record};

const LENGTH_US: f64 = 2e6;

fn quality(events: &[Event]) -> SweepQuality {
    let (recorder, trace) = (record(events, 0), position_is_time(LENGTH_US as i64));
    SweepQuality::of(&recorder.sweep(&trace).unwrap()).unwrap()
}

/// A rate with a peak in the middle, and `highest` there.
fn peaked(highest: f64) -> impl Fn(f64) -> f64 {
    move |t| highest * (0.1 + 0.9 * libm::exp(-((t - 1e6) / 2.5e5).powi(2)))
}

#[test]
fn a_rate_that_does_not_change_is_flat() {
    for rate in [3e3, 1e4, 6e4, 1e5, 1e6] {
        let quality = quality(&poisson(&mut Xorshift::new(1), LENGTH_US, rate, |_| rate));
        assert!(quality.is_flat() && !quality.has_flicker(), "{rate}: {quality:?}");
        // Noise alone spends long near its highest rate, which is no ceiling.
        assert!(!quality.is_saturated(), "{rate}: {quality:?}");
    }
}

#[test]
fn a_rate_with_a_peak_is_neither_flat_nor_saturated_nor_flickering() {
    for highest in [3e3, 1e4, 1e6] {
        let quality = quality(&poisson(&mut Xorshift::new(2), LENGTH_US, highest, peaked(highest)));
        assert!(!quality.is_flat() && !quality.is_saturated() && !quality.has_flicker(), "{quality:?}");
    }
}

#[test]
fn a_rate_that_is_capped_is_saturated() {
    // The read-out sends one event every 2 us as long as the pixels make more.
    let mut random = Xorshift::new(3);
    let mut free_us = 0.0;
    let mut events = poisson(&mut random, LENGTH_US, 2e6, peaked(2e6));
    events.retain_mut(|event| {
        let t = (event.t.0 as f64).max(free_us);
        free_us = t + 2.0;
        event.t = CameraMicros(t as i64);
        t < LENGTH_US
    });
    let quality = quality(&events);
    assert!(quality.is_saturated() && !quality.is_flat(), "{quality:?}");
}

/// A stream in which ON follows a sine and OFF its opposite.
fn flickering(frequency_hz: f64, depth: f64) -> Vec<Event> {
    let mut random = Xorshift::new(4);
    let mut events = poisson(&mut random, LENGTH_US, 1e5, peaked(1e5));
    for event in &mut events {
        let phase = TAU * frequency_hz * event.t.0 as f64 * 1e-6;
        event.polarity = Polarity::from_on(random.uniform() < f64::midpoint(1.0, depth * phase.sin()));
    }
    events
}

#[test]
fn light_that_flickers_with_the_mains_is_seen() {
    for frequency_hz in [100, 120] {
        let quality = quality(&flickering(f64::from(frequency_hz), 0.7));
        assert!(quality.has_flicker(), "{quality:?}");
        assert_eq!(quality.flicker_hz, frequency_hz);
        assert!((quality.flicker_depth - 0.7).abs() < 0.05, "{quality:?}");
    }
}

#[test]
fn scenes_that_shake_do_not_flicker() {
    for frequency_hz in [3.0, 8.0, 15.0, 30.0, 60.0, 85.0] {
        let quality = quality(&flickering(frequency_hz, 0.9));
        assert!(quality.flicker_depth < 0.05, "{frequency_hz} Hz: {quality:?}");
    }
}

#[test]
fn a_handful_of_events_is_judged_without_a_panic() {
    let mut random = Xorshift::new(5);
    for number in [1, 2, 10] {
        let events: Vec<_> = (0..number).map(|index| event(&mut random, index * 100)).collect();
        assert!(!quality(&events).is_saturated());
    }
}

/// A tenth of a second of background and of one pixel that fires `often` times.
fn learn(background: usize, often: usize) -> (HotPixels, Event) {
    let mut random = Xorshift::new(6);
    let mut hot_pixels = HotPixels::new(GEOMETRY);
    let suspect = Event { t: CameraMicros(0), x: 17, y: 4, polarity: Polarity::On };
    let scene = (0..background).map(|_| event(&mut random, 0)).collect();
    let list = |events: Vec<Event>| EventList::of(events).unwrap();
    hot_pixels.observe(list(scene).as_slice());
    hot_pixels.observe(list(vec![suspect; often]).as_slice());
    hot_pixels.learn(Duration::from_millis(100));
    (hot_pixels, suspect)
}

#[test]
fn a_pixel_that_fires_by_itself_is_hot_and_its_neighbours_are_not() {
    let (hot_pixels, suspect) = learn(500, 40);
    assert_eq!(hot_pixels.number(), 1);
    assert!(hot_pixels.is_hot(&suspect));
    assert!(!hot_pixels.is_hot(&Event { x: 18, ..suspect }));
    assert!(!hot_pixels.is_hot(&Event { polarity: Polarity::Off, x: 17, y: 5, ..suspect }));
}

#[test]
fn a_busy_scene_has_no_hot_pixels() {
    // 30 events of every pixel in a tenth of a second.
    assert_eq!(learn(30 * GEOMETRY.pixels(), 0).0.number(), 0);
    // A pixel somewhat busier than the others.
    assert_eq!(learn(10 * GEOMETRY.pixels(), 40).0.number(), 0);
}

#[test]
fn a_few_events_prove_nothing_and_a_restart_forgets() {
    assert_eq!(learn(0, 11).0.number(), 0);
    let (mut hot_pixels, suspect) = learn(0, 40);
    assert!(hot_pixels.is_hot(&suspect));
    hot_pixels.restart();
    assert!(!hot_pixels.is_hot(&suspect));
    hot_pixels.learn(Duration::from_millis(100));
    assert_eq!(hot_pixels.number(), 0);
}

#[test]
fn events_off_the_sensor_are_no_pixels() {
    let mut hot_pixels = HotPixels::new(GEOMETRY);
    let outside = Event { t: CameraMicros(0), x: GEOMETRY.width, y: 0, polarity: Polarity::On };
    hot_pixels.observe(EventList::of([outside; 100]).unwrap().as_slice());
    hot_pixels.learn(Duration::from_millis(100));
    assert_eq!((hot_pixels.number(), hot_pixels.is_hot(&outside)), (0, false));
}
