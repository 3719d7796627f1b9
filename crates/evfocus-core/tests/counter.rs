//! The counter against counting one by one.

use core::time::Duration;

use evfocus_core::{CameraMicros, CounterError, CumulativeCounter, Event, EventCounts, EventList, Polarity};
use proptest::prelude::*;

/// Events in the order of time: gaps and polarities, after an origin that may be microseconds since 1970.
fn streams() -> impl Strategy<Value = (i64, Vec<Event>)> {
    let origins =
        prop_oneof![Just(0), Just(-12_345), Just(1_763_800_000_000_000), any::<i32>().prop_map(i64::from)];
    let gaps = prop_oneof![8 => 0..12_i64, 2 => 0..200_i64, 1 => 0..3_000_i64];
    (origins, prop::collection::vec((gaps, any::<bool>()), 1..300)).prop_map(|(origin, gaps)| {
        let mut t = origin;
        let event = |(gap, on)| {
            t += gap;
            Event { t: CameraMicros(t), x: 0, y: 0, polarity: Polarity::from_on(on) }
        };
        (origin, gaps.into_iter().map(event).collect())
    })
}

fn naive(events: &[Event], from: i64, to: i64) -> EventCounts {
    let mut counts = EventCounts::default();
    for event in events.iter().filter(|event| from <= event.t.0 && event.t.0 < to) {
        if event.polarity.is_on() { counts.on += 1.0 } else { counts.off += 1.0 }
    }
    counts
}

fn list(events: &[Event]) -> EventList {
    let mut list = EventList::default();
    assert_eq!(list.append(events.iter().copied()), 0);
    list
}

fn counter_of(origin: i64, events: &[Event], bin: u64, horizon: u64) -> CumulativeCounter {
    let mut counter = CumulativeCounter::new(Duration::from_micros(bin), Duration::from_micros(horizon));
    counter.start(CameraMicros(origin));
    counter.count(list(events).as_slice());
    counter
}

/// What two shares of the counter's past (0 the oldest, 1 the newest moment) mean in microseconds, the earlier first.
fn span(counter: &CumulativeCounter, a: f64, b: f64) -> (f64, f64) {
    let (oldest, length) = (counter.oldest().0, counter.newest().micros_since(counter.oldest()) as f64);
    let time = |share: f64| oldest as f64 + (share * length).floor();
    (time(a.min(b)), time(a.max(b)))
}

proptest! {
    /// From bin edge to bin edge the counter gives exactly what counting one by one gives, for each polarity.
    #[test]
    fn whole_bins_are_exact(
        (origin, events) in streams(),
        bin in 1..50_u64,
        horizon in 1..20_000_u64,
        (a, b) in (0.0..=1.0, 0.0..=1.0),
    ) {
        let counter = counter_of(origin, &events, bin, horizon);
        let (from, to) = span(&counter, a, b);
        let edge = |t: f64| origin + (t as i64 - origin).div_euclid(bin as i64) * bin as i64;
        let (from, to) = (edge(from), edge(to));
        let counted = counter.count_between(from as f64, to as f64)?;
        prop_assert_eq!(counted, naive(&events, from, to));
    }

    /// Inside of bins the count errs by no more than what the bins at the two ends hold.
    #[test]
    fn inside_of_bins_errs_by_the_bins_content(
        (origin, events) in streams(),
        bin in 1..50_u64,
        horizon in 1..20_000_u64,
        (a, b) in (0.0..=1.0, 0.0..=1.0),
    ) {
        let counter = counter_of(origin, &events, bin, horizon);
        let (from, to) = span(&counter, a, b);
        let bin = bin as i64;
        let floor = |t: f64| origin + (t as i64 - origin).div_euclid(bin) * bin;
        let ends = [floor(from), floor(to)].map(|start| naive(&events, start, start + bin).total());
        let error = counter.count_between(from, to)?.total() - naive(&events, from as i64, to as i64).total();
        prop_assert!(error.abs() <= ends[0] + ends[1] + 1e-9, "{} events off, the end bins hold {:?}", error, ends);
    }

    /// Adjacent intervals add up to the interval that they make together.
    #[test]
    fn counts_are_additive((origin, events) in streams(), (a, b, c) in (0.0..=1.0, 0.0..=1.0, 0.0..=1.0)) {
        let counter = counter_of(origin, &events, 20, 1_000_000);
        let mut shares = [a, b, c];
        shares.sort_by(f64::total_cmp);
        let (from, middle) = span(&counter, shares[0], shares[1]);
        let (_, to) = span(&counter, shares[1], shares[2]);
        let parts = counter.count_between(from, middle)?.total() + counter.count_between(middle, to)?.total();
        let whole = counter.count_between(from, to)?.total();
        prop_assert!((parts - whole).abs() < 1e-6, "{} and {}", parts, whole);
    }

    /// How a stream is cut into batches makes no difference.
    #[test]
    fn batches_do_not_matter((origin, events) in streams(), size in 1..40_usize, (a, b) in (0.0..=1.0, 0.0..=1.0)) {
        let whole = counter_of(origin, &events, 20, 1_000);
        let mut parts = counter_of(origin, &[], 20, 1_000);
        for batch in events.chunks(size) {
            parts.count(list(batch).as_slice());
        }
        let (from, to) = span(&whole, a, b);
        prop_assert_eq!(whole.count_between(from, to)?, parts.count_between(from, to)?);
        prop_assert_eq!(whole.totals(), parts.totals());
        prop_assert_eq!(whole.late(), 0);
    }

    /// The counter answers for the whole horizon before its newest event, and for anything older it answers exactly or not at all.
    #[test]
    fn the_horizon_is_kept_and_the_overwritten_refused(
        (origin, events) in streams(),
        bin in 1..50_u64,
        horizon in 1..5_000_u64,
        age in 0..20_000_i64,
    ) {
        let counter = counter_of(origin, &events, bin, horizon);
        let newest = events[events.len() - 1].t.0;
        let end = counter.newest().0;
        let from = newest - age;
        let expected = naive(&events, from, end).total();
        match counter.count_between(from as f64, end as f64) {
            Ok(counts) => {
                let bin = bin as i64;
                let start = origin + (from - origin).div_euclid(bin) * bin;
                let slack = naive(&events, start, start + bin).total();
                prop_assert!((counts.total() - expected).abs() <= slack + 1e-9);
            }
            Err(CounterError::Overwritten { oldest_us, .. }) => {
                prop_assert!(age > horizon as i64 || from < origin, "{} us ago is overwritten", age);
                prop_assert!(from < oldest_us);
            }
            Err(other) => prop_assert!(false, "{}", other),
        }
    }

    /// Whatever the times, even out of order: nothing panics and the totals count every event.
    #[test]
    fn totals_are_exact_even_out_of_order(times in prop::collection::vec(any::<i64>(), 0..50)) {
        let mut counter = CumulativeCounter::new(Duration::from_micros(20), Duration::from_millis(1));
        for &t in &times {
            counter.count(list(&[on(t)]).as_slice());
        }
        prop_assert_eq!(counter.totals(), (times.len() as u64, 0));
    }
}

fn on(t: i64) -> Event {
    Event { t: CameraMicros(t), x: 0, y: 0, polarity: Polarity::On }
}

#[test]
fn a_counter_never_started_has_no_numbers() {
    let counter = CumulativeCounter::new(Duration::from_micros(20), Duration::from_millis(1));
    assert_eq!(counter.count_between(0.0, 1.0), Err(CounterError::Empty));
}

#[test]
fn the_first_event_starts_a_counter_that_was_not_started() {
    let mut counter = CumulativeCounter::new(Duration::from_micros(20), Duration::from_millis(1));
    counter.count(list(&[on(1_000), on(1_010)]).as_slice());
    assert_eq!(counter.oldest(), CameraMicros(1_000));
    assert_eq!(counter.count_between(1_000.0, 1_020.0).map(EventCounts::total), Ok(2.0));
}

#[test]
fn what_is_no_interval_is_refused() {
    let counter = counter_of(0, &[on(0), on(500)], 20, 1_000);
    for (from, to) in [(f64::NAN, 1.0), (1.0, f64::NAN), (2.0, 1.0), (f64::INFINITY, f64::NEG_INFINITY)] {
        assert!(matches!(counter.count_between(from, to), Err(CounterError::NotAnInterval { .. })));
    }
}

#[test]
fn the_future_and_the_time_before_the_start_are_refused() {
    let counter = counter_of(100, &[on(100), on(519)], 20, 1_000);
    assert_eq!(counter.newest(), CameraMicros(520));
    assert!(counter.count_between(100.0, 520.0).is_ok());
    for to in [520.5, 1e18, f64::INFINITY] {
        assert!(matches!(counter.count_between(100.0, to), Err(CounterError::NotYetCounted { .. })));
    }
    for from in [99.0, -1e18, f64::NEG_INFINITY] {
        assert!(matches!(counter.count_between(from, 200.0), Err(CounterError::Overwritten { .. })));
    }
}

#[test]
fn a_silence_longer_than_the_ring_leaves_empty_bins() {
    let mut counter = counter_of(0, &[on(0), on(5)], 20, 1_000);
    counter.advance_to(CameraMicros(10_000_000));
    assert_eq!(counter.totals(), (2, 0));
    let oldest = counter.oldest().0 as f64;
    assert!(10_000_000.0 - oldest >= 1_000.0);
    assert_eq!(counter.count_between(oldest, 10_000_000.0).map(EventCounts::total), Ok(0.0));
    assert!(matches!(counter.count_between(0.0, 10_000_000.0), Err(CounterError::Overwritten { .. })));
    counter.count(list(&[on(10_000_001)]).as_slice());
    assert_eq!(counter.count_between(oldest, 10_000_020.0).map(EventCounts::total), Ok(1.0));
}

#[test]
fn late_events_are_counted_where_the_counter_stands_and_reported() {
    let mut counter = counter_of(0, &[on(0), on(105)], 20, 1_000);
    counter.count(list(&[on(50), on(110)]).as_slice());
    assert_eq!(counter.late(), 1);
    assert_eq!(counter.totals(), (4, 0));
    assert_eq!(counter.count_between(40.0, 60.0).map(EventCounts::total), Ok(0.0));
    assert_eq!(counter.count_between(100.0, 120.0).map(EventCounts::total), Ok(3.0));
}

#[test]
fn a_new_start_forgets() {
    let mut counter = counter_of(0, &[on(0), on(105)], 20, 1_000);
    counter.start(CameraMicros(50));
    assert_eq!((counter.totals(), counter.late()), ((0, 0), 0));
    assert_eq!(counter.count_between(50.0, 70.0).map(EventCounts::total), Ok(0.0));
    assert!(counter.count_between(0.0, 60.0).is_err());
}
