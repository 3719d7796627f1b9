//! What a sweep leaves behind, and the recorder that gathers it: the same for a live run and for a recording.

use core::time::Duration;

use crate::counter::{CounterError, CumulativeCounter};
use crate::event::Geometry;
use crate::event_list::Events;
use crate::event_store::EventStore;
use crate::lens_trace::{LensTrace, LensTraceError};
use crate::units::{CameraMicros, LensPosition};

/// How much a sweep may hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SweepCapacity {
    /// Width of the counter's bins.
    pub bin: Duration,
    /// The longest sweep.
    pub longest: Duration,
    /// Events kept for the measures that need pixels or exact times, 8 bytes each; further ones are counted only.
    pub events: usize,
}

impl Default for SweepCapacity {
    fn default() -> Self {
        Self { bin: CumulativeCounter::DEFAULT_BIN, longest: Duration::from_secs(20), events: 16_000_000 }
    }
}

/// How long the lens is taken to stay where a trace begins and ends: a log of positions starts late and ends early by a sample or
/// a few, and the lens rests there.
pub const HOLD: Duration = Duration::from_millis(50);

/// Gathers the events of one sweep.
#[derive(Debug, Clone)]
pub struct SweepRecorder {
    geometry: Geometry,
    counter: CumulativeCounter,
    store: EventStore,
    span: Option<(CameraMicros, CameraMicros)>,
}

impl SweepRecorder {
    /// A recorder for sensors of `geometry`. All memory is allocated here.
    pub fn new(geometry: Geometry, capacity: SweepCapacity) -> Self {
        Self {
            geometry,
            counter: CumulativeCounter::new(capacity.bin, capacity.longest),
            store: EventStore::with_capacity(capacity.events),
            span: None,
        }
    }

    /// Begins a new sweep at `origin`.
    pub fn start(&mut self, origin: CameraMicros) {
        self.counter.start(origin);
        self.store.start();
        self.span = None;
    }

    /// Takes the events of a batch, in the order of their times.
    pub fn feed(&mut self, events: Events<'_>) {
        let (Some(first), Some(last)) = (events.first(), events.last()) else { return };
        self.span = Some((self.span.map_or(first.t, |(start, _)| start), last.t));
        self.counter.count(events);
        self.store.append(events);
    }

    /// Notes that there are no further events before `time`.
    pub fn advance_to(&mut self, time: CameraMicros) {
        self.counter.advance_to(time);
    }

    /// The sensor's size.
    pub fn geometry(&self) -> Geometry {
        self.geometry
    }

    /// The running totals.
    pub fn counter(&self) -> &CumulativeCounter {
        &self.counter
    }

    /// The events kept.
    pub fn store(&self) -> &EventStore {
        &self.store
    }

    /// First and last event fed since the start.
    pub fn span(&self) -> Option<(CameraMicros, CameraMicros)> {
        self.span
    }

    /// The sweep as it stands: its events with the lens positions of `trace`, from the first event to the last one, as far as
    /// the trace reaches; its ends are held for [`HOLD`]. `None` before the first event, and if the trace lies elsewhere.
    pub fn sweep<'a>(&'a self, trace: &'a LensTrace<CameraMicros>) -> Option<Sweep<'a>> {
        let ((first, last), (trace_first, trace_last)) = (self.span?, (trace.first()?.0, trace.last()?.0));
        let (start, end) = (first.max(trace_first - HOLD), last.min(trace_last + HOLD));
        if start > end {
            return None;
        }
        Some(Sweep { geometry: self.geometry, start, end, counter: &self.counter, store: &self.store, trace })
    }
}

/// One sweep: what happened, and where the lens was meanwhile.
#[derive(Debug, Clone, Copy)]
pub struct Sweep<'a> {
    /// The sensor's size.
    pub geometry: Geometry,
    /// Time of the first event; the range that the searches start from.
    pub start: CameraMicros,
    /// Time of the last event.
    pub end: CameraMicros,
    /// Running totals over at least `start` to `end`.
    pub counter: &'a CumulativeCounter,
    /// The events, as far as there was room.
    pub store: &'a EventStore,
    /// Lens positions in camera time.
    pub trace: &'a LensTrace<CameraMicros>,
}

impl Sweep<'_> {
    /// Length of the range in microseconds.
    pub fn length_us(&self) -> f64 {
        self.end.micros_since(self.start) as f64
    }

    /// The lens position at `micros` of camera time, held at the ends of the trace.
    ///
    /// # Errors
    /// [`LensTraceError::Empty`] for a trace without samples.
    pub fn position_at(&self, micros: f64) -> Result<LensPosition, LensTraceError> {
        self.trace.position_near(micros).ok_or(LensTraceError::Empty)
    }

    /// Events before `micros` of camera time: exact to the event if all were kept, else interpolated within the counter's bin.
    /// The same effort for any number of events: the counter says between which two events of the store to look.
    ///
    /// # Errors
    /// [`CounterError`] for times that the counter does not cover.
    pub fn events_before(&self, micros: f64) -> Result<f64, CounterError> {
        let bin = self.counter.bin_at(micros)?;
        if self.store.is_complete() {
            Ok(self.store.first_at_or_after_within(bin.before..bin.until, micros) as f64)
        } else {
            Ok(bin.before as f64 + bin.inside * (bin.until - bin.before) as f64)
        }
    }

    /// Events up to and with `micros` of camera time; times are whole microseconds, so these are the events before the next one.
    /// Times beyond the newest bin hold nothing more.
    ///
    /// # Errors
    /// As [`events_before`](Self::events_before).
    pub fn events_until(&self, micros: f64) -> Result<f64, CounterError> {
        self.events_before((libm::floor(micros) + 1.0).min(self.counter.newest().0 as f64))
    }

    /// Events fed since the start of the sweep.
    pub fn events(&self) -> u64 {
        let (on, off) = self.counter.totals();
        on + off
    }
}
