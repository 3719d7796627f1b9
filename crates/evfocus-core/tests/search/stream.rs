//! Event streams out of numbers that are the same on every machine.

use core::time::Duration;

use evfocus_core::{
    CameraMicros, Event, EventList, Geometry, LensPosition, LensTrace, Polarity, SweepCapacity, SweepRecorder,
};

use crate::random::Xorshift;

pub(crate) const GEOMETRY: Geometry = Geometry { width: 64, height: 48 };

/// Events by chance from 0 to `length_us`, `rate(t_us)` of them a second, which is at most `highest`; both polarities alike.
pub(crate) fn poisson(
    random: &mut Xorshift,
    length_us: f64,
    highest: f64,
    rate: impl Fn(f64) -> f64,
) -> Vec<Event> {
    let mut events = Vec::new();
    let mut t_us = 0.0;
    loop {
        t_us += random.exponential(1e6 / highest);
        if t_us >= length_us {
            return events;
        }
        if random.uniform() * highest < rate(t_us) {
            events.push(event(random, t_us as i64));
        }
    }
}

/// An event somewhere on the sensor.
pub(crate) fn event(random: &mut Xorshift, t_us: i64) -> Event {
    let place = random.next();
    Event {
        t: CameraMicros(t_us),
        x: (place >> 8) as u16 % GEOMETRY.width,
        y: (place >> 24) as u16 % GEOMETRY.height,
        polarity: Polarity::from_on(place & 1 == 1),
    }
}

/// `events` as a recorder holds them after the sweep; `kept` is the room for single events.
pub(crate) fn record(events: &[Event], kept: usize) -> SweepRecorder {
    let at = |event: Option<&Event>| event.map_or(CameraMicros(0), |event| event.t);
    let (first, last) = (at(events.first()), at(events.last()));
    let longest = last.since(first) + Duration::from_millis(1);
    let mut recorder =
        SweepRecorder::new(GEOMETRY, SweepCapacity { longest, events: kept, ..SweepCapacity::default() });
    recorder.start(first);
    recorder.feed(EventList::of(events.iter().copied()).unwrap().as_slice());
    recorder
}

/// A lens that is at position t at t microseconds, so that an answer's position is its time.
pub(crate) fn position_is_time(length_us: i64) -> LensTrace<CameraMicros> {
    let mut trace = LensTrace::with_capacity(2);
    trace.push_if_later(CameraMicros(0), LensPosition(0.0));
    trace.push_if_later(CameraMicros(length_us), LensPosition(length_us as f64));
    trace
}
