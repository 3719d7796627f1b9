//! Energy of the fine structure of the picture that the events add up to: the focus measure that does not mind how fast things move.
//!
//! The event rate depends on the speed of the scene, the sum of the events does not: shifting a picture leaves the energy of its
//! fine structure as it is, blurring it lowers it. So the lens position at which that energy was highest is focus, in still scenes
//! and in shaken ones. Every number here was settled on simulated sweeps of two public pixel models.
//!
//! What this is not: it says nothing of how far off it may be. The photoreceptor's delay stays in (about 6 ms in light, 15 to 50 ms in
//! the dark, times the speed of the lens); sweeping both ways cancels it.

mod apex;
mod kernel;
mod travel;

use super::{Estimate, SearchError, all_events_kept};
use crate::event::Geometry;
use crate::sweep::Sweep;

pub use apex::{Apex, ApexFinder};
pub use kernel::{StructureKernel, TravelStep};

use travel::Travel;

/// An answer whose significance (see [`Apex::significance`]) is lower is none. Sweeps with their pixels shuffled stay below it.
pub const LEAST_SIGNIFICANCE: f64 = 15.0;

/// Room for the search; allocated once.
#[derive(Debug, Clone)]
pub(super) struct StructureSearch {
    kernel: StructureKernel,
    finder: ApexFinder,
}

impl StructureSearch {
    pub(super) fn new(geometry: Geometry) -> Self {
        Self { kernel: StructureKernel::new(geometry), finder: ApexFinder::new() }
    }

    /// `structure`: where along the sweep the energy was highest. Reads every event once, and once more if focus is near the
    /// start, where the picture at the start is the wrong one to refer to.
    pub(super) fn search(&mut self, sweep: &Sweep<'_>) -> Result<Estimate, SearchError> {
        all_events_kept(sweep)?;
        let travel = Travel::of(sweep)?;
        self.kernel.begin();
        for (event, step) in travel.events(sweep) {
            self.kernel.take(&event, step);
        }
        let mut apex = self.finder.find(self.kernel.growth());
        let mut passes = 1;
        if apex.at < apex.width {
            self.kernel.begin_again();
            for (event, step) in travel.events(sweep) {
                self.kernel.take_again(&event, step);
            }
            apex = self.finder.find(self.kernel.growth());
            passes = 2;
        }
        if apex.significance < LEAST_SIGNIFICANCE {
            return Err(SearchError::Weak { significance: apex.significance });
        }
        let half_width = apex.width / 2.0;
        let width_us =
            travel.time_of(sweep, apex.at + half_width) - travel.time_of(sweep, apex.at - half_width);
        Ok(Estimate {
            position: travel.position_of(apex.at),
            t_us: travel.time_of(sweep, apex.at),
            iterations: passes,
            interval_us: width_us,
        })
    }
}
