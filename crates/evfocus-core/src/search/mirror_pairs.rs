//! `mirror-pairs`: the middle between the two times that a pixel was equally bright, once on the way into focus and once on the way out.
//!
//! Each pixel keeps its net level, its ON minus its OFF events, and where the lens was when a level was last reached by either. A level
//! reached from the other side closes a pair: its middle is a vote for focus, its distance says how far out it was. The mode
//! of the votes is focus; a straight line through the mode against the distance, drawn on to distance 0, takes the lag of the flanks out.
//! Sharp in still scenes, worth little in moving ones: a cross-check for `structure`.

use alloc::vec;
use alloc::vec::Vec;

use super::structure::{Bookings, LensCursor, Travel, TravelStep};
use super::{Estimate, SearchError, all_events_kept};
use crate::event::{Event, Geometry};
use crate::event_store::EventStore;
use crate::lens_trace::LensTrace;
use crate::sweep::Sweep;
use crate::units::CameraMicros;

/// Levels on either side of the first brightness that are remembered.
const LEVELS: i8 = 6;
const LEVELS_IN_ALL: usize = 2 * LEVELS as usize + 1;
/// A level that was not reached yet.
const NEVER: u16 = u16::MAX;
/// Classes of distance, each a part of the way.
const DISTANCES: usize = 16;
/// Distances beyond this part of the way are left out: pairs of other things than focus.
const LONGEST: f64 = 0.3;
/// Smoothing of the votes, and of the background that is taken off them, bins.
const NARROW: f64 = 3.0;
const WIDE: f64 = 40.0;
/// Votes this near to the mode, bins, belong to it.
const NEAR: f64 = 8.0;
/// Fewer votes in the mode, in a bin times its width, than this prove nothing.
const FEWEST_VOTES: f64 = 5.0;

/// Where a pixel's levels were last reached, by OFF and by ON. In one line of the cache, for a pixel is seldom in it: it is what an
/// event costs here.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
struct Pixel {
    level: i8,
    reached: [[u16; 2]; LEVELS_IN_ALL],
}

impl Pixel {
    const UNTOUCHED: Self = Self { level: 0, reached: [[NEVER; 2]; LEVELS_IN_ALL] };

    /// Takes an event; the two places of the lens of the pair that it closes, if it does.
    fn take(&mut self, is_on: bool, step: TravelStep) -> Option<(u16, u16)> {
        self.level = self.level.saturating_add(if is_on { 1 } else { -1 });
        let place = usize::try_from(i16::from(self.level) + i16::from(LEVELS))
            .ok()
            .filter(|&place| place < LEVELS_IN_ALL)?;
        let reached = self.reached.get_mut(place)?;
        let [off, on] = *reached;
        let before = if is_on { off } else { on };
        *reached = if is_on { [NEVER, step.0] } else { [step.0, NEVER] };
        (before != NEVER).then_some((before, step.0))
    }
}

/// Room for the search; allocated once.
#[derive(Debug, Clone)]
pub(super) struct MirrorPairs {
    geometry: Geometry,
    pixels: Vec<Pixel>,
    /// Votes by distance, then by place.
    votes: Vec<f64>,
    sum: Vec<f64>,
    /// The way of the sweep, where the lens is on it, and the next event of the store to look at.
    progress: Option<(Travel, LensCursor, usize)>,
}

impl MirrorPairs {
    pub(super) fn new(geometry: Geometry) -> Self {
        Self {
            geometry,
            pixels: vec![Pixel::UNTOUCHED; geometry.pixels()],
            votes: vec![0.0; DISTANCES * Bookings::BINS],
            sum: vec![0.0; Bookings::BINS],
            progress: None,
        }
    }

    /// Begins a sweep over the way of `travel`, whose events an emptied store will hold.
    pub(super) fn begin(&mut self, travel: Travel) {
        self.pixels.fill(Pixel::UNTOUCHED);
        self.votes.fill(0.0);
        self.progress = Some((travel, LensCursor::new(travel), 0));
    }

    /// Takes the events of `store` that it has not taken yet, up to the time `until`, for which `trace` tells the lens positions.
    pub(super) fn take(&mut self, store: &EventStore, trace: &LensTrace<CameraMicros>, until: CameraMicros) {
        let Some((travel, mut lens, mut next)) = self.progress else { return };
        for event in store.iter_from(next).take_while(|event| event.t <= until) {
            let step = lens.at(event.t, trace);
            self.vote(&event, step);
            next += 1;
        }
        self.progress = Some((travel, lens, next));
    }

    /// What the sweep that was begun says.
    ///
    /// # Errors
    /// [`SearchError::EventsNotKept`], [`SearchError::NoPairs`].
    pub(super) fn answer(&mut self, sweep: &Sweep<'_>) -> Result<Estimate, SearchError> {
        all_events_kept(sweep)?;
        self.take(sweep.store, sweep.trace, sweep.end);
        let (travel, ..) = self.progress.ok_or(SearchError::NoPairs)?;
        let mode = self.mode().ok_or(SearchError::NoPairs)?;
        let at = self.at_distance_zero(mode);
        Ok(travel.estimate(sweep, at, 2.0 * NEAR, 1))
    }

    fn vote(&mut self, event: &Event, step: TravelStep) {
        let place = usize::from(event.y) * usize::from(self.geometry.width) + usize::from(event.x);
        let pixel = self.pixels.get_mut(place).filter(|_| self.geometry.contains(event.x, event.y));
        let Some((one, other)) = pixel.and_then(|pixel| pixel.take(event.polarity.is_on(), step)) else {
            return;
        };
        let distance = usize::from(other.abs_diff(one));
        let longest = (LONGEST * f64::from(TravelStep::END.0)) as usize;
        let class = distance * DISTANCES / longest;
        let bin = TravelStep(u16::midpoint(one, other)).bin();
        if class < DISTANCES
            && let Some(votes) = self.votes.get_mut(class * Bookings::BINS + bin)
        {
            *votes += 1.0;
        }
    }

    /// The bin with the most votes above their background.
    fn mode(&mut self) -> Option<f64> {
        self.sum.fill(0.0);
        for votes in self.votes.chunks_exact(Bookings::BINS) {
            for (sum, votes) in self.sum.iter_mut().zip(votes) {
                *sum += votes;
            }
        }
        let excess = |middle: usize| {
            let narrow = weighted(&self.sum, middle, NARROW);
            narrow - weighted(&self.sum, middle, WIDE)
        };
        let highest =
            (0..Bookings::BINS).map(|bin| (bin, excess(bin))).max_by(|(_, a), (_, b)| a.total_cmp(b));
        let (bin, height) = highest?;
        (height * NARROW > FEWEST_VOTES).then_some(bin as f64 + 0.5)
    }

    /// The mode among the pairs of each distance, drawn on to distance 0 by a straight line.
    fn at_distance_zero(&self, mode: f64) -> f64 {
        let (mut weights, mut x1, mut x2, mut y, mut xy) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (class, votes) in self.votes.chunks_exact(Bookings::BINS).enumerate() {
            let Some((middle, weight)) = middle_near(votes, mode) else { continue };
            let x = class as f64 + 0.5;
            weights += weight;
            x1 += weight * x;
            x2 += weight * x * x;
            y += weight * middle;
            xy += weight * x * middle;
        }
        let spread = weights * x2 - x1 * x1;
        if weights <= 0.0 || spread <= 1e-6 * weights * weights {
            return mode;
        }
        let slope = (weights * xy - x1 * y) / spread;
        let zero = (y - slope * x1) / weights;
        zero.clamp(mode - NEAR, mode + NEAR)
    }
}

/// The mean of `votes` around bin `middle`, weighted by a Gaussian of `sigma` bins.
fn weighted(votes: &[f64], middle: usize, sigma: f64) -> f64 {
    let reach = (3.0 * sigma) as usize;
    let (mut sum, mut total) = (0.0, 0.0);
    for (bin, votes) in votes.iter().enumerate().take(middle + reach + 1).skip(middle.saturating_sub(reach)) {
        let deviations = (bin as f64 - middle as f64) / sigma;
        let weight = libm::exp(-deviations * deviations / 2.0);
        sum += weight * votes;
        total += weight;
    }
    sum / total
}

/// The mean of the votes near `mode` in excess of their level farther out, and how many these are.
fn middle_near(votes: &[f64], mode: f64) -> Option<(f64, f64)> {
    let near = |bin: usize| libm::fabs(bin as f64 + 0.5 - mode) <= NEAR;
    let around = |bin: usize| !near(bin) && libm::fabs(bin as f64 + 0.5 - mode) <= 2.0 * NEAR;
    let mean = |wanted: &dyn Fn(usize) -> bool| {
        let (mut sum, mut number) = (0.0, 0.0);
        for (_, votes) in votes.iter().enumerate().filter(|(bin, _)| wanted(*bin)) {
            sum += votes;
            number += 1.0;
        }
        if number > 0.0 { sum / number } else { 0.0 }
    };
    let background = mean(&around);
    let (mut weight, mut moment) = (0.0, 0.0);
    for (bin, votes) in votes.iter().enumerate().filter(|(bin, _)| near(*bin)) {
        let excess = votes - background;
        weight += excess;
        moment += excess * (bin as f64 + 0.5);
    }
    (weight > 5.0).then(|| (moment / weight, weight))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_broken_pixel_leaves_the_levels_and_comes_back() {
        let mut pixel = Pixel::UNTOUCHED;
        let step = TravelStep(10);
        let closed =
            |pixel: &mut Pixel, is_on| (0..1000).filter(|_| pixel.take(is_on, step).is_some()).count();
        assert_eq!(closed(&mut pixel, true), 0);
        // The levels that it passed on its way up, and none of those beyond.
        assert_eq!(closed(&mut pixel, false), usize::try_from(LEVELS).unwrap());
        assert_eq!(closed(&mut pixel, true), LEVELS_IN_ALL);
    }
}
