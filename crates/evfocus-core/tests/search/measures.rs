//! Focus measures against counting one by one.

use core::time::Duration;
use std::collections::BTreeMap;

use evfocus_core::{CounterError, Event, FocusCurve, Method, PixelCounts, SearchError, Searcher, event_rate};
use proptest::prelude::*;

use crate::random::Xorshift;
use crate::stream::{GEOMETRY, event, poisson, position_is_time, record};

/// Events at these times, anywhere on the sensor.
fn at(times: impl IntoIterator<Item = i64>) -> Vec<Event> {
    let mut random = Xorshift::new(3);
    times.into_iter().map(|t| event(&mut random, t)).collect()
}

fn fixed(events: &[Event], interval: Duration) -> Result<f64, SearchError> {
    let (recorder, trace) = (record(events, 0), position_is_time(10_000_000));
    let sweep = recorder.sweep(&trace).unwrap();
    Searcher::new(GEOMETRY).search(Method::ErFixed, &sweep, interval).map(|answer| answer.t_us)
}

proptest! {
    /// The squared rate is the sum over pixels of the squared number of their events by the squared interval, each time it is asked.
    #[test]
    fn squared_rate_is_the_sum_of_squares(seed in any::<u64>(), (a, b) in (0.0..2e5_f64, 0.0..2e5_f64)) {
        let (from, to) = (a.min(b), a.max(b) + 1.0);
        let mut random = Xorshift::new(seed);
        let mut events = poisson(&mut random, 2e5, 3e4, |_| 3e4);
        for event in &mut events {
            // Few pixels, so that many fire more than once.
            event.x %= 7;
            event.y %= 5;
        }
        let mut pixels: BTreeMap<(u16, u16), f64> = BTreeMap::new();
        for event in events.iter().filter(|event| (from..to).contains(&(event.t.0 as f64))) {
            *pixels.entry((event.x, event.y)).or_default() += 1.0;
        }
        let seconds = (to - from) * 1e-6;
        let expected: f64 = pixels.values().map(|count| (count / seconds).powi(2)).sum();
        let recorder = record(&events, events.len());
        let mut counts = PixelCounts::new(GEOMETRY);
        for _ in 0..2 {
            let squared = counts.event_rate_squared(recorder.store(), from, to);
            prop_assert!((squared - expected).abs() <= 1e-9 * expected);
        }
    }

    /// A window of the fixed search that wins holds at least as many events as any other window that was tried.
    #[test]
    fn the_fullest_window_wins(seed in any::<u64>(), interval_ms in 1..100_u64) {
        let mut random = Xorshift::new(seed);
        let events = poisson(&mut random, 3e5, 2e3, |t| 500.0 + t / 200.0);
        let (start, end) = (events[0].t.0 as f64, events[events.len() - 1].t.0 as f64);
        let recorder = record(&events, 0);
        let held = |centre: f64| {
            let half = interval_ms as f64 * 500.0;
            recorder.counter().count_between((centre - half).max(start), (centre + half).min(end))
        };
        let best = fixed(&events, Duration::from_millis(interval_ms))?;
        let fullest = held(best)?.total();
        for step in 0..((end - start) / 1e3) as u32 {
            prop_assert!(held(start + f64::from(step) * 1e3)?.total() <= fullest);
        }
    }
}

#[test]
fn the_event_rate_is_events_by_time() {
    let events = at((0..1_000).map(|index| index * 100));
    let recorder = record(&events, 0);
    let rate = event_rate(recorder.counter(), 20_000.0, 60_000.0).unwrap();
    assert!((rate.0 - 1e4).abs() < 1e-6);
    for (from, to) in [(20_000.0, 20_000.0), (60_000.0, 20_000.0)] {
        assert_eq!(
            event_rate(recorder.counter(), from, to),
            Err(CounterError::NotAnInterval { from_us: from, to_us: to })
        );
    }
}

#[test]
fn the_fixed_search_centres_its_window_on_a_burst() {
    // One event a millisecond, and 100 within a millisecond at 0.3 s.
    let mut times: Vec<i64> = (0..=600).map(|index| index * 1_000).collect();
    times.extend((0..100).map(|index| 300_000 + index * 10));
    times.sort_unstable();
    let best = fixed(&at(times), Duration::from_millis(20)).unwrap();
    assert!((best - 300_000.0).abs() <= 10_000.0, "{best}");
}

#[test]
fn the_fixed_search_takes_the_first_of_equals() {
    let times = [0, 100_000, 100_001, 300_000, 300_001, 500_000];
    let best = fixed(&at(times), Duration::from_millis(10)).unwrap();
    assert!((90_000.0..110_000.0).contains(&best), "{best}");
}

#[test]
fn an_interval_that_does_not_fit_is_refused() {
    let events = at((0..100).map(|index| index * 1_000));
    for interval in [Duration::ZERO, Duration::from_millis(100)] {
        assert!(matches!(fixed(&events, interval), Err(SearchError::IntervalTooLong { .. })));
    }
    assert!(fixed(&events, Duration::from_millis(99)).is_ok());
}

#[test]
fn methods_that_need_every_event_say_so() {
    let events = at((0..100).map(|index| index * 1_000));
    let (recorder, trace) = (record(&events, 90), position_is_time(100_000));
    let sweep = recorder.sweep(&trace).unwrap();
    for (method, needs_all) in Method::ALL.into_iter().zip([false, true, false, true, true]) {
        let answer = Searcher::new(GEOMETRY).search(method, &sweep, Duration::from_millis(10));
        let refused = answer == Err(SearchError::EventsNotKept { not_kept: 10 });
        assert_eq!(refused, needs_all, "{method}");
    }
}

#[test]
fn squared_rate_search_finds_the_peak() {
    let mut random = Xorshift::new(11);
    let events = poisson(&mut random, 2e6, 1e5, |t| 1e3 + 9.9e4 * libm::exp(-((t - 1.3e6) / 2e5).powi(2)));
    let (recorder, trace) = (record(&events, events.len()), position_is_time(2_000_000));
    let sweep = recorder.sweep(&trace).unwrap();
    let answer = Searcher::new(GEOMETRY).search(Method::ErSquared, &sweep, Duration::ZERO).unwrap();
    assert!((answer.t_us - 1.3e6).abs() < 5e4, "{}", answer.t_us);
}

#[test]
fn a_curve_adds_up_to_the_events_of_the_sweep() {
    let mut random = Xorshift::new(11);
    let events = poisson(&mut random, 2e6, 1e4, |t| t / 200.0);
    let (recorder, trace) = (record(&events, 0), position_is_time(2_000_000));
    let sweep = recorder.sweep(&trace).unwrap();
    let mut curve = FocusCurve::new();
    curve.fill(&sweep);
    assert_eq!(curve.points().len(), FocusCurve::POINTS);
    let step_s = sweep.length_us() / FocusCurve::POINTS as f64 * 1e-6;
    let sum: f64 = curve.points().iter().map(|point| point.rate.0 * step_s).sum();
    assert!((sum - events.len() as f64).abs() <= 2.0, "{sum} of {}", events.len());
    assert!(curve.points().windows(2).all(|pair| pair[0].position < pair[1].position));
}

#[test]
fn methods_have_names_that_read_back() {
    for method in Method::ALL {
        assert_eq!(method.to_string().parse(), Ok(method));
    }
    assert!("golden".parse::<Method>().is_err());
}
