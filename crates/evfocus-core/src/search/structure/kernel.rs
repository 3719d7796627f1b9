//! The running sum of events per pixel, and how much each event changes the energy of its fine structure.

use alloc::vec;
use alloc::vec::Vec;

use crate::event::{Event, Geometry};

/// Where the lens is along its sweep: 0 at the start, [`END`](Self::END) at the end.
///
/// Fine enough that the rounding, a nineteenth of a lens count of the paper's rig, is lost in a bin, and small enough for 16 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct TravelStep(pub u16);

impl TravelStep {
    /// Steps in a bin.
    pub const PER_BIN: u16 = 187;
    /// The end of the sweep.
    pub const END: Self = Self(Self::PER_BIN * (StructureKernel::BINS as u16 - 1));

    fn bin(self) -> usize {
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
}

/// No gap is as long: [`TravelStep::END`] is less.
const UNKNOWN: u16 = u16::MAX;

/// The sum of a pixel's events is kept within this; more are a broken pixel's, which would outweigh the picture.
const LARGEST_STATE: i8 = 30;

/// Columns and rows of zeros around the picture: as far as the kernel reaches.
const BORDER: usize = 2;

/// Adds up the events of each pixel, E(x), and books what every event adds to half the energy F = sum over x of E(x) (K E)(x), where
/// (K E)(x) is the sum of E over the 4 neighbours at distance 1 minus that over the 4 neighbours at distance 2.
///
/// K leaves E(x) itself out, so that noise which differs from pixel to pixel averages to zero.
///
/// A pixel that turns round has up to two thresholds to go before it fires the other way. Its first event of another sign therefore
/// stands for two level crossings; by the symmetry of the turn the first of them was as long before as the last gap of the
/// old sign, and half of the change is booked there.
#[derive(Debug, Clone)]
pub struct StructureKernel {
    geometry: Geometry,
    stride: usize,
    /// E, with its border.
    state: Vec<i8>,
    /// E at the end of the first pass, for the second.
    final_state: Vec<i8>,
    history: Vec<History>,
    growth: Vec<i64>,
}

impl StructureKernel {
    /// Bins of the lens's way: 350, and the end itself.
    pub const BINS: usize = 351;

    /// A kernel for sensors of `geometry`. All memory is allocated here: 8 bytes a pixel.
    pub fn new(geometry: Geometry) -> Self {
        let stride = usize::from(geometry.width) + 2 * BORDER;
        let bordered = stride * (usize::from(geometry.height) + 2 * BORDER);
        Self {
            geometry,
            stride,
            state: vec![0; bordered],
            final_state: vec![0; bordered],
            history: vec![History::default(); bordered],
            growth: vec![0; Self::BINS],
        }
    }

    /// Forgets everything, for a new sweep.
    pub fn begin(&mut self) {
        self.growth.fill(0);
        self.forget_events();
    }

    /// Takes an event that happened when the lens was at `step`. An event outside of the sensor is left out.
    pub fn take(&mut self, event: &Event, step: TravelStep) {
        let Some(place) = self.place(event) else { return };
        let fine_structure = fine_structure(&self.state, self.stride, place);
        let Some(change) = self.change(event, place, step) else { return };
        let contribution = i64::from(change.sign) * i64::from(fine_structure);
        self.book(step, contribution);
        // Nothing is booked as nothing: turns come by chance, and a branch on them would cost more than the addition.
        self.book(change.earlier, if change.has_turned { contribution } else { 0 });
    }

    /// After the last event: makes ready to go over the same events again, so that the energy will be that of the difference to
    /// the picture at the end instead of to the one at the start.
    pub fn begin_again(&mut self) {
        core::mem::swap(&mut self.state, &mut self.final_state);
        self.forget_events();
    }

    /// Takes an event again. With E' the picture at the end, half the energy of E - E' is half that of E minus the sum over
    /// x of E(x) (K E')(x), but for a constant; the second term is booked here.
    pub fn take_again(&mut self, event: &Event, step: TravelStep) {
        let Some(place) = self.place(event) else { return };
        let fine_structure = fine_structure(&self.final_state, self.stride, place);
        let Some(change) = self.change(event, place, step) else { return };
        self.book(step, -i64::from(change.steps()) * i64::from(fine_structure));
    }

    /// By how much half the energy grew while the lens was in each bin.
    pub fn growth(&self) -> &[i64] {
        &self.growth
    }

    /// E of a pixel, 0 outside of the sensor.
    pub fn state(&self, x: u16, y: u16) -> i8 {
        let inside = self.geometry.contains(x, y);
        self.state.get(self.index(x, y)).copied().filter(|_| inside).unwrap_or(0)
    }

    fn forget_events(&mut self) {
        self.state.fill(0);
        self.history.fill(History::default());
    }

    fn place(&self, event: &Event) -> Option<usize> {
        self.geometry.contains(event.x, event.y).then(|| self.index(event.x, event.y))
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
        *history =
            History { last: step, gap: if has_turned || before.sign == 0 { UNKNOWN } else { since }, sign };
        let change = Change { sign, has_turned, earlier: first_crossing(before, step) };
        let state = self.state.get_mut(place)?;
        let changed = *state + change.steps();
        if !(-LARGEST_STATE..=LARGEST_STATE).contains(&changed) {
            return None;
        }
        *state = changed;
        Some(change)
    }

    fn book(&mut self, step: TravelStep, contribution: i64) {
        if let Some(bin) = self.growth.get_mut(step.bin()) {
            *bin += contribution;
        }
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

/// (K E)(x) at `place`.
fn fine_structure(state: &[i8], stride: usize, place: usize) -> i32 {
    // The rows that the kernel reaches; a place is never in the border.
    let reach = BORDER * stride;
    let Some(rows) = place.checked_sub(reach).and_then(|first| state.get(first..=place + reach)) else {
        return 0;
    };
    let at = |index: usize| rows.get(index).copied().map_or(0, i32::from);
    let cross = |distance: usize| {
        let (along, across) = (distance, distance * stride);
        at(reach - along) + at(reach + along) + at(reach - across) + at(reach + across)
    };
    cross(1) - cross(2)
}
