//! The lens's way through a sweep, cut into steps.

use super::bookings::Bookings;
use super::kernel::TravelStep;
use crate::lens_trace::LensTrace;
use crate::search::{Estimate, SearchError};
use crate::sweep::Sweep;
use crate::units::{CameraMicros, LensPosition};

/// From where to where the lens is to go, either way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Travel {
    from: f64,
    /// Signed lens counts.
    length: f64,
}

impl Travel {
    /// Bins from start to end.
    const BINS: f64 = (Bookings::BINS - 1) as f64;

    /// The way from one position to another.
    ///
    /// # Errors
    /// [`SearchError::NoTravel`] if they are the same.
    pub fn new(from: LensPosition, to: LensPosition) -> Result<Self, SearchError> {
        let length = to.counts_from(from);
        // Written so that a NaN is refused too.
        if libm::fabs(length) > 0.0 {
            Ok(Self { from: from.0, length })
        } else {
            Err(SearchError::NoTravel { at: from })
        }
    }

    /// The way from where the lens was at the start of `sweep` to where it was at the end.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn of(sweep: &Sweep<'_>) -> Result<Self, SearchError> {
        Self::new(sweep.position_at(sweep.start.0 as f64)?, sweep.position_at(sweep.end.0 as f64)?)
    }

    /// When the lens first was `bins` from the start in `sweep`, camera time in microseconds.
    pub fn time_of(&self, sweep: &Sweep<'_>, bins: f64) -> f64 {
        let (start, end) = (sweep.start.0 as f64, sweep.end.0 as f64);
        let mut times = sweep.trace.crossings(self.position_of(bins));
        let held = if bins <= 0.0 { start } else { end };
        times.find(|time| (start..=end).contains(time)).unwrap_or(held)
    }

    /// How fast the lens went within `around` bins of the place `bins` from the start: counts per second, signed.
    pub fn velocity(&self, sweep: &Sweep<'_>, bins: f64, around: f64) -> f64 {
        let (from, to) = ((bins - around).max(0.0), (bins + around).min(Self::BINS));
        let seconds = (self.time_of(sweep, to) - self.time_of(sweep, from)) * 1e-6;
        if seconds > 0.0 { (to - from) * self.counts_per_bin() / seconds } else { 0.0 }
    }

    /// The answer that focus is `bins` from the start, at the top of a peak `width` bins wide, after `iterations` passes.
    pub fn estimate(&self, sweep: &Sweep<'_>, bins: f64, width: f64, iterations: u32) -> Estimate {
        let interval_us = self.time_of(sweep, bins + width / 2.0) - self.time_of(sweep, bins - width / 2.0);
        Estimate {
            position: self.position_of(bins),
            t_us: self.time_of(sweep, bins),
            iterations,
            interval_us,
        }
    }

    /// Lens counts in a bin, signed.
    pub fn counts_per_bin(&self) -> f64 {
        self.length / Self::BINS
    }

    /// The position `bins` from the start; its ends are held.
    pub fn position_of(&self, bins: f64) -> LensPosition {
        LensPosition(self.from + bins.clamp(0.0, Self::BINS) * self.counts_per_bin())
    }

    /// `position` in bins from the start, not held.
    pub fn bins_to(&self, position: LensPosition) -> f64 {
        (position.0 - self.from) / self.counts_per_bin()
    }

    fn steps_to(&self, position: LensPosition) -> f64 {
        self.bins_to(position) * f64::from(TravelStep::PER_BIN)
    }
}

/// Goes along a lens trace as time goes on: searching anew for each event would cost more than all the rest.
#[derive(Debug, Clone, Copy)]
pub(in crate::search) struct LensCursor {
    travel: Travel,
    /// Times and steps of the samples on either side.
    before: (i64, f64),
    after: (i64, f64),
    /// Steps a microsecond between them.
    slope: f64,
}

impl LensCursor {
    /// At no time yet.
    pub(in crate::search) fn new(travel: Travel) -> Self {
        // A stretch that no time lies in: the first question looks for the samples around it.
        let nowhere = (i64::MAX, 0.0);
        Self { travel, before: nowhere, after: nowhere, slope: 0.0 }
    }

    /// Where the lens is at `time`; beyond the ends of the trace it stays where it was.
    #[inline]
    pub(in crate::search) fn at(
        &mut self,
        time: CameraMicros,
        trace: &LensTrace<CameraMicros>,
    ) -> TravelStep {
        if time.0 < self.before.0 || time.0 > self.after.0 {
            self.look_up(time, trace);
        }
        let steps = self.after.1 - (self.after.0 - time.0) as f64 * self.slope;
        TravelStep(steps.clamp(0.0, f64::from(TravelStep::END.0)) as u16)
    }

    fn look_up(&mut self, time: CameraMicros, trace: &LensTrace<CameraMicros>) {
        let [before, after] = trace.around(time);
        let end = |sample: Option<(CameraMicros, LensPosition)>| {
            sample.map(|(time, position)| (time.0, self.travel.steps_to(position)))
        };
        let (before, after) = (end(before), end(after));
        self.slope = match (before, after) {
            (Some(before), Some(after)) => (after.1 - before.1) / (after.0 - before.0) as f64,
            _ => 0.0,
        };
        let held = before.or(after).map_or(0.0, |(_, steps)| steps);
        self.before = before.unwrap_or((i64::MIN, held));
        self.after = after.unwrap_or((i64::MAX, held));
    }
}
