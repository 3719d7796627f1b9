//! What the events added to the energy: by lens position, by part of the picture, by filter.

use alloc::vec;
use alloc::vec::Vec;

use crate::event::Window;

/// (K E)(x), or what an event adds to half the energy: distance 1 minus distance 2 along the row, the same along the column, distance 1
/// minus distance 4 along both; and nothing, which makes it as long as a register.
///
/// The sums of a bin and tile hold 9 million events of the largest possible contribution; they wrap beyond.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Detail(pub(super) [i32; 4]);

impl Detail {
    /// Every bit of it, or none, or its negative: by masks, since polarities and turns come by chance and a branch on them would cost
    /// more than all of this.
    pub(super) fn signed(self, negative: bool) -> Self {
        let mask = -i32::from(negative);
        Self(self.0.map(|value| (value ^ mask).wrapping_sub(mask)))
    }

    pub(super) fn only_if(self, wanted: bool) -> Self {
        let mask = -i32::from(wanted);
        Self(self.0.map(|value| value & mask))
    }

    fn plus(self, other: Self) -> Self {
        let mut sum = self.0;
        for (sum, value) in sum.iter_mut().zip(other.0) {
            *sum = sum.wrapping_add(value);
        }
        Self(sum)
    }

    fn of(self, filter: Filter) -> i64 {
        let [horizontal, vertical, coarse, _] = self.0.map(i64::from);
        match filter {
            Filter::Fine => horizontal + vertical,
            Filter::Horizontal => horizontal,
            Filter::Vertical => vertical,
            Filter::Coarse => coarse,
        }
    }
}

/// Which differences of neighbours are taken for structure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Filter {
    /// Distance 1 minus distance 2.
    Fine,
    /// Its part along the rows.
    Horizontal,
    /// Its part along the columns.
    Vertical,
    /// Distance 1 minus distance 4: two to three times the signal, and blurrier peaks.
    Coarse,
}

/// A part of the tiles of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TileSet(u32);

impl TileSet {
    /// Every tile.
    pub const ALL: Self = Self((1 << Bookings::TILES) - 1);
    /// No tile.
    pub const NONE: Self = Self(0);

    /// One tile only.
    pub fn only(tile: usize) -> Self {
        Self(1 << tile)
    }

    /// These and `tile`.
    #[must_use]
    pub fn with(self, tile: usize) -> Self {
        Self(self.0 | 1 << tile)
    }

    /// These, but not those of `other`.
    #[must_use]
    pub fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// Whether `tile` is one of them.
    pub fn contains(self, tile: usize) -> bool {
        self.0 >> tile & 1 == 1
    }

    /// How many there are.
    pub fn len(self) -> usize {
        self.0.count_ones() as usize
    }

    /// Whether there are none.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }
}

/// Sums by bin of the lens's way, by tile and by filter.
#[derive(Debug, Clone)]
pub struct Bookings {
    /// By bin, then by tile: the events of a moment stay within a few cache lines.
    cells: Vec<Detail>,
}

impl Bookings {
    /// Bins of the lens's way: 350, and the end itself.
    pub const BINS: usize = 351;
    /// Columns of tiles.
    pub const COLUMNS: usize = 6;
    /// Rows of tiles.
    pub const ROWS: usize = 4;
    /// Tiles of a picture.
    pub const TILES: usize = Self::COLUMNS * Self::ROWS;

    /// Nothing booked. All memory is allocated here.
    pub(super) fn new() -> Self {
        Self { cells: vec![Detail::default(); Self::BINS * Self::TILES] }
    }

    pub(super) fn clear(&mut self) {
        self.cells.fill(Detail::default());
    }

    /// The tile of column `x`, row `y` of `window`, both counted within it.
    pub(super) fn tile_of(x: u16, y: u16, window: Window) -> u8 {
        let part =
            |place: u16, parts: usize, size: u16| usize::from(place) * parts / usize::from(size.max(1));
        let (column, row) = (part(x, Self::COLUMNS, window.width), part(y, Self::ROWS, window.height));
        (row * Self::COLUMNS + column) as u8
    }

    pub(super) fn add(&mut self, bin: usize, tile: u8, detail: Detail) {
        if let Some(cell) = self.cells.get_mut(bin * Self::TILES + usize::from(tile)) {
            *cell = cell.plus(detail);
        }
    }

    /// What `tiles` booked in each bin with `filter`.
    pub fn by_bin(&self, filter: Filter, tiles: TileSet) -> impl Iterator<Item = i64> + '_ {
        self.cells.chunks_exact(Self::TILES).map(move |bin| {
            let cells = bin.iter().enumerate().filter(move |(tile, _)| tiles.contains(*tile));
            cells.map(|(_, cell)| cell.of(filter)).sum()
        })
    }
}
