//! Reads an answer, and how far off it may be, from what a sweep has booked.

use super::apex::{Apex, TOP};
use super::bookings::{Bookings, Filter, TileSet};
use super::measure::{Reading, StructureMeasure};

/// An answer whose significance (see [`Apex::significance`]) is lower may not be believed for its height alone. Sweeps with their
/// pixels shuffled stay below it, most of them below 6.
pub const LEAST_SIGNIFICANCE: f64 = 15.0;
/// It may be believed all the same down to here, if its readings agree with each other better than those of chance do.
pub(super) const LEAST_IF_CONSISTENT: f64 = 10.0;
/// How well that is: their scatter as a part of the peak's width.
pub(super) const CONSISTENT: f64 = 0.06;
/// An answer that is fainter is none, whoever says the same.
pub(crate) const FAINTEST: f64 = 8.0;
/// A tile or another reading needs less, for it is not asked whether it may be believed alone.
const LEAST_TILE_SIGNIFICANCE: f64 = 8.0;
/// Scatter above this part of the peak's width: the readings contradict each other.
const LARGEST_SCATTER: f64 = 0.2;
/// Scatter that no reading shows, as a part of the peak's width.
const UNSEEN_SCATTER: f64 = 0.015;
/// Tiles whose answers lie within this part of the width of each other mean the same depth.
const SAME_DEPTH: f64 = 0.25;
/// A group of tiles this part of the width away from the answer means another depth.
const OTHER_DEPTH: f64 = 0.6;
/// So much of all significant tiles make a depth.
const SHARE_OF_A_DEPTH: f64 = 0.15;
/// And so many.
const TILES_OF_A_DEPTH: usize = 2;

/// What was read, all in bins from the start of the sweep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Found {
    pub(super) apex: Apex,
    pub(super) filter: Filter,
    /// One standard deviation of the apex, the delay of the pixels apart.
    pub(super) scatter: f64,
    pub(super) rival: Option<Apex>,
    pub(super) tiles: [Apex; Bookings::TILES],
}

impl Found {
    /// Whether chance is unlikely to have made it, and its readings agree.
    pub(super) fn is_sound(&self) -> bool {
        self.apex.significance >= LEAST_SIGNIFICANCE && !self.is_unsure()
    }

    pub(super) fn is_unsure(&self) -> bool {
        self.scatter > LARGEST_SCATTER * self.apex.width
    }
}

impl StructureMeasure {
    /// Reads the answer with `filter`, the picture being compared with `reference`.
    pub(super) fn read_all(&mut self, filter: Filter, reference: f64) -> Option<Found> {
        let usual = Reading { filter, reference, top: TOP, tiles: TileSet::ALL };
        let apex = self.read(usual)?;
        let tiles = self.read_tiles(usual);
        let rival_tiles = rival_tiles(&tiles, apex);
        let rival = rival_tiles.and_then(|rival| self.read(Reading { tiles: rival, ..usual }));
        // What belongs to the other depth says nothing about this one.
        let own = Reading { tiles: TileSet::ALL.without(rival_tiles.unwrap_or(TileSet::NONE)), ..usual };
        let apex = if rival.is_some() { self.read(own)? } else { apex };
        let scatter = self.scatter(own, apex, &tiles);
        Some(Found { apex, filter, scatter, rival, tiles })
    }

    fn read_tiles(&mut self, usual: Reading) -> [Apex; Bookings::TILES] {
        let mut tiles = [Apex::default(); Bookings::TILES];
        for (index, tile) in tiles.iter_mut().enumerate() {
            *tile = self.read(Reading { tiles: TileSet::only(index), ..usual }).unwrap_or_default();
        }
        tiles
    }

    /// One standard deviation of `apex`, in bins: how far other readings of the same events lie from it, how much single tiles move it,
    /// and what neither shows.
    fn scatter(&mut self, usual: Reading, apex: Apex, tiles: &[Apex; Bookings::TILES]) -> f64 {
        let other_filter = if usual.filter == Filter::Coarse { Filter::Fine } else { Filter::Coarse };
        let others = [
            Reading { filter: other_filter, ..usual },
            Reading { filter: Filter::Horizontal, ..usual },
            Reading { filter: Filter::Vertical, ..usual },
            Reading { top: 0.7, ..usual },
            // The same as the usual one, unless that compares with the end.
            Reading { reference: usual.reference / 2.0, ..usual },
        ];
        // Near the start the picture there is no reference, not even by half.
        let others = if apex.at < apex.width { others.get(..4) } else { others.get(..) }.unwrap_or_default();
        let (mut squares, mut number) = (0.0, 0.0_f64);
        for &other in others.iter().filter(|&&other| other != usual) {
            // A picture of stripes has no structure along them, and what chance puts there says nothing.
            if let Some(other) =
                self.read(other).filter(|other| other.significance >= LEAST_TILE_SIGNIFICANCE)
            {
                squares += (other.at - apex.at) * (other.at - apex.at);
                number += 1.0;
            }
        }
        let readings = squares / number.max(1.0);
        let unseen = UNSEEN_SCATTER * apex.width;
        libm::sqrt(readings + self.jackknife(usual, tiles) + unseen * unseen)
    }

    /// The variance of the apex, estimated by leaving out one tile after the other; `tiles` is what each says alone.
    fn jackknife(&mut self, usual: Reading, tiles: &[Apex; Bookings::TILES]) -> f64 {
        let (mut sum, mut squares, mut number) = (0.0, 0.0, 0.0);
        for (tile, alone) in tiles.iter().enumerate().filter(|&(tile, _)| usual.tiles.contains(tile)) {
            let tiles = usual.tiles.without(TileSet::only(tile));
            // Where all that there is to see lies in one tile, chance is what is left without it.
            let is_all = |apex: &Apex| {
                alone.significance >= LEAST_SIGNIFICANCE && apex.significance < LEAST_TILE_SIGNIFICANCE
            };
            if let Some(apex) = self.read(Reading { tiles, ..usual }).filter(|apex| !is_all(apex)) {
                sum += apex.at;
                squares += apex.at * apex.at;
                number += 1.0;
            }
        }
        if number < 2.0 {
            0.0
        } else {
            (number - 1.0) * (squares / number - (sum / number) * (sum / number)).max(0.0)
        }
    }
}

/// The largest group of significant tiles that agree with each other and not with `apex`, if it is large enough to be a depth.
fn rival_tiles(tiles: &[Apex; Bookings::TILES], apex: Apex) -> Option<TileSet> {
    let significant = |tile: &Apex| tile.significance >= LEAST_TILE_SIGNIFICANCE;
    let number = tiles.iter().filter(|tile| significant(tile)).count();
    let elsewhere = |tile: &Apex| libm::fabs(tile.at - apex.at) > OTHER_DEPTH * apex.width;
    let mut largest = TileSet::NONE;
    for middle in tiles.iter().filter(|tile| significant(tile) && elsewhere(tile)) {
        let mut group = TileSet::NONE;
        for (index, tile) in tiles.iter().enumerate() {
            let agrees = libm::fabs(tile.at - middle.at) <= SAME_DEPTH / 2.0 * apex.width;
            if agrees && significant(tile) && elsewhere(tile) {
                group = group.with(index);
            }
        }
        if group.len() > largest.len() {
            largest = group;
        }
    }
    let enough =
        largest.len() >= TILES_OF_A_DEPTH && largest.len() as f64 >= SHARE_OF_A_DEPTH * number as f64;
    enough.then_some(largest)
}
