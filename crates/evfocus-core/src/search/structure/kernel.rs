//! The running sum of events per pixel, and how much each event changes the energy of its fine structure.

use alloc::vec;
use alloc::vec::Vec;

use super::bookings::{Bookings, Detail};
use crate::event::{Event, Window};

/// Where the lens is along its sweep: 0 at the start, [`END`](Self::END) at the end.
///
/// Fine enough that the rounding, a nineteenth of a lens count of the paper's rig, is lost in a bin, and small enough for 16 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct TravelStep(pub u16);

impl TravelStep {
    /// Steps in a bin.
    pub const PER_BIN: u16 = 187;
    /// The end of the sweep.
    pub const END: Self = Self(Self::PER_BIN * (Bookings::BINS as u16 - 1));

    /// The bin that it lies in.
    pub fn bin(self) -> usize {
        usize::from(self.0 / Self::PER_BIN)
    }

    fn midpoint(self, other: Self) -> Self {
        Self(u16::midpoint(self.0, other.0))
    }
}

/// The last events of a pixel.
#[derive(Debug, Clone, Copy, Default)]
struct History {
    /// Where the lens was at the last one.
    last: TravelStep,
    /// How far it had come since the one before, or [`UNKNOWN`].
    gap: u16,
    /// Its sign; 0 before the first event.
    sign: i8,
    /// The tile of the pixel.
    tile: u8,
}

/// No gap is as long: [`TravelStep::END`] is less.
const UNKNOWN: u16 = u16::MAX;

/// The sum of a pixel's events is kept within this; more are a broken pixel's, which would outweigh the picture.
const LARGEST_STATE: i8 = 30;

/// Columns and rows of zeros around the picture: as far as the widest filter reaches.
const BORDER: usize = 4;

/// Adds up the events of each pixel, E(x), and books what every event adds to half the energy F = sum over x of E(x) (K E)(x), where
/// (K E)(x) is the sum of E over the 4 neighbours at distance 1 minus that over the 4 neighbours at distance 2 (the fine
/// filter) or at distance 4 (the coarse one).
///
/// K leaves E(x) itself out, so that noise which differs from pixel to pixel averages to zero.
///
/// A pixel that turns round has up to two thresholds to go before it fires the other way. Its first event of another sign therefore
/// stands for two level crossings; by the symmetry of the turn the first of them was as long before as the last gap of the
/// old sign, and half of the change is booked there.
#[derive(Debug, Clone)]
pub struct StructureKernel {
    window: Window,
    stride: usize,
    /// E, with its border.
    state: Vec<i8>,
    /// E at the end of the first pass, for the second.
    final_state: Vec<i8>,
    history: Vec<History>,
    first_pass: Bookings,
    second_pass: Bookings,
}

impl StructureKernel {
    /// A kernel for the pixels of `window`; events elsewhere are left out. All memory is allocated here: 8 bytes a pixel.
    pub fn new(window: Window) -> Self {
        let stride = usize::from(window.width) + 2 * BORDER;
        let bordered = stride * (usize::from(window.height) + 2 * BORDER);
        let mut kernel = Self {
            window,
            stride,
            state: vec![0; bordered],
            final_state: vec![0; bordered],
            history: vec![History::default(); bordered],
            first_pass: Bookings::new(),
            second_pass: Bookings::new(),
        };
        kernel.assign_tiles();
        kernel
    }

    fn assign_tiles(&mut self) {
        for y in 0..self.window.height {
            for x in 0..self.window.width {
                let place = self.index(x, y);
                if let Some(history) = self.history.get_mut(place) {
                    history.tile = Bookings::tile_of(x, y, self.window);
                }
            }
        }
    }

    /// Forgets everything, for a new sweep.
    pub fn begin(&mut self) {
        self.first_pass.clear();
        self.second_pass.clear();
        self.forget_events();
    }

    /// Takes an event that happened when the lens was at `step`.
    #[inline]
    pub fn take(&mut self, event: &Event, step: TravelStep) {
        let Some(place) = self.place(event) else { return };
        let detail = detail(&self.state, self.stride, place);
        let Some(change) = self.change(event, place, step) else { return };
        let contribution = detail.signed(change.sign < 0);
        self.first_pass.add(step.bin(), change.tile, contribution);
        self.first_pass.add(change.earlier.bin(), change.tile, contribution.only_if(change.has_turned));
    }

    /// After the last event: makes ready to go over the same events again, so that the energy can be referred to the picture at the
    /// end instead of the one at the start.
    pub fn begin_again(&mut self) {
        core::mem::swap(&mut self.state, &mut self.final_state);
        self.forget_events();
        self.second_pass.clear();
    }

    /// Takes an event again. With E' the picture at the end, half the energy of E - a E' is half that of E minus a times the sum
    /// over x of E(x) (K E')(x), but for a constant; that sum is booked here.
    pub fn take_again(&mut self, event: &Event, step: TravelStep) {
        let Some(place) = self.place(event) else { return };
        let detail = detail(&self.final_state, self.stride, place);
        let Some(change) = self.change(event, place, step) else { return };
        let contribution = detail.signed(change.sign < 0);
        self.second_pass.add(step.bin(), change.tile, contribution);
        self.second_pass.add(step.bin(), change.tile, contribution.only_if(change.has_turned));
    }

    /// By how much half the energy grew while the lens was in each bin.
    pub fn first_pass(&self) -> &Bookings {
        &self.first_pass
    }

    /// What the picture at the end has in common with the one of each bin.
    pub fn second_pass(&self) -> &Bookings {
        &self.second_pass
    }

    /// The pixels it looks at.
    pub fn window(&self) -> Window {
        self.window
    }

    /// E of a pixel of the sensor, 0 outside of the window.
    pub fn state(&self, x: u16, y: u16) -> i8 {
        let place = self.window.place_of(x, y).map(|(x, y)| self.index(x, y));
        place.and_then(|place| self.state.get(place)).copied().unwrap_or(0)
    }

    fn forget_events(&mut self) {
        self.state.fill(0);
        for history in &mut self.history {
            *history = History { tile: history.tile, ..History::default() };
        }
    }

    fn place(&self, event: &Event) -> Option<usize> {
        self.window.place_of(event.x, event.y).map(|(x, y)| self.index(x, y))
    }

    fn index(&self, x: u16, y: u16) -> usize {
        (usize::from(y) + BORDER) * self.stride + usize::from(x) + BORDER
    }

    /// Changes E and the history of the pixel at `place`. `None` if E would leave its bounds: then it stays as it is.
    fn change(&mut self, event: &Event, place: usize, step: TravelStep) -> Option<Change> {
        let sign: i8 = if event.polarity.is_on() { 1 } else { -1 };
        let history = self.history.get_mut(place)?;
        let before = *history;
        let has_turned = before.sign == -sign;
        let since = step.0.saturating_sub(before.last.0);
        let gap = if has_turned || before.sign == 0 { UNKNOWN } else { since };
        *history = History { last: step, gap, sign, tile: before.tile };
        let earlier = first_crossing(before, step);
        let change = Change { sign, has_turned, earlier, tile: before.tile };
        let state = self.state.get_mut(place)?;
        let changed = *state + change.steps();
        if !(-LARGEST_STATE..=LARGEST_STATE).contains(&changed) {
            return None;
        }
        *state = changed;
        Some(change)
    }
}

/// What an event says of the brightness of its pixel.
#[derive(Debug, Clone, Copy)]
struct Change {
    sign: i8,
    /// Whether it stands for two level crossings.
    has_turned: bool,
    /// Where the first of the two was.
    earlier: TravelStep,
    tile: u8,
}

impl Change {
    /// Level crossings, with their sign.
    fn steps(self) -> i8 {
        if self.has_turned { 2 * self.sign } else { self.sign }
    }
}

/// Where the pixel came back across the level of its last event, if at `now` it came back across the one below.
fn first_crossing(before: History, now: TravelStep) -> TravelStep {
    // An unknown gap, or one longer than the way so far, wraps round to beyond `now`.
    let mirrored = TravelStep(now.0.wrapping_sub(before.gap));
    if (before.last..=now).contains(&mirrored) { mirrored } else { before.last.midpoint(now) }
}

/// (K E)(x) at `place`, by filter.
fn detail(state: &[i8], stride: usize, place: usize) -> Detail {
    // The rows that the widest filter reaches; a place is never in the border.
    let reach = BORDER * stride;
    let rows = place.checked_sub(reach).and_then(|first| state.get(first..=place + reach));
    let row = rows.and_then(|rows| rows.get(reach - BORDER..)?.first_chunk::<{ 2 * BORDER + 1 }>());
    let (Some(rows), Some(row)) = (rows, row) else { return Detail::default() };
    let along = |distance: usize| i32::from(row[BORDER - distance]) + i32::from(row[BORDER + distance]);
    let at = |index: usize| rows.get(index).copied().map_or(0, i32::from);
    let across = |distance: usize| at(reach - distance * stride) + at(reach + distance * stride);
    let (beside, above) = (along(1), across(1));
    Detail([beside - along(2), above - across(2), beside + above - along(4) - across(4), 0])
}
