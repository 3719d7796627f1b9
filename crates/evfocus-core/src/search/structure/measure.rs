//! Gathers the energy of the fine structure while the lens goes its way.

use alloc::vec::Vec;

use super::apex::{Apex, ApexFinder, TOP};
use super::bookings::{Bookings, Filter, TileSet};
use super::kernel::{StructureKernel, TravelStep};
use super::reading::LEAST_SIGNIFICANCE;
use super::travel::{LensCursor, Travel};
use crate::event::{Event, Window};
use crate::event_store::EventStore;
use crate::lens_trace::LensTrace;
use crate::units::CameraMicros;

/// What happens while the lens is within this of its start, or of its end, belongs to no position: shake alone would fill the first
/// bin, and the picture that all is referred to would be a smeared one.
const REST: u16 = TravelStep::PER_BIN / 2;

/// A peak must be this significant before the sweep may end for it: not every hill on the way is the highest.
const SURE_SIGNIFICANCE: f64 = 2.0 * LEAST_SIGNIFICANCE;

/// Where the measure is in its sweep.
#[derive(Debug, Clone, Copy)]
struct Progress {
    cursor: LensCursor,
    travel: Travel,
    /// The events of the store that were taken, and the next one to look at.
    taken: (usize, usize),
    phase: Phase,
    newest: TravelStep,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    AtStart,
    UnderWay,
    Arrived,
}

/// A way of reading the apex off what was booked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Which neighbours.
    pub filter: Filter,
    /// What the picture is compared with: 0 for the one at the start, 1 for the one at the end, in between for a mixture.
    pub reference: f64,
    /// The parabola goes through what lies above this part of the peak's height.
    pub top: f64,
    /// The parts of the picture.
    pub tiles: TileSet,
}

impl Reading {
    /// The usual one: the whole picture, compared with the one at the start.
    pub const FIRST: Self = Self { filter: Filter::Fine, reference: 0.0, top: TOP, tiles: TileSet::ALL };
}

/// `structure` as the events come in. All memory is allocated at the start.
#[derive(Debug, Clone)]
pub struct StructureMeasure {
    kernel: StructureKernel,
    finder: ApexFinder,
    curve: Vec<f64>,
    progress: Option<Progress>,
}

impl StructureMeasure {
    /// A measure of the pixels of `window`.
    pub fn new(window: Window) -> Self {
        Self {
            kernel: StructureKernel::new(window),
            finder: ApexFinder::new(),
            curve: Vec::with_capacity(Bookings::BINS),
            progress: None,
        }
    }

    /// Begins a sweep over the way of `travel`, whose events an emptied store will hold.
    pub fn begin(&mut self, travel: Travel) {
        self.kernel.begin();
        self.progress = Some(Progress {
            cursor: LensCursor::new(travel),
            travel,
            taken: (0, 0),
            phase: Phase::AtStart,
            newest: TravelStep::default(),
        });
    }

    /// Takes the events of `store` that it has not taken yet, up to the time `until`, for which `trace` tells the lens positions. Each is
    /// shown to `also`, as are those made before the lens moved.
    pub fn take(
        &mut self,
        store: &EventStore,
        trace: &LensTrace<CameraMicros>,
        until: CameraMicros,
        mut also: impl FnMut(&Event),
    ) {
        let Some(progress) = &mut self.progress else { return };
        for event in store.iter_from(progress.taken.1) {
            if event.t > until || progress.phase == Phase::Arrived {
                return;
            }
            let step = progress.cursor.at(event.t, trace);
            also(&event);
            if progress.phase == Phase::AtStart {
                if step.0 < REST {
                    progress.taken.1 += 1;
                    progress.taken.0 = progress.taken.1;
                    continue;
                }
                progress.phase = Phase::UnderWay;
            } else if step.0 > TravelStep::END.0 - REST {
                progress.phase = Phase::Arrived;
                return;
            }
            self.kernel.take(&event, step);
            progress.taken.1 += 1;
            progress.newest = step;
        }
    }

    /// Goes over the events taken once more, so that readings may refer to the picture at the end.
    pub fn take_again(&mut self, store: &EventStore, trace: &LensTrace<CameraMicros>) {
        let Some(progress) = &mut self.progress else { return };
        self.kernel.begin_again();
        let (from, to) = progress.taken;
        for event in store.iter_from(from).take(to.saturating_sub(from)) {
            let step = progress.cursor.at(event.t, trace);
            self.kernel.take_again(&event, step);
        }
    }

    /// The way of the sweep under way, or of the last one.
    pub fn travel(&self) -> Option<Travel> {
        self.progress.map(|progress| progress.travel)
    }

    /// The apex so far; `None` before the first event.
    pub fn read(&mut self, reading: Reading) -> Option<Apex> {
        let bins = self.progress?.newest.bin() + 1;
        let Reading { filter, reference, top, tiles } = reading;
        let mut sum = 0.0;
        self.curve.clear();
        let pairs = self
            .kernel
            .first_pass()
            .by_bin(filter, tiles)
            .zip(self.kernel.second_pass().by_bin(filter, tiles));
        for (first, second) in pairs.take(bins) {
            sum += first as f64 - reference * second as f64;
            self.curve.push(sum);
        }
        self.finder.find(&self.curve, top)
    }

    /// The energy by bin of the lens's way, as last read; its unit is arbitrary.
    pub fn curve(&self) -> &[f64] {
        &self.curve
    }

    /// The pixels it looks at.
    pub fn window(&self) -> Window {
        self.kernel.window()
    }

    /// How far the lens has come, bins.
    pub fn bins_covered(&self) -> usize {
        self.progress.map_or(0, |progress| progress.newest.bin() + 1)
    }

    /// Whether the lens is far enough beyond the highest peak so far that nothing of what is still to come can change the answer, but
    /// for a higher peak: one width, and two where the peak is so near to the start that only the picture at the end can be
    /// compared with.
    pub fn has_passed_peak(&mut self) -> bool {
        let covered = self.bins_covered() as f64;
        let Some(apex) = self.read(Reading::FIRST) else { return false };
        let widths = if apex.at < apex.width { 2.0 } else { 1.0 };
        // A curve that is high again may be on its way to a higher peak.
        let is_down = apex.end_level < 0.5;
        apex.significance >= SURE_SIGNIFICANCE && is_down && covered - apex.at > widths * apex.width
    }
}
