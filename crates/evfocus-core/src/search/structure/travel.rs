//! The lens's way through a sweep, cut into steps.

use super::{StructureKernel, TravelStep};
use crate::event::Event;
use crate::search::SearchError;
use crate::sweep::Sweep;
use crate::units::{CameraMicros, LensPosition};

/// Bins that the lens must have moved to have left, and may be short of the end to have arrived. What happens while it rests belongs
/// to no position: shake alone would fill the first bin, and the picture that all is referred to would be a smeared one.
const REST: f64 = 0.5;

/// From where to where the lens goes, either way.
#[derive(Debug, Clone, Copy)]
pub(super) struct Travel {
    from: f64,
    /// Signed lens counts.
    length: f64,
}

impl Travel {
    /// Bins from start to end.
    const BINS: f64 = (StructureKernel::BINS - 1) as f64;

    pub(super) fn of(sweep: &Sweep<'_>) -> Result<Self, SearchError> {
        let from = sweep.position_at(sweep.start.0 as f64)?;
        let length = sweep.position_at(sweep.end.0 as f64)?.counts_from(from);
        // Written so that a NaN is refused too.
        if libm::fabs(length) > 0.0 {
            Ok(Self { from: from.0, length })
        } else {
            Err(SearchError::NoTravel { at: from })
        }
    }

    /// The position `bins` from the start; its ends are held.
    pub(super) fn position_of(&self, bins: f64) -> LensPosition {
        LensPosition(self.from + (bins / Self::BINS).clamp(0.0, 1.0) * self.length)
    }

    /// When the lens first was there.
    pub(super) fn time_of(&self, sweep: &Sweep<'_>, bins: f64) -> f64 {
        let (start, end) = (sweep.start.0 as f64, sweep.end.0 as f64);
        let mut times = sweep.trace.crossings(self.position_of(bins));
        let held = if bins <= 0.0 { start } else { end };
        times.find(|time| (start..=end).contains(time)).unwrap_or(held)
    }

    /// The events from when the lens left the start until it came to the end, and where it was.
    pub(super) fn events<'a>(&self, sweep: &'a Sweep<'a>) -> impl Iterator<Item = (Event, TravelStep)> + 'a {
        let left = sweep.store.first_at_or_after(self.time_of(sweep, REST));
        let arrived = sweep.store.first_at_or_after(self.time_of(sweep, Self::BINS - REST));
        let mut lens = LensCursor::new(*self, sweep.trace.samples());
        let events = sweep.store.iter().skip(left).take(arrived.saturating_sub(left));
        events.map(move |event| (event, lens.at(event.t)))
    }

    /// `position` in steps from the start, neither rounded nor held.
    fn steps_to(&self, position: LensPosition) -> f64 {
        (position.0 - self.from) / self.length * f64::from(TravelStep::END.0)
    }
}

/// Goes along the samples of a lens trace once, as time goes on: searching anew for each event would cost more than all the rest.
struct LensCursor<I> {
    travel: Travel,
    samples: I,
    /// Time and steps of the samples on either side.
    before: (i64, f64),
    after: (i64, f64),
    /// Steps a microsecond between them.
    slope: f64,
}

impl<I: Iterator<Item = (CameraMicros, LensPosition)>> LensCursor<I> {
    fn new(travel: Travel, samples: I) -> Self {
        let first = (i64::MIN, 0.0);
        Self { travel, samples, before: first, after: first, slope: 0.0 }
    }

    /// Where the lens is at `time`, which must not be earlier than the time before by more than jitter.
    fn at(&mut self, time: CameraMicros) -> TravelStep {
        while time.0 > self.after.0 {
            let next = self.samples.next().map(|(time, position)| (time.0, self.travel.steps_to(position)));
            self.before = self.after;
            // Beyond the last sample the lens stays where it was.
            self.after = next.unwrap_or((i64::MAX, self.before.1));
            self.slope = if self.before.0 == i64::MIN {
                0.0
            } else {
                (self.after.1 - self.before.1) / (self.after.0 - self.before.0) as f64
            };
        }
        let steps = self.after.1 - (self.after.0 - time.0) as f64 * self.slope;
        TravelStep(steps.clamp(0.0, f64::from(TravelStep::END.0)) as u16)
    }
}
