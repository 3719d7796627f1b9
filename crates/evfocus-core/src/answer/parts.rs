//! What parts of the picture say: the windows of a request, and the tiles of the whole picture.

use super::{Answer, Prefer, Rules, answer, confidence};
use crate::delay::Delay;
use crate::event::Window;
use crate::flags::{Flag, Flags};
use crate::report::{Failure, LegReport};
use crate::search::{Bookings, FAINTEST, LEAST_SIGNIFICANCE, Method, StructureAnswer, TileAnswer};
use crate::units::LensPosition;

/// What each window of the request says of one sweep, or of two in opposite directions, as if it had been the one preferred.
pub fn window_answers<'a>(
    first: &'a LegReport,
    second: Option<&'a LegReport>,
    method: Method,
    rules: &'a Rules,
) -> impl Iterator<Item = (Window, Result<Answer, Failure>)> + 'a {
    first.windows.iter().flatten().zip(0..).map(move |(&(window, _), index)| {
        (window, answer(first, second, method, &Rules { prefer: Prefer::Window(index), ..*rules }))
    })
}

/// Where one tile of the picture is sharp.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TileFocus {
    /// Where, the delay of the pixels taken off.
    pub position: LensPosition,
    /// One standard deviation, counts.
    pub error_bar: f64,
    /// The probability that the position is right to within [`Rules::tolerance`].
    pub confidence: f64,
    /// How high the peaks are in units of what chance makes, added as squares.
    pub significance: f64,
}

/// Where each tile of the picture is sharp, row by row: `None` for one in which no sweep of `legs` made more of a peak than chance.
pub type FocusMap = [Option<TileFocus>; Bookings::TILES];

/// Where each tile of the picture is sharp by all `legs` together; `None` without a sweep in which the picture had a peak. Tiles too
/// faint for an answer of their own are left out: chance puts them anywhere.
pub fn focus_map<'a>(
    legs: impl Iterator<Item = &'a LegReport>,
    measured: Option<Delay>,
    rules: &Rules,
) -> Option<FocusMap> {
    let mut sums = [TileSum::default(); Bookings::TILES];
    let mut has_peak = false;
    let mut uncertainty_s = 0.0;
    for said in legs.filter_map(|leg| leg.structure.and_then(Result::ok)) {
        has_peak = true;
        let delay = measured.unwrap_or_else(|| rules.delays.at(said.noise_hz));
        uncertainty_s = delay.uncertainty_s;
        for (sum, tile) in sums.iter_mut().zip(&said.tiles) {
            if tile.significance >= FAINTEST && tile.error_bar.is_finite() {
                sum.add(tile, &said, delay, rules);
            }
        }
    }
    has_peak.then(|| sums.map(|sum| sum.mean(uncertainty_s, rules)))
}

/// Weighted sums over sweeps, each weighted by the inverse of its variance.
#[derive(Debug, Clone, Copy, Default)]
struct TileSum {
    weight: f64,
    position: f64,
    square: f64,
    velocity: f64,
    power: f64,
}

impl TileSum {
    fn add(&mut self, tile: &TileAnswer, said: &StructureAnswer, delay: Delay, rules: &Rules) {
        let weight = 1.0 / (tile.error_bar * tile.error_bar).max(f64::MIN_POSITIVE);
        // The way down reads so much less than there is.
        let play = if said.velocity < 0.0 { rules.backlash } else { 0.0 };
        let position = tile.position.0 - said.velocity * delay.seconds + play;
        self.weight += weight;
        self.position += weight * position;
        self.square += weight * position * position;
        self.velocity += weight * said.velocity;
        self.power += tile.significance * tile.significance;
    }

    fn mean(self, uncertainty_s: f64, rules: &Rules) -> Option<TileFocus> {
        let Self { weight, power, .. } = self;
        if weight <= 0.0 {
            return None;
        }
        let position = self.position / weight;
        // Sweeps that differ by more than their error bars are no surer than that.
        let spread = (self.square / weight - position * position).max(0.0);
        let late = self.velocity / weight * uncertainty_s;
        let error_bar = libm::sqrt((1.0 / weight).max(spread) + late * late);
        let significance = libm::sqrt(power);
        let mut flags = Flags::default();
        flags.set(Flag::Weak, significance < LEAST_SIGNIFICANCE);
        let confidence = confidence(error_bar, flags, rules.tolerance);
        Some(TileFocus { position: LensPosition(position), error_bar, confidence, significance })
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{leg, rules, structure_answer};
    use super::*;

    /// A sweep whose first tile says `position` and whose other tiles say nothing.
    fn sweep(position: f64, velocity: f64, significance: f64) -> LegReport {
        let mut said = structure_answer(position, 6.0, velocity);
        said.tiles[0] = TileAnswer { position: LensPosition(position), significance, error_bar: 8.0 };
        leg(&said)
    }

    fn first_tile(legs: &[LegReport]) -> Option<TileFocus> {
        focus_map(legs.iter(), None, &rules()).unwrap()[0]
    }

    #[test]
    fn both_ways_the_delay_cancels_and_one_way_it_is_taken_off_and_doubted() {
        let both = first_tile(&[sweep(1030.0, 1000.0, 40.0), sweep(990.0, -1000.0, 40.0)]).unwrap();
        assert!((both.position.0 - 1010.0).abs() < 1e-6, "{both:?}");
        let one = first_tile(&[sweep(1030.0, 1000.0, 40.0)]).unwrap();
        let delay = rules().delays.at(0.0);
        assert!((one.position.0 - (1030.0 - 1000.0 * delay.seconds)).abs() < 1e-6, "{one:?}");
        assert!((one.error_bar - (1000.0 * delay.uncertainty_s).hypot(8.0)).abs() < 1e-6, "{one:?}");
    }

    #[test]
    fn sweeps_that_contradict_each_other_make_it_unsure() {
        let apart = first_tile(&[sweep(1000.0, 1000.0, 40.0), sweep(1400.0, -1000.0, 40.0)]).unwrap();
        assert!(apart.error_bar > 150.0 && apart.confidence < 0.3, "{apart:?}");
    }

    #[test]
    fn what_chance_makes_is_left_out_and_what_is_faint_is_less_sure() {
        assert!(first_tile(&[sweep(1000.0, 1000.0, 5.0)]).is_none());
        let [faint, clear] =
            [10.0, 40.0].map(|significance| first_tile(&[sweep(1000.0, 1000.0, significance)]).unwrap());
        assert!(faint.confidence < clear.confidence, "{faint:?} {clear:?}");
        let nothing = LegReport::empty();
        assert!(focus_map([&nothing].into_iter(), None, &rules()).is_none());
    }
}
