//! Sweeps of any number of events within the same time, out of one batch that is made beforehand.

use core::time::Duration;

use evfocus_core::{
    CameraMicros, Event, EventList, Geometry, LensPosition, LensTrace, Polarity, SweepCapacity, SweepRecorder,
};

/// Events of a batch; 8 MB, as many as the caches of a small computer do not hold.
pub(crate) const BATCH: usize = 1_000_000;
/// Length of a sweep.
pub(crate) const SWEEP_US: i64 = 4_000_000;

pub(crate) const GEOMETRY: Geometry = Geometry { width: 1280, height: 720 };

/// A batch that takes `length_us`, with `first` as its earliest time; polarity and place as good as random.
pub(crate) fn batch(first: i64, length_us: i64) -> Vec<Event> {
    let mut random: u64 = 0x9E37_79B9_7F4A_7C15;
    (0..BATCH as i64)
        .map(|index| {
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            Event {
                t: CameraMicros(first + index * length_us / BATCH as i64),
                x: (random >> 16) as u16 % GEOMETRY.width,
                y: (random >> 32) as u16 % GEOMETRY.height,
                polarity: Polarity::from_on(random & 1 == 1),
            }
        })
        .collect()
}

/// `events` as they come from a camera.
pub(crate) fn list(events: &[Event]) -> EventList {
    let mut list = EventList::with_capacity(events.len());
    assert_eq!(list.append(events.iter().copied()), 0, "they lie close together");
    list
}

/// The same batch `later_us` later.
pub(crate) fn delay(batch: &mut [Event], later_us: i64) {
    for event in batch {
        event.t.0 += later_us;
    }
}

/// A sweep of [`SWEEP_US`] and `events` events, of which up to `kept` are kept one by one.
pub(crate) fn sweep(events: usize, kept: usize) -> (SweepRecorder, LensTrace<CameraMicros>) {
    let capacity =
        SweepCapacity { longest: Duration::from_secs(5), events: kept, ..SweepCapacity::default() };
    let mut recorder = SweepRecorder::new(GEOMETRY, capacity);
    recorder.start(CameraMicros(0));
    let batches = (events / BATCH) as i64;
    let mut batch = batch(0, SWEEP_US / batches);
    for _ in 0..batches {
        recorder.feed(list(&batch).as_slice());
        delay(&mut batch, SWEEP_US / batches);
    }
    (recorder, trace())
}

/// One count a millisecond, over the whole sweep.
pub(crate) fn trace() -> LensTrace<CameraMicros> {
    let mut trace = LensTrace::with_capacity(4_001);
    for millisecond in 0..=4_000 {
        trace.push_if_later(CameraMicros(millisecond * 1_000), LensPosition(millisecond as f64));
    }
    trace
}
