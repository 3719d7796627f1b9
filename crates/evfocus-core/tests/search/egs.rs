//! Golden search: on exact functions, on any comparison at all, and on events.

use core::convert::Infallible;
use core::time::Duration;

use evfocus_core::search::{Comparison, GOLDEN_RATIO, MAX_ITERATIONS, STOP_INTERVAL_US, golden_search};
use evfocus_core::{CameraMicros, Method, SearchError, Searcher};
use proptest::prelude::*;

use crate::random::Xorshift;
use crate::stream::{GEOMETRY, event, poisson, position_is_time, record};

/// Chooses the window over which `integral` grows more.
fn by(integral: impl Fn(f64) -> f64) -> impl FnMut((f64, f64), (f64, f64)) -> Result<Comparison, Infallible> {
    move |first, second| {
        let score = |(from, to): (f64, f64)| integral(to) - integral(from);
        Ok(if score(first) >= score(second) { Comparison::First } else { Comparison::Second })
    }
}

proptest! {
    /// On a function with one peak, whatever its shape and its place, the range that is left holds the peak.
    #[test]
    fn the_peak_of_a_unimodal_function_is_found(
        start in -1e6..1e6_f64,
        length in 1e5..2e7_f64,
        share in 0.0..=1.0_f64,
        width in 0.01..1.0_f64,
        bell in any::<bool>(),
    ) {
        let (peak, width) = (start + share * length, width * length);
        let integral = |t: f64| {
            let x = (t - peak) / width;
            if bell { libm::erf(x) } else { libm::atan(x) }
        };
        let Ok(((from, to), iterations)) = golden_search((start, start + length), by(integral));
        prop_assert!(to - from <= STOP_INTERVAL_US);
        prop_assert!(peak >= from - 1.0 && peak <= to + 1.0, "{} is not in {} to {}", peak, from, to);
        let expected = libm::ceil(libm::log(STOP_INTERVAL_US / length) / libm::log(GOLDEN_RATIO));
        prop_assert_eq!(iterations, expected as u32);
    }

    /// Whatever the comparison says, the search ends within its bound and within its range.
    #[test]
    fn any_comparison_ends(
        (start, length) in (-1e15..1e15_f64, prop_oneof![0.0..1e4_f64, 0.0..1e18_f64]),
        seed in any::<u64>(),
    ) {
        let mut random = Xorshift::new(seed);
        let compare = |_, _| Ok::<_, Infallible>(match random.next() % 8 {
            0..4 => Comparison::First,
            _ => Comparison::Second,
        });
        let Ok(((from, to), iterations)) = golden_search((start, start + length), compare);
        prop_assert!(iterations <= MAX_ITERATIONS);
        prop_assert!(from >= start && to <= start + length);
    }

    /// The answer is the same whether the counter's bins decide alone or the kept events settle what lies inside of them, up to the
    /// search's own uncertainty.
    #[test]
    fn bins_and_exact_times_agree(seed in any::<u64>(), peak in 0.3e6..1.7e6_f64) {
        let mut random = Xorshift::new(seed);
        let events = poisson(&mut random, 2e6, 2e4, |t| 1e3 + 1.9e4 / (1.0 + ((t - peak) / 1e5).powi(2)));
        let trace = position_is_time(2_000_000);
        let mut searcher = Searcher::new(GEOMETRY);
        for kept in [events.len(), 0] {
            let recorder = record(&events, kept);
            let Some(sweep) = recorder.sweep(&trace) else { return Err(TestCaseError::fail("no sweep")) };
            let answer = searcher.search(Method::Egs, &sweep, Duration::ZERO)?;
            prop_assert!((answer.t_us - peak).abs() < 60_000.0, "{} for {}, {} kept", answer.t_us, peak, kept);
            prop_assert!(answer.position.distance(evfocus_core::LensPosition(answer.t_us)) < 1e-3);
        }
    }
}

#[test]
fn four_seconds_take_eighteen_comparisons() {
    let Ok((_, iterations)) = golden_search((0.0, 4e6), by(|t| libm::erf((t - 1e6) / 1e5)));
    assert_eq!(iterations, 18);
}

#[test]
fn undecided_ends_the_search_with_the_range_as_it_is() {
    let mut rounds = 0;
    let compare = |_, _| {
        rounds += 1;
        Ok::<_, Infallible>(if rounds == 3 { Comparison::Undecided } else { Comparison::First })
    };
    let Ok(((from, to), iterations)) = golden_search((0.0, 4e6), compare);
    assert_eq!(iterations, 3);
    assert!(from.abs() < 1e-9 && (to - 4e6 * GOLDEN_RATIO * GOLDEN_RATIO).abs() < 1e-3);
}

#[test]
fn an_error_of_the_comparison_ends_the_search() {
    assert_eq!(golden_search((0.0, 4e6), |_, _| Err("broken")), Err("broken"));
}

#[test]
fn too_few_events_to_tell_stop_the_search_early() {
    let mut random = Xorshift::new(7);
    let events: Vec<_> = (0..40).map(|index| event(&mut random, index * 100_000)).collect();
    let (recorder, trace) = (record(&events, 40), position_is_time(4_000_000));
    let sweep = recorder.sweep(&trace).unwrap();
    let answer = Searcher::new(GEOMETRY).search(Method::Egs, &sweep, Duration::ZERO).unwrap();
    assert!(answer.iterations < 10, "{} comparisons of 40 events", answer.iterations);
}

#[test]
fn a_sweep_without_length_has_no_answer() {
    let mut random = Xorshift::new(7);
    let events: Vec<_> = (0..100).map(|_| event(&mut random, 5_000)).collect();
    let (recorder, trace) = (record(&events, 100), position_is_time(10_000));
    let sweep = recorder.sweep(&trace).unwrap();
    for method in Method::ALL {
        let answer = Searcher::new(GEOMETRY).search(method, &sweep, Duration::from_millis(1));
        assert_eq!(answer, Err(SearchError::NoLength { at_us: 5_000 }));
    }
}

#[test]
fn the_trace_is_held_at_its_ends_for_a_while_and_no_longer() {
    let mut random = Xorshift::new(7);
    let events: Vec<_> = (0..1_000).map(|index| event(&mut random, index * 1_000)).collect();
    let recorder = record(&events, 1_000);
    let bounds = |from: i64, to: i64| {
        let mut trace = position_is_time(0);
        trace.clear();
        trace.push_if_later(CameraMicros(from), evfocus_core::LensPosition(0.0));
        trace.push_if_later(CameraMicros(to), evfocus_core::LensPosition(1.0));
        recorder.sweep(&trace).map(|sweep| (sweep.start.0, sweep.end.0))
    };
    assert_eq!(bounds(40_000, 960_000), Some((0, 999_000)));
    assert_eq!(bounds(200_000, 800_000), Some((150_000, 850_000)));
    assert_eq!(bounds(2_000_000, 3_000_000), None);
}
