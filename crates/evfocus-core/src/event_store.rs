//! The events of the sweep under way, packed, in a bounded buffer.

use alloc::vec::Vec;
use core::ops::Range;

use crate::event::{Event, Polarity};
use crate::units::CameraMicros;

const X_BITS: u32 = 14;
const Y_BITS: u32 = 14;
const TIME_SHIFT: u32 = X_BITS + Y_BITS + 1;
const LONGEST_US: i64 = (1 << (64 - TIME_SHIFT)) - 1;

/// Events in 8 bytes each: 35 bits of time since the start (9.5 hours), 14 bits each of x and y, one of polarity.
///
/// The room is allocated once. What does not fit is counted, and whoever needs every event can ask
/// [`is_complete`](Self::is_complete).
#[derive(Debug, Clone)]
pub struct EventStore {
    packed: Vec<u64>,
    capacity: usize,
    origin: CameraMicros,
    not_kept: u64,
}

impl EventStore {
    /// Room for `capacity` events, 8 bytes each.
    pub fn with_capacity(capacity: usize) -> Self {
        Self { packed: Vec::with_capacity(capacity), capacity, origin: CameraMicros(0), not_kept: 0 }
    }

    /// Empties the store; times are kept relative to `origin`.
    pub fn start(&mut self, origin: CameraMicros) {
        self.packed.clear();
        self.origin = origin;
        self.not_kept = 0;
    }

    /// Keeps `event`, or counts it as not kept if the store is full or the event does not fit the format.
    pub fn push(&mut self, event: &Event) {
        let since = event.t.micros_since(self.origin);
        let fits = (0..=LONGEST_US).contains(&since) && event.x < (1 << X_BITS) && event.y < (1 << Y_BITS);
        if self.packed.len() == self.capacity || !fits {
            self.not_kept += 1;
            return;
        }
        let place = u64::from(event.y) << X_BITS | u64::from(event.x);
        self.packed.push((since as u64) << TIME_SHIFT | place << 1 | event.polarity as u64);
    }

    /// The event at `index`, in the order of arrival.
    pub fn get(&self, index: usize) -> Option<Event> {
        self.packed.get(index).map(|&packed| self.unpack(packed))
    }

    /// All events in the order of arrival.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = Event> + ExactSizeIterator + '_ {
        self.iter_from(0)
    }

    /// The events from `index` on, found at once: to skip what was seen before would take as long as to read it.
    pub fn iter_from(&self, index: usize) -> impl DoubleEndedIterator<Item = Event> + ExactSizeIterator + '_ {
        self.packed.get(index..).unwrap_or_default().iter().map(|&packed| self.unpack(packed))
    }

    /// Index of the first event at or after `micros`, if times do not decrease.
    pub fn first_at_or_after(&self, micros: f64) -> usize {
        self.first_at_or_after_within(0..u64::MAX, micros)
    }

    /// Index of the first event at or after `micros` among the events `indices`; its end if there is none.
    pub fn first_at_or_after_within(&self, indices: Range<u64>, micros: f64) -> usize {
        let since = micros - self.origin.0 as f64;
        let end = usize::try_from(indices.end).unwrap_or(usize::MAX).min(self.packed.len());
        let start = usize::try_from(indices.start).unwrap_or(usize::MAX).min(end);
        let within = self.packed.get(start..end).unwrap_or_default();
        start + within.partition_point(|&packed| ((packed >> TIME_SHIFT) as f64) < since)
    }

    fn unpack(&self, packed: u64) -> Event {
        let mask = |bits: u32| (1_u64 << bits) - 1;
        Event {
            t: CameraMicros(self.origin.0 + (packed >> TIME_SHIFT) as i64),
            x: (packed >> 1 & mask(X_BITS)) as u16,
            y: (packed >> (1 + X_BITS) & mask(Y_BITS)) as u16,
            polarity: Polarity::from_on(packed & 1 == 1),
        }
    }

    /// Events kept.
    pub fn len(&self) -> usize {
        self.packed.len()
    }

    /// Whether nothing is kept.
    pub fn is_empty(&self) -> bool {
        self.packed.is_empty()
    }

    /// Events that did not fit.
    pub fn not_kept(&self) -> u64 {
        self.not_kept
    }

    /// Whether every event since the start has been kept.
    pub fn is_complete(&self) -> bool {
        self.not_kept == 0
    }
}
