//! The lens trace between, at and beyond its samples, and where it turns.

use evfocus_core::{CameraMicros, Leg, LensPosition, LensTrace, LensTraceError};
use proptest::prelude::*;

fn trace(samples: impl IntoIterator<Item = (i64, f64)>) -> LensTrace<CameraMicros> {
    let mut trace = LensTrace::with_capacity(100_000);
    for (time, position) in samples {
        trace.push_if_later(CameraMicros(time), LensPosition(position));
    }
    trace
}

fn traces() -> impl Strategy<Value = LensTrace<CameraMicros>> {
    prop::collection::vec((1..10_000_i64, 0.0..4_000.0_f64), 2..60).prop_map(|steps| {
        let mut time = 0;
        trace(steps.into_iter().map(|(step, position)| {
            time += step;
            (time, position)
        }))
    })
}

proptest! {
    /// At each time at which the lens passed a position, it is at that position.
    #[test]
    fn at_a_crossing_the_lens_is_there(trace in traces(), position in 0.0..4_000.0_f64) {
        for time in trace.crossings(LensPosition(position)) {
            prop_assert!(trace.position_at(time)?.distance(LensPosition(position)) < 1e-6);
        }
    }

    /// A lens that comes from one side of a position and ends on the other has passed it an odd number of times.
    #[test]
    fn crossings_alternate(trace in traces(), position in 0.0..4_000.0_f64) {
        let side = |end: Option<(CameraMicros, LensPosition)>| end.map(|(_, there)| there.0 < position);
        let changed = side(trace.first()) != side(trace.last());
        prop_assert_eq!(trace.crossings(LensPosition(position)).count() % 2 == 1, changed);
    }

    /// Between two samples the position lies between theirs, and at a sample it is the sample's.
    #[test]
    fn interpolation_stays_between(trace in traces(), share in 0.0..=1.0_f64) {
        let samples: Vec<_> = trace.samples().collect();
        for pair in samples.windows(2) {
            let [(t0, p0), (t1, p1)] = [pair[0], pair[1]];
            let between = trace.position_at(t0.0 as f64 + share * (t1.0 - t0.0) as f64)?.0;
            prop_assert!(between >= p0.0.min(p1.0) - 1e-9 && between <= p0.0.max(p1.0) + 1e-9);
            prop_assert!(trace.position_at(t0.0 as f64)?.distance(p0) < 1e-9);
            prop_assert_eq!(trace.position_held(t1.0 as f64 - 0.5), Some(p0));
            prop_assert_eq!(trace.position_held(t1.0 as f64), Some(p1));
        }
    }

    /// The legs follow one another without a gap, cover the whole trace, and turn each time.
    #[test]
    fn legs_cover_the_trace(trace in traces(), tolerance in 1.0..2_000.0_f64) {
        let legs = trace.legs(tolerance);
        if let (Some(first), Some(last)) = (legs.first(), legs.last()) {
            prop_assert_eq!(Some(first.start), trace.first().map(|(time, _)| time));
            prop_assert_eq!(Some(last.end), trace.last().map(|(time, _)| time));
        }
        for pair in legs.windows(2) {
            prop_assert_eq!(pair[0].end, pair[1].start);
            prop_assert_eq!(pair[0].to, pair[1].from);
            prop_assert!((pair[0].to > pair[0].from) != (pair[1].to > pair[1].from));
        }
        for leg in &legs {
            prop_assert!(leg.start < leg.end && leg.to.distance(leg.from) > tolerance);
        }
    }

    /// Read-out noise moves the turn of a sweep there and back by no more than the noise does: it lies in the middle of the rest.
    #[test]
    fn a_turn_lies_in_the_middle_of_the_rest(
        noise in prop::collection::vec(-15.0..15.0_f64, 3_001),
        rest_ms in 0..400_i64,
    ) {
        let samples = noise.iter().enumerate().map(|(index, noise)| {
            let t = index as i64;
            let at = if t < 1_300 { 220 + 2 * t } else { 2_820 - 2 * (t - 1_300 - rest_ms).max(0) };
            (t * 1_000, (at as f64).max(220.0) + noise)
        });
        let legs = trace(samples).legs(100.0);
        prop_assert_eq!(legs.len(), 2);
        let middle = (1_300 + rest_ms / 2) * 1_000;
        prop_assert!((legs[0].end.0 - middle).abs() <= 16_000, "{} and {}", legs[0].end.0, middle);
    }
}

#[test]
fn outside_of_the_trace_positions_are_refused_or_held() {
    let trace = trace([(100, 1.0), (200, 3.0)]);
    assert_eq!(trace.position_at(150.0), Ok(LensPosition(2.0)));
    assert_eq!(trace.position_at(200.0), Ok(LensPosition(3.0)));
    for outside in [99.9, 200.1, f64::NAN, f64::INFINITY] {
        assert!(matches!(trace.position_at(outside), Err(LensTraceError::Outside { .. })));
    }
    assert_eq!(trace.position_near(0.0), Some(LensPosition(1.0)));
    assert_eq!(trace.position_near(1e9), Some(LensPosition(3.0)));
    assert_eq!(trace.position_near(f64::NAN), None);
    assert_eq!(trace.position_held(0.0), Some(LensPosition(1.0)));
}

#[test]
fn an_empty_trace_and_one_of_one_sample_do_not_panic() {
    let mut trace = LensTrace::<CameraMicros>::with_capacity(0);
    assert_eq!(trace.position_at(0.0), Err(LensTraceError::Empty));
    assert_eq!((trace.position_near(0.0), trace.position_held(0.0), trace.extent()), (None, None, None));
    assert!(trace.legs(1.0).is_empty());
    trace.push_if_later(CameraMicros(5), LensPosition(7.0));
    assert_eq!(trace.position_at(5.0), Ok(LensPosition(7.0)));
    assert_eq!(trace.crossings(LensPosition(7.0)).count(), 0);
}

#[test]
fn samples_must_be_later_than_the_last() {
    let mut trace = trace([(100, 1.0)]);
    let refused = trace.push(CameraMicros(100), LensPosition(2.0));
    assert_eq!(refused, Err(LensTraceError::NotLater { time: 100, last: 100 }));
    trace.push_if_later(CameraMicros(50), LensPosition(2.0));
    assert_eq!(trace.samples().collect::<Vec<_>>(), [(CameraMicros(100), LensPosition(1.0))]);
}

#[test]
fn the_oldest_sample_makes_room() {
    let mut trace = LensTrace::with_capacity(3);
    for time in 0..10 {
        assert_eq!(trace.push(CameraMicros(time), LensPosition(time as f64)), Ok(()));
    }
    assert_eq!(trace.len(), 3);
    assert_eq!(trace.first(), Some((CameraMicros(7), LensPosition(7.0))));
    assert_eq!(trace.extent(), Some((LensPosition(7.0), LensPosition(9.0))));
    trace.clear();
    assert!(trace.is_empty());
}

#[test]
fn one_way_with_rests_is_one_leg() {
    let there = trace((0..1_000).map(|t| (t * 1_000, (220 + (t - 100).clamp(0, 700) * 5) as f64)));
    let leg = Leg {
        start: CameraMicros(0),
        end: CameraMicros(999_000),
        from: LensPosition(220.0),
        to: LensPosition(3_720.0),
    };
    assert_eq!(there.legs(100.0), [leg]);
    let back = trace((0..1_000).map(|t| (t * 1_000, (3_720 - (t - 100).clamp(0, 700) * 5) as f64)));
    assert_eq!(back.legs(100.0), [Leg { from: LensPosition(3_720.0), to: LensPosition(220.0), ..leg }]);
}

#[test]
fn a_lens_that_never_moves_further_than_the_tolerance_has_no_legs() {
    assert!(trace((0..1_000).map(|t| (t, 220.0))).legs(0.0).is_empty());
    assert!(trace((0..1_000).map(|t| (t, (t % 10) as f64))).legs(10.0).is_empty());
}

#[test]
fn overshoot_within_the_tolerance_is_no_turn() {
    let overshoots = [(0, 0.0), (1_000, 1_000.0), (1_100, 1_040.0), (1_200, 1_000.0), (2_000, 1_001.0)];
    assert_eq!(trace(overshoots).legs(50.0).len(), 1);
    assert_eq!(trace(overshoots).legs(30.0).len(), 2);
}
