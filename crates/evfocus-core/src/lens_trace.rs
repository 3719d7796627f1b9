//! Where the lens was, and when.

use alloc::collections::VecDeque;
use alloc::vec::Vec;
use core::ops::Range;

use crate::units::{HostMicros, LensPosition, Timestamp};

/// One answer of the lens to "where are you?".
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LensSample {
    /// When the question left the host.
    pub requested: HostMicros,
    /// When the answer arrived.
    pub replied: HostMicros,
    /// The answer.
    pub position: LensPosition,
    /// Whether the lens says that it is moving.
    pub moving: bool,
}

impl LensSample {
    /// The time to which the position is taken to belong: the middle of request and reply, which errs by at most half of
    /// the round trip.
    pub fn time(&self) -> HostMicros {
        HostMicros(i64::midpoint(self.requested.0, self.replied.0))
    }
}

/// Positions of the lens against the time of one clock, oldest first; interpolated linearly between samples, never assumed
/// linear beyond that. Bounded: when full, the oldest sample makes room.
#[derive(Debug, Clone)]
pub struct LensTrace<T> {
    samples: VecDeque<(T, LensPosition)>,
    capacity: usize,
}

/// Why the trace cannot answer.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum LensTraceError {
    /// No samples at all.
    #[error("the lens trace is empty")]
    Empty,
    /// The time asked for lies outside the samples.
    #[error("the lens trace covers {first} to {last} us, not {asked:.0} us")]
    Outside {
        /// Time asked for, microseconds.
        asked: f64,
        /// First sample, microseconds.
        first: i64,
        /// Last sample, microseconds.
        last: i64,
    },
    /// A sample that is not later than the one before.
    #[error("a lens sample at {time} us does not come after the one at {last} us")]
    NotLater {
        /// Time of the refused sample, microseconds.
        time: i64,
        /// Time of the last sample, microseconds.
        last: i64,
    },
}

/// A stretch of the trace in which the lens goes one way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Leg<T> {
    /// First instant: the first sample, or the middle of the rest at the turn before.
    pub start: T,
    /// Last instant: the middle of the rest at the turn, or the last sample.
    pub end: T,
    /// Position at the start of the motion.
    pub from: LensPosition,
    /// Position at its end.
    pub to: LensPosition,
}

impl<T: Timestamp> LensTrace<T> {
    /// A trace that keeps the newest `capacity` samples (at least two) and never allocates again.
    pub fn with_capacity(capacity: usize) -> Self {
        let capacity = capacity.max(2);
        Self { samples: VecDeque::with_capacity(capacity), capacity }
    }

    /// Adds a sample.
    ///
    /// # Errors
    /// [`LensTraceError::NotLater`] if `time` is not after the last sample's; the trace stays as it was.
    pub fn push(&mut self, time: T, position: LensPosition) -> Result<(), LensTraceError> {
        if let Some(&(last, _)) = self.samples.back()
            && time <= last
        {
            return Err(LensTraceError::NotLater { time: time.micros(), last: last.micros() });
        }
        self.append(time, position);
        Ok(())
    }

    fn append(&mut self, time: T, position: LensPosition) {
        if self.samples.len() == self.capacity {
            self.samples.pop_front();
        }
        self.samples.push_back((time, position));
    }

    /// [`push`](Self::push), where a sample that is not later than the last one is no news and is left out.
    pub fn push_if_later(&mut self, time: T, position: LensPosition) {
        if self.last().is_none_or(|(last, _)| time > last) {
            self.append(time, position);
        }
    }

    /// Forgets all samples and keeps the memory.
    pub fn clear(&mut self) {
        self.samples.clear();
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// Whether there are no samples.
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// The oldest sample.
    pub fn first(&self) -> Option<(T, LensPosition)> {
        self.samples.front().copied()
    }

    /// The newest sample.
    pub fn last(&self) -> Option<(T, LensPosition)> {
        self.samples.back().copied()
    }

    /// The last sample at or before `time`, and the first one after it.
    pub fn around(&self, time: T) -> [Option<(T, LensPosition)>; 2] {
        let after = self.samples.partition_point(|&(sampled, _)| sampled <= time);
        let before = after.checked_sub(1).and_then(|index| self.samples.get(index));
        [before.copied(), self.samples.get(after).copied()]
    }

    /// All samples, oldest first.
    pub fn samples(&self) -> impl DoubleEndedIterator<Item = (T, LensPosition)> + '_ {
        self.samples.iter().copied()
    }

    /// The position at `micros` microseconds of the trace's clock, interpolated between the samples on either side.
    ///
    /// # Errors
    /// [`LensTraceError::Empty`], or [`LensTraceError::Outside`] for a time before the first or after the last sample.
    pub fn position_at(&self, micros: f64) -> Result<LensPosition, LensTraceError> {
        let (Some((first, _)), Some((last, _))) = (self.first(), self.last()) else {
            return Err(LensTraceError::Empty);
        };
        // Written so that a NaN is refused too.
        if !(micros >= first.micros() as f64 && micros <= last.micros() as f64) {
            return Err(LensTraceError::Outside {
                asked: micros,
                first: first.micros(),
                last: last.micros(),
            });
        }
        let after = self.samples.partition_point(|(time, _)| (time.micros() as f64) < micros).max(1);
        let (Some(&(t0, p0)), Some(&(t1, p1))) = (self.samples.get(after - 1), self.samples.get(after))
        else {
            // Only one sample, and it is exactly at the time asked for.
            return Ok(self.samples.front().map_or(LensPosition(0.0), |&(_, position)| position));
        };
        let share = (micros - t0.micros() as f64) / (t1.micros() as f64 - t0.micros() as f64);
        Ok(LensPosition(p0.0 + share * (p1.0 - p0.0)))
    }

    /// [`position_at`](Self::position_at), with the first or last position held outside of the trace; `None` when empty.
    pub fn position_near(&self, micros: f64) -> Option<LensPosition> {
        let (first, last) = (self.first()?, self.last()?);
        self.position_at(micros.clamp(first.0.micros() as f64, last.0.micros() as f64)).ok()
    }

    /// The position that was last reported at or before `micros` (held, not interpolated); the first one before the trace.
    pub fn position_held(&self, micros: f64) -> Option<LensPosition> {
        let after = self.samples.partition_point(|(time, _)| (time.micros() as f64) <= micros);
        self.samples.get(after.saturating_sub(1)).map(|&(_, position)| position)
    }

    /// The times, in microseconds, at which the lens passed `position`, oldest first. A lens that rests exactly there
    /// counts once.
    pub fn crossings(&self, position: LensPosition) -> impl Iterator<Item = f64> + '_ {
        let pairs = self.samples.iter().zip(self.samples.iter().skip(1));
        pairs.filter_map(move |(&(t0, p0), &(t1, p1))| {
            let (before, after) = (p0.0 - position.0, p1.0 - position.0);
            let crosses = (before < 0.0 && after >= 0.0) || (before > 0.0 && after <= 0.0);
            crosses.then(|| {
                let share = before / (before - after);
                t0.micros() as f64 + share * (t1.micros() as f64 - t0.micros() as f64)
            })
        })
    }

    /// The lowest and the highest position; `None` when empty.
    pub fn extent(&self) -> Option<(LensPosition, LensPosition)> {
        let mut positions = self.samples.iter().map(|&(_, position)| position.0);
        let first = positions.next()?;
        let (low, high) = positions.fold((first, first), |(low, high), p| (low.min(p), high.max(p)));
        Some((LensPosition(low), LensPosition(high)))
    }

    /// The trace cut where the lens turns round, each turn in the middle of the rest there. A motion back by less than
    /// `tolerance` counts is read-out noise or overshoot, not a turn. Empty if the lens never moved further than that.
    pub fn legs(&self, tolerance: f64) -> Vec<Leg<T>> {
        let (Some((start, first)), Some((end, _))) = (self.first(), self.last()) else {
            return Vec::new();
        };
        let mut legs: Vec<Leg<T>> = Vec::new();
        let mut leg = Leg { start, end, from: first, to: first };
        let mut leg_index = 0;
        let mut direction = 0.0;
        for (index, (_, position)) in self.samples().enumerate() {
            let travelled = position.counts_from(leg.to) * direction;
            if direction == 0.0 {
                if position.distance(leg.from) > tolerance {
                    direction = if position.0 > leg.from.0 { 1.0 } else { -1.0 };
                    leg.to = position;
                }
            } else if travelled > 0.0 {
                leg.to = position;
            } else if travelled < -tolerance {
                let turn = self.middle_of_rest(leg_index..index, leg.to, tolerance / 2.0).unwrap_or(leg.end);
                legs.push(Leg { end: turn, ..leg });
                leg = Leg { start: turn, end, from: leg.to, to: position };
                leg_index = index;
                direction = -direction;
            }
        }
        if direction != 0.0 {
            legs.push(leg);
        }
        legs
    }

    /// The middle between the first and the last time that the lens was within `band` of `place` among the samples `indices`.
    /// Noise decides which sample of a rest is the farthest, so that one alone says nothing about when the rest began.
    fn middle_of_rest(&self, indices: Range<usize>, place: LensPosition, band: f64) -> Option<T> {
        let mut near = self.samples.range(indices).filter(|(_, position)| position.distance(place) <= band);
        let &(reached, _) = near.next()?;
        let left = near.next_back().map_or(reached, |&(time, _)| time);
        Some(T::from_micros(i64::midpoint(reached.micros(), left.micros())))
    }
}
