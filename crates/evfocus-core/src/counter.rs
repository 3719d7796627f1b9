//! A ring of partial sums: how many events in any interval, by one subtraction.

use alloc::vec;
use alloc::vec::Vec;
use core::ops::Sub;
use core::time::Duration;

use crate::event_list::{Events, Run};
use crate::units::CameraMicros;

/// Numbers of events, fractional where an interval ends inside of a bin.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct EventCounts {
    /// Brighter.
    pub on: f64,
    /// Darker.
    pub off: f64,
}

impl EventCounts {
    /// Both polarities together.
    pub fn total(self) -> f64 {
        self.on + self.off
    }
}

impl Sub for EventCounts {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self { on: self.on - other.on, off: self.off - other.off }
    }
}

/// Events of both polarities around one bin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct BinTotals {
    /// Since the start, before the bin.
    pub(crate) before: u64,
    /// Since the start, up to the end of the bin.
    pub(crate) until: u64,
    /// The share of the bin that lies before the time asked for.
    pub(crate) inside: f64,
}

/// A question that the counter cannot answer.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum CounterError {
    /// The counter has not been started.
    #[error("no events have been counted yet")]
    Empty,
    /// The interval begins before what the ring still holds.
    #[error("counts before {oldest_us} us have been overwritten; {asked_us:.0} us was asked for")]
    Overwritten {
        /// Time asked for, microseconds.
        asked_us: f64,
        /// Earliest time that can be asked for, microseconds.
        oldest_us: i64,
    },
    /// The interval ends after what has been counted.
    #[error("events are counted up to {newest_us} us only; {asked_us:.0} us was asked for")]
    NotYetCounted {
        /// Time asked for, microseconds.
        asked_us: f64,
        /// Latest time that can be asked for, microseconds.
        newest_us: i64,
    },
    /// The interval ends before it begins, or an end is not a number.
    #[error("an interval from {from_us} to {to_us} us is none")]
    NotAnInterval {
        /// Begin, microseconds.
        from_us: f64,
        /// End, microseconds.
        to_us: f64,
    },
}

/// Running totals of ON and OFF events at the end of each time bin, in a ring.
///
/// One writer; readers borrow it between two batches, so what they see is consistent. Memory is 16 bytes a bin, bounded by the
/// longest sweep and not by the number of events. Counting an event is a comparison and an addition.
#[derive(Debug, Clone)]
pub struct CumulativeCounter {
    bin_us: i64,
    /// Slot `b & mask` holds the totals at the end of bin `b`; bin 0 begins at `origin_us`.
    ring: Vec<[u64; 2]>,
    mask: usize,
    origin_us: i64,
    /// Newest bin, and its first and first-after microsecond.
    newest: i64,
    newest_start_us: i64,
    newest_end_us: i64,
    /// Totals at the end of the newest bin.
    totals: [u64; 2],
    started: bool,
    late: u64,
}

impl CumulativeCounter {
    /// The bin width of DESIGN: fine enough that it moves an answer by less than a lens count.
    pub const DEFAULT_BIN: Duration = Duration::from_micros(20);

    /// A counter of bins `bin` wide (at least 1 us) that can look back over at least `horizon`. Allocates here and never again.
    pub fn new(bin: Duration, horizon: Duration) -> Self {
        let bin_us = i64::try_from(bin.as_micros()).unwrap_or(i64::MAX).max(1);
        let horizon_us = i64::try_from(horizon.as_micros()).unwrap_or(i64::MAX);
        // One bin more for the total before the oldest whole bin, one for the newest, incomplete one.
        let bins = horizon_us.saturating_add(bin_us - 1) / bin_us;
        let bins = usize::try_from(bins).unwrap_or(usize::MAX).saturating_add(2).next_power_of_two();
        Self {
            bin_us,
            ring: vec![[0; 2]; bins],
            mask: bins - 1,
            origin_us: 0,
            newest: 0,
            newest_start_us: 0,
            newest_end_us: 0,
            totals: [0; 2],
            started: false,
            late: 0,
        }
    }

    /// Forgets everything and begins to count at `origin`.
    pub fn start(&mut self, origin: CameraMicros) {
        self.origin_us = origin.0;
        self.newest = 0;
        self.newest_start_us = origin.0;
        self.newest_end_us = origin.0.saturating_add(self.bin_us);
        self.totals = [0; 2];
        self.ring[0] = [0; 2];
        self.started = true;
        self.late = 0;
    }

    /// Counts `events`, whose times must not decrease. An event that is earlier than the newest bin is counted there, so that
    /// totals stay exact, and in [`late`](Self::late). The first event starts a counter that was not started.
    pub fn count(&mut self, events: Events<'_>) {
        let mut rest = events;
        while let Some(first) = rest.first() {
            if !self.started {
                self.start(first.t);
            }
            if first.t.0 >= self.newest_end_us {
                self.advance_to(first.t);
            }
            let run = rest.run_until(CameraMicros(self.newest_start_us), CameraMicros(self.newest_end_us));
            // At the very end of time the bin's end cannot be written down; the event that reached the bin belongs to it all the same.
            let run =
                if run.events == 0 { Run { events: 1, on: first.polarity as u64, late: 0 } } else { run };
            self.totals[0] += run.events as u64 - run.on;
            self.totals[1] += run.on;
            self.late += run.late;
            rest = rest.from(run.events);
        }
        self.close_newest();
    }

    /// Notes that there are no further events before `time`.
    pub fn advance_to(&mut self, time: CameraMicros) {
        if !self.started {
            self.start(time);
        }
        if time.0 < self.newest_end_us {
            return;
        }
        self.close_newest();
        // Mostly it is the next bin, and a division costs as much as counting ten events.
        let bin = if time.0 < self.newest_end_us.saturating_add(self.bin_us) {
            self.newest + 1
        } else {
            time.0.saturating_sub(self.origin_us) / self.bin_us
        };
        // After a silence longer than the ring, every slot holds the same total: each needs to be written only once.
        let first = (self.newest + 1).max(bin.saturating_sub(self.mask as i64));
        for empty in first..=bin {
            let slot = empty as usize & self.mask;
            self.ring[slot] = self.totals;
        }
        self.newest = bin;
        self.newest_start_us = self.origin_us + bin * self.bin_us;
        self.newest_end_us = self.newest_start_us.saturating_add(self.bin_us);
    }

    fn close_newest(&mut self) {
        let slot = self.newest as usize & self.mask;
        self.ring[slot] = self.totals;
    }

    /// Events from `from_us` to `to_us` (camera time, microseconds): a subtraction of two running totals, each interpolated
    /// linearly inside of its bin.
    ///
    /// # Errors
    /// [`CounterError`] if the interval is not wholly within what has been counted and not overwritten.
    pub fn count_between(&self, from_us: f64, to_us: f64) -> Result<EventCounts, CounterError> {
        if from_us.is_nan() || to_us.is_nan() || from_us > to_us {
            return Err(CounterError::NotAnInterval { from_us, to_us });
        }
        Ok(self.total_until(to_us)? - self.total_until(from_us)?)
    }

    /// Totals at the begin and at the end of the bin that holds `time_us`, and the share of the bin before it.
    fn bracket(&self, time_us: f64) -> Result<([u64; 2], [u64; 2], f64), CounterError> {
        if !self.started {
            return Err(CounterError::Empty);
        }
        if time_us.is_nan() {
            return Err(CounterError::NotAnInterval { from_us: time_us, to_us: time_us });
        }
        if time_us > self.newest_end_us as f64 {
            return Err(CounterError::NotYetCounted { asked_us: time_us, newest_us: self.newest_end_us });
        }
        let oldest_us = self.oldest().0;
        if time_us < oldest_us as f64 {
            return Err(CounterError::Overwritten { asked_us: time_us, oldest_us });
        }
        let bins = (time_us - self.origin_us as f64) / self.bin_us as f64;
        let bin = (libm::floor(bins) as i64).min(self.newest);
        let end = self.ring[bin as usize & self.mask];
        // Bin -1 is the empty time before the start; for any other oldest bin the one before it is still in the ring.
        let start = if bin == 0 { [0; 2] } else { self.ring[(bin - 1) as usize & self.mask] };
        Ok((start, end, bins - bin as f64))
    }

    /// Events before `time_us` since the start.
    fn total_until(&self, time_us: f64) -> Result<EventCounts, CounterError> {
        let (start, end, inside) = self.bracket(time_us)?;
        let interpolate = |start: u64, end: u64| start as f64 + inside * (end - start) as f64;
        Ok(EventCounts { off: interpolate(start[0], end[0]), on: interpolate(start[1], end[1]) })
    }

    /// What is known about the bin that holds `time_us`.
    ///
    /// # Errors
    /// [`CounterError`] if the time is not within what has been counted and not overwritten.
    pub(crate) fn bin_at(&self, time_us: f64) -> Result<BinTotals, CounterError> {
        let (start, end, inside) = self.bracket(time_us)?;
        Ok(BinTotals { before: start[0] + start[1], until: end[0] + end[1], inside })
    }

    /// The earliest time that can still be asked for.
    pub fn oldest(&self) -> CameraMicros {
        let bins = self.ring.len() as i64;
        let oldest_bin = if self.newest < bins { 0 } else { self.newest - bins + 2 };
        CameraMicros(self.origin_us + oldest_bin * self.bin_us)
    }

    /// The end of the newest bin: the latest time that can be asked for.
    pub fn newest(&self) -> CameraMicros {
        CameraMicros(self.newest_end_us)
    }

    /// ON and OFF events since the start.
    pub fn totals(&self) -> (u64, u64) {
        (self.totals[1], self.totals[0])
    }

    /// Events that came later than their time allows (see [`count`](Self::count)).
    pub fn late(&self) -> u64 {
        self.late
    }

    /// The width of a bin.
    pub fn bin(&self) -> Duration {
        Duration::from_micros(self.bin_us as u64)
    }
}
