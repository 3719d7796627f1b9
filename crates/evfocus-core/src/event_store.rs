//! The events of the sweep under way, packed, in a bounded buffer.

use core::ops::Range;

use crate::event::Event;
use crate::event_list::{EventList, Events};

/// Events in an [`EventList`] whose room is allocated once. What does not fit is counted, and whoever needs every event can ask
/// [`is_complete`](Self::is_complete).
#[derive(Debug, Clone)]
pub struct EventStore {
    kept: EventList,
    capacity: usize,
    not_kept: u64,
}

impl EventStore {
    /// Room for `capacity` events, 8 bytes each.
    pub fn with_capacity(capacity: usize) -> Self {
        Self { kept: EventList::with_capacity(capacity), capacity, not_kept: 0 }
    }

    /// Empties the store.
    pub fn start(&mut self) {
        self.kept.clear();
        self.not_kept = 0;
    }

    /// Keeps `events`, and counts those that there is no room for.
    pub fn append(&mut self, events: Events<'_>) {
        let fits = events.range(0..self.capacity - self.kept.len());
        self.not_kept += self.kept.append(fits.iter()) + (events.len() - fits.len()) as u64;
    }

    /// The event at `index`, in the order of arrival.
    pub fn get(&self, index: usize) -> Option<Event> {
        self.kept.as_slice().at(index)
    }

    /// All events in the order of arrival.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = Event> + ExactSizeIterator + '_ {
        self.kept.iter()
    }

    /// The events from `index` on, found at once: to skip what was seen before would take as long as to read it.
    pub fn iter_from(&self, index: usize) -> impl DoubleEndedIterator<Item = Event> + ExactSizeIterator + '_ {
        self.kept.as_slice().from(index).iter()
    }

    /// Index of the first event at or after `micros`, if times do not decrease.
    pub fn first_at_or_after(&self, micros: f64) -> usize {
        self.first_at_or_after_within(0..u64::MAX, micros)
    }

    /// Index of the first event at or after `micros` among the events `indices`; its end if there is none.
    pub fn first_at_or_after_within(&self, indices: Range<u64>, micros: f64) -> usize {
        let end = usize::try_from(indices.end).unwrap_or(usize::MAX).min(self.kept.len());
        let start = usize::try_from(indices.start).unwrap_or(usize::MAX).min(end);
        start + self.kept.as_slice().range(start..end).first_at_or_after_micros(micros)
    }

    /// Events kept.
    pub fn len(&self) -> usize {
        self.kept.len()
    }

    /// Whether nothing is kept.
    pub fn is_empty(&self) -> bool {
        self.kept.is_empty()
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
