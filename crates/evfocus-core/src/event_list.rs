//! Events in eight bytes each: half of the memory, and as fast to write as the words that they come from.

#![expect(
    clippy::inline_always,
    reason = "what is to use the vector instructions of a decoder must be inlined into it"
)]

use alloc::vec::Vec;
use core::ops::Range;

use crate::event::Event;
use crate::packed_event::{DoesNotFit, PackedEvent, SinceOrigin};
use crate::units::CameraMicros;

/// Room that a list has behind its capacity. Decoders write some events more than there are, and then cut them off.
pub(crate) const SPARE_ROOM: usize = 72;

/// Events in the order of the stream, eight bytes each.
///
/// A list holds events up to 12.7 days before and after its first one, in columns and rows up to [`LARGEST_ADDRESS`](crate::LARGEST_ADDRESS); others are
/// refused, and it is for whoever fills the list to count them.
#[derive(Debug, Clone, Default)]
pub struct EventList {
    /// Time of the first event there was since the list was empty.
    origin: CameraMicros,
    packed: Vec<PackedEvent>,
}

impl EventList {
    /// An empty list with room for `capacity` events.
    pub fn with_capacity(capacity: usize) -> Self {
        Self { origin: CameraMicros(0), packed: Vec::with_capacity(capacity.saturating_add(SPARE_ROOM)) }
    }

    /// A list of `events`.
    ///
    /// # Errors
    /// [`DoesNotFit`] for the first that does not.
    pub fn of(events: impl IntoIterator<Item = Event>) -> Result<Self, DoesNotFit> {
        let mut list = Self::default();
        events.into_iter().try_for_each(|event| list.push(event))?;
        Ok(list)
    }

    /// Events there is room for without allocation.
    pub fn capacity(&self) -> usize {
        self.packed.capacity().saturating_sub(SPARE_ROOM)
    }

    /// How many more events there is room for without allocation.
    pub fn room(&self) -> usize {
        self.capacity().saturating_sub(self.packed.len())
    }

    /// Makes room for `more` events.
    pub fn reserve(&mut self, more: usize) {
        self.packed.reserve(more.saturating_add(SPARE_ROOM));
    }

    /// Empties the list and keeps its memory.
    pub fn clear(&mut self) {
        self.packed.clear();
    }

    /// Keeps the first `length` events.
    pub fn truncate(&mut self, length: usize) {
        self.packed.truncate(length);
    }

    /// Appends an event.
    ///
    /// # Errors
    /// [`DoesNotFit`] if it lies too far away from the first, or is of a pixel that no camera has.
    #[inline]
    pub fn push(&mut self, event: Event) -> Result<(), DoesNotFit> {
        if self.packed.is_empty() {
            self.origin = event.t;
        }
        self.packed.push(PackedEvent::of(&event, self.origin)?);
        Ok(())
    }

    /// Appends `events` and returns how many of them did not fit.
    pub fn append(&mut self, events: impl IntoIterator<Item = Event>) -> u64 {
        events.into_iter().map(|event| u64::from(self.push(event).is_err())).sum()
    }

    /// Takes the first `count` events out.
    pub fn drain_front(&mut self, count: usize) -> impl ExactSizeIterator<Item = Event> + '_ {
        let origin = self.origin;
        self.packed.drain(..count.min(self.packed.len())).map(move |packed| packed.unpack(origin))
    }

    /// `time` of the next event, counted from this list's origin, which it will be if there is no event; `None` if it does not fit.
    #[inline]
    pub(crate) fn since_origin(&mut self, time: CameraMicros) -> Option<SinceOrigin> {
        if self.packed.is_empty() {
            self.origin = time;
        }
        SinceOrigin::of(time, self.origin)
    }

    /// As [`since_origin`](Self::since_origin), with the coarse time that is added to the fine ones of events to come, which are
    /// shorter than `period_us`.
    #[inline]
    pub(crate) fn since_origin_and_coarse(
        &mut self,
        time: CameraMicros,
        coarse_us: i64,
        period_us: i64,
    ) -> Option<(SinceOrigin, SinceOrigin)> {
        let since = self.since_origin(time)?;
        let coarse = SinceOrigin::of(CameraMicros(coarse_us), self.origin)?;
        SinceOrigin::of(CameraMicros(coarse_us.saturating_add(period_us)), self.origin)?;
        Some((since, coarse))
    }

    /// The time, microseconds, of an event that is to be in this list.
    #[inline]
    pub(crate) fn time_of(&self, event: PackedEvent) -> CameraMicros {
        event.unpack(self.origin).t
    }

    /// `N` places at the end, at most [`SPARE_ROOM`], to be written and then cut with [`truncate`](Self::truncate) to those that count.
    #[inline(always)]
    pub(crate) fn places<const N: usize>(&mut self) -> Option<&mut [PackedEvent; N]> {
        let length = self.packed.len();
        self.packed.resize(length + N, PackedEvent::default());
        self.packed.get_mut(length..)?.first_chunk_mut()
    }

    /// Appends the first `count` of `events`, of which there are at most [`SPARE_ROOM`].
    #[inline(always)]
    pub(crate) fn append_packed<const N: usize>(&mut self, events: [PackedEvent; N], count: usize) {
        let length = self.packed.len();
        self.packed.extend_from_slice(&events);
        self.packed.truncate(length + count);
    }

    /// All of them.
    #[inline]
    pub fn as_slice(&self) -> Events<'_> {
        Events { origin: self.origin, packed: &self.packed }
    }

    /// Number of events.
    pub fn len(&self) -> usize {
        self.packed.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.packed.is_empty()
    }

    /// The first event.
    pub fn first(&self) -> Option<Event> {
        self.as_slice().first()
    }

    /// The last event.
    pub fn last(&self) -> Option<Event> {
        self.as_slice().last()
    }

    /// The events in their order.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = Event> + ExactSizeIterator + Clone + '_ {
        self.as_slice().iter()
    }

    /// The events, unpacked.
    pub fn to_vec(&self) -> Vec<Event> {
        self.iter().collect()
    }
}

/// A piece of an [`EventList`], as a slice is one of a vector.
#[derive(Debug, Clone, Copy)]
pub struct Events<'a> {
    origin: CameraMicros,
    packed: &'a [PackedEvent],
}

impl<'a> Events<'a> {
    /// Number of events.
    #[inline]
    pub fn len(self) -> usize {
        self.packed.len()
    }

    /// Whether there are none.
    #[inline]
    pub fn is_empty(self) -> bool {
        self.packed.is_empty()
    }

    /// The event at `index`.
    #[inline]
    pub fn at(self, index: usize) -> Option<Event> {
        self.packed.get(index).map(|packed| packed.unpack(self.origin))
    }

    /// The first event.
    #[inline]
    pub fn first(self) -> Option<Event> {
        self.at(0)
    }

    /// The last event.
    #[inline]
    pub fn last(self) -> Option<Event> {
        self.packed.last().map(|packed| packed.unpack(self.origin))
    }

    /// The events of `range`, as far as there are any.
    #[inline]
    #[must_use]
    pub fn range(self, range: Range<usize>) -> Self {
        let end = range.end.min(self.packed.len());
        let packed = self.packed.get(range.start..end).unwrap_or_default();
        Self { packed, ..self }
    }

    /// The events from `index` on.
    #[inline]
    #[must_use]
    pub fn from(self, index: usize) -> Self {
        Self { packed: self.packed.get(index..).unwrap_or_default(), ..self }
    }

    /// The events in their order.
    #[inline]
    pub fn iter(self) -> impl DoubleEndedIterator<Item = Event> + ExactSizeIterator + Clone + 'a {
        self.packed.iter().map(move |packed| packed.unpack(self.origin))
    }

    /// The pieces between the events for which `is_between` holds, which are in none of them.
    pub fn split(self, is_between: impl Fn(&Event) -> bool + 'a) -> impl Iterator<Item = Self> + 'a {
        let pieces = self.packed.split(move |packed| is_between(&packed.unpack(self.origin)));
        pieces.map(move |packed| Self { packed, ..self })
    }

    /// Index of the first event at or after `time`, if times do not decrease; [`len`](Self::len) if there is none.
    #[inline]
    pub fn first_at_or_after(self, time: CameraMicros) -> usize {
        let since = time.0.saturating_sub(self.origin.0);
        self.packed.partition_point(|packed| packed.since_us() < since)
    }

    /// As [`first_at_or_after`](Self::first_at_or_after) for a time with a fraction.
    #[inline]
    pub(crate) fn first_at_or_after_micros(self, micros: f64) -> usize {
        let since = micros - self.origin.0 as f64;
        self.packed.partition_point(|packed| (packed.since_us() as f64) < since)
    }

    /// The events at the front that are before `end`. Those before `start` are late.
    #[inline]
    pub(crate) fn run_until(self, start: CameraMicros, end: CameraMicros) -> Run {
        let start_us = start.0.saturating_sub(self.origin.0);
        let end_us = end.0.saturating_sub(self.origin.0);
        let mut run = Run::default();
        // Eight at a time without a branch among them: polarities are as good as random, and guessing them wrong would cost more
        // than everything else.
        for eight in self.packed.as_chunks::<8>().0 {
            let (mut beyond, mut on, mut late) = (false, 0, 0);
            for event in eight {
                beyond |= event.since_us() >= end_us;
                on += u64::from(event.is_on());
                late += u64::from(event.since_us() < start_us);
            }
            if beyond {
                break;
            }
            run = Run { events: run.events + 8, on: run.on + on, late: run.late + late };
        }
        for event in self.packed.get(run.events..).unwrap_or_default() {
            if event.since_us() >= end_us {
                break;
            }
            run.events += 1;
            run.on += u64::from(event.is_on());
            run.late += u64::from(event.since_us() < start_us);
        }
        run
    }
}

/// Events at the front of others.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Run {
    pub(crate) events: usize,
    /// How many of them are brighter.
    pub(crate) on: u64,
    /// How many of them come before their time.
    pub(crate) late: u64,
}

impl PartialEq for Events<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.iter().eq(other.iter())
    }
}

impl PartialEq for EventList {
    fn eq(&self, other: &Self) -> bool {
        self.as_slice() == other.as_slice()
    }
}

impl<T: AsRef<[Event]>> PartialEq<T> for EventList {
    fn eq(&self, other: &T) -> bool {
        self.iter().eq(other.as_ref().iter().copied())
    }
}
