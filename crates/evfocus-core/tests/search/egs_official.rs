//! `egs-official` against the authors' procedure done event by event, and against our golden search.

use core::time::Duration;

use evfocus_core::{Event, Method, Searcher};
use proptest::prelude::*;

use crate::random::Xorshift;
use crate::stream::{GEOMETRY, event, poisson, position_is_time, record};

/// Counts the events after `start` and up to `start + length` by looking at one after the other, until one after the end is
/// seen; its time. `None` if there is no such event.
fn scan(events: &[Event], start: f64, length: f64) -> Option<(u32, f64)> {
    let mut count = 0;
    for event in events {
        let t = event.t.0 as f64;
        if t > start + length {
            return Some((count, t));
        }
        if t > start {
            count += 1;
        }
    }
    None
}

/// Time of the event whose position the authors' code answers with.
fn literal(events: &[Event]) -> Option<f64> {
    let mut subset = events.to_vec();
    let mut range = f64::INFINITY;
    let mut centre = None;
    while range > 1_000.0 {
        let (start, end) = (subset.first()?.t.0 as f64, subset.last()?.t.0 as f64);
        range = end - start;
        let delta = 0.618 * range;
        let second_start = start + 0.381 * range;
        let (first, second) = (scan(&subset, start, delta), scan(&subset, second_start, delta));
        let (from, after) = match (first, second) {
            (Some((one, after)), Some((two, _))) if one >= two => (start, after),
            (_, Some((_, after))) => (second_start, after),
            (Some((_, after)), None) => (start, after),
            (None, None) => break,
        };
        centre = Some(from + delta / 2.0);
        subset.retain(|event| (after - delta..=after).contains(&(event.t.0 as f64)));
    }
    let centre = centre?;
    events.iter().map(|event| event.t.0 as f64).find(|&t| t >= centre)
}

fn ours(events: &[Event], method: Method) -> Option<f64> {
    let (recorder, trace) = (record(events, events.len()), position_is_time(4_000_000));
    let sweep = recorder.sweep(&trace)?;
    Searcher::new(GEOMETRY).search(method, &sweep, Duration::ZERO).ok().map(|answer| answer.t_us)
}

proptest! {
    /// On any stream, dense or thin, with and without equal times, the answer is that of the procedure done event by event.
    #[test]
    fn the_answer_is_that_of_the_literal_procedure(
        seed in any::<u64>(),
        mean_gap in 1.0..50_000.0_f64,
        grain in prop_oneof![Just(1_i64), Just(1_000)],
        peak in 0.0..4e6_f64,
    ) {
        let mut random = Xorshift::new(seed);
        let (mut t, mut events) = (0.0, Vec::new());
        while t < 4e6 && events.len() < 4_000 {
            events.push(event(&mut random, t as i64 / grain * grain));
            t += random.exponential(mean_gap * (0.2 + ((t - peak) / 1e6).powi(2)));
        }
        // A sweep without length is refused, and one on which no window can be scored has no answer of theirs.
        if let (Some(theirs), true) = (literal(&events), events[0].t < events[events.len() - 1].t) {
            prop_assert_eq!(ours(&events, Method::EgsOfficial), Some(theirs));
        }
    }
}

#[test]
fn it_differs_from_golden_search_by_no_more_than_chance() {
    // A bell of this width on a floor of a twentieth of its height; its mean over the 4 s as a share of its height.
    let width_us = 1e5;
    let mean_share = 0.05 + 0.95 * libm::sqrt(core::f64::consts::PI) * width_us / 4e6;
    for (mean_rate, streams) in [(2e3, 60), (1e4, 40), (1e5, 6), (3e5, 1)] {
        let mut random = Xorshift::new(mean_rate as u64);
        let highest = mean_rate / mean_share;
        let mut differences: Vec<f64> = (0..streams)
            .filter_map(|_| {
                let peak = 4e6 * (0.1 + 0.8 * random.uniform());
                let rate = |t: f64| highest * (0.05 + 0.95 * libm::exp(-((t - peak) / width_us).powi(2)));
                let events = poisson(&mut random, 4e6, highest, rate);
                Some((ours(&events, Method::Egs)? - ours(&events, Method::EgsOfficial)?).abs() / 1e3)
            })
            .collect();
        differences.sort_by(f64::total_cmp);
        assert_eq!(differences.len(), streams);
        let (median, most) = (differences[streams / 2], differences[streams * 95 / 100]);
        println!("{mean_rate:.0} events/s: median {median:.1} ms, 95 % within {most:.1} ms");
        assert!(median <= 6.0 && most <= 47.0, "median {median} ms, 95 % within {most} ms");
    }
}
