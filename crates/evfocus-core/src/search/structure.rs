//! Energy of the fine structure of the picture that the events add up to: the focus measure that does not mind how fast things move.
//!
//! The event rate depends on the speed of the scene, the sum of the events does not: shifting a picture leaves the energy of its
//! fine structure as it is, blurring it lowers it. So the lens position at which that energy was highest is focus, in still scenes
//! and in shaken ones. Every number here was settled on simulated sweeps of two public pixel models.
//!
//! The photoreceptor's delay stays in the raw answer: about 6 ms in light, 15 to 50 ms in the dark, times the speed of the lens.
//! [`DelayModel`](crate::DelayModel) takes it off by the noise of the pixels; sweeping both ways cancels it.

mod apex;
mod bookings;
mod kernel;
mod measure;
mod noise;
mod reading;
mod travel;

use alloc::vec::Vec;

use super::{Estimate, SearchError, all_events_kept};
use crate::event::{Geometry, Window};
use crate::event_list::Events;
use crate::event_store::EventStore;
use crate::lens_trace::LensTrace;
use crate::sweep::Sweep;
use crate::units::{CameraMicros, LensPosition};

pub use apex::{Apex, ApexFinder};
pub use bookings::{Bookings, Filter, TileSet};
pub use kernel::{StructureKernel, TravelStep};
pub use measure::{Reading, StructureMeasure};
pub use noise::NoiseMeter;
pub(crate) use reading::FAINTEST;
pub use reading::LEAST_SIGNIFICANCE;
pub use travel::Travel;

pub(super) use travel::LensCursor;

use reading::{CONSISTENT, Found, LEAST_IF_CONSISTENT};

/// Most windows of a request.
pub const MOST_WINDOWS: usize = 8;

/// What one tile of the picture says.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TileAnswer {
    /// Where it was sharpest, the delay of the pixels still in it.
    pub position: LensPosition,
    /// How high its peak is in units of what chance makes.
    pub significance: f64,
    /// One standard deviation of the position, counts.
    pub error_bar: f64,
}

/// What the energy of the fine structure says of one sweep. Positions have the delay of the pixels still in them.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(clippy::struct_excessive_bools, reason = "each is a finding of its own")]
pub struct StructureAnswer {
    /// Where the picture was sharpest.
    pub position: LensPosition,
    /// Full width of the peak at half its height, counts.
    pub width: f64,
    /// How high the peak is in units of what chance makes over its width.
    pub significance: f64,
    /// One standard deviation of the position, counts, the delay apart.
    pub scatter: f64,
    /// Noise of the pixels, events per second.
    pub noise_hz: f64,
    /// Speed of the lens there, counts per second; negative for the way down.
    pub velocity: f64,
    /// Where a good part of the picture was sharpest, if elsewhere.
    pub rival: Option<LensPosition>,
    /// The answer is from coarser structure, for the fine one was too weak.
    pub is_coarse: bool,
    /// The readings of the same events differ by a good part of the width.
    pub is_unsure: bool,
    /// The peak is cut off by an end of the sweep.
    pub is_at_edge: bool,
    /// The peak is wider than 40 % of the sweep.
    pub is_flat: bool,
    /// Each tile, row by row.
    pub tiles: [TileAnswer; Bookings::TILES],
    /// Passes over the events.
    pub passes: u32,
    /// When the lens was there, camera time in microseconds.
    pub t_us: f64,
    /// How long it was within the width, microseconds.
    pub interval_us: f64,
}

impl StructureAnswer {
    /// Itself, if chance does not make such a peak: it is high, or fairly high and much the same however it is read.
    ///
    /// # Errors
    /// [`SearchError::Weak`].
    pub fn significant(self) -> Result<Self, SearchError> {
        let Self { significance, scatter, width, .. } = self;
        let is_consistent = significance >= LEAST_IF_CONSISTENT && scatter <= CONSISTENT * width;
        if significance < LEAST_SIGNIFICANCE && !is_consistent {
            return Err(SearchError::Weak { significance });
        }
        Ok(self)
    }

    /// The same as every method's.
    pub fn estimate(&self) -> Estimate {
        let Self { position, t_us, passes, interval_us, .. } = *self;
        Estimate { position, t_us, iterations: passes, interval_us }
    }
}

/// A peak wider than this part of the sweep is no peak.
const WIDEST: f64 = 0.4;
/// An apex nearer to the start than this part of its width is the start itself.
const START: f64 = 0.05;
/// An apex nearer to an end than this part of its width is cut off.
const EDGE: f64 = 0.5;

/// `structure` of the whole picture and of windows of it, as the events come in.
#[derive(Debug, Clone)]
pub(crate) struct StructureSearch {
    whole: StructureMeasure,
    /// Of the whole picture: a window may hold nothing quiet, or no whole tile.
    noise: NoiseMeter,
    windows: Vec<StructureMeasure>,
}

impl StructureSearch {
    pub(crate) fn new(geometry: Geometry) -> Self {
        let whole = Window::whole(geometry);
        Self { whole: StructureMeasure::new(whole), noise: NoiseMeter::new(whole), windows: Vec::new() }
    }

    /// Looks at these windows too, at most [`MOST_WINDOWS`]. Allocates their memory if they are not those of before.
    pub(crate) fn set_windows(&mut self, windows: impl Iterator<Item = Window> + Clone) {
        if !windows.clone().eq(self.windows.iter().map(StructureMeasure::window)) {
            self.windows = windows.take(MOST_WINDOWS).map(StructureMeasure::new).collect();
        }
    }

    pub(crate) fn begin_rest(&mut self) {
        self.noise.forget();
    }

    pub(crate) fn observe_rest(&mut self, events: Events<'_>) {
        for event in events.iter() {
            self.noise.take(&event);
        }
    }

    pub(crate) fn end_rest(&mut self) {
        self.noise.end_rest();
    }

    pub(crate) fn begin(&mut self, travel: Travel) {
        self.noise.begin();
        self.whole.begin(travel);
        for window in &mut self.windows {
            window.begin(travel);
        }
    }

    pub(crate) fn take(&mut self, store: &EventStore, trace: &LensTrace<CameraMicros>, until: CameraMicros) {
        let Self { whole, noise, windows } = self;
        whole.take(store, trace, until, |event| noise.take(event));
        for window in windows {
            window.take(store, trace, until, |_| {});
        }
    }

    /// The peak so far, of the whole picture or of the windows together.
    pub(crate) fn has_passed_peak(&mut self) -> bool {
        self.whole.has_passed_peak() && self.windows.iter_mut().all(StructureMeasure::has_passed_peak)
    }

    /// Takes what is left of `sweep`. The answer of the whole picture, which may be too weak to be believed alone.
    pub(crate) fn answer(&mut self, sweep: &Sweep<'_>) -> Result<StructureAnswer, SearchError> {
        all_events_kept(sweep)?;
        self.take(sweep.store, sweep.trace, sweep.end);
        answer(&mut self.whole, self.noise.noise_hz(), sweep)
    }

    /// The answers of the windows, after that of the whole picture.
    pub(crate) fn window_answers(
        &mut self,
        sweep: &Sweep<'_>,
    ) -> impl Iterator<Item = (Window, Result<StructureAnswer, SearchError>)> {
        let noise_hz = self.noise.noise_hz();
        self.windows.iter_mut().map(move |measure| {
            (measure.window(), all_events_kept(sweep).and_then(|()| answer(measure, noise_hz, sweep)))
        })
    }
}

/// Reads the answer off `measure`, which has taken its sweep.
fn answer(
    measure: &mut StructureMeasure,
    noise_hz: f64,
    sweep: &Sweep<'_>,
) -> Result<StructureAnswer, SearchError> {
    let nothing = SearchError::Weak { significance: 0.0 };
    let travel = measure.travel().ok_or(nothing)?;
    let first = measure.read(Reading::FIRST).ok_or(nothing)?;
    // Near the start the picture at the start is the wrong one to compare with. And where not much texture is blurred away by far,
    // what is most unlike the start is the other end.
    let is_at_end = measure.bins_covered() as f64 - first.at < EDGE * first.width;
    // What chance makes is not worth going over the events again.
    let is_cut_off = first.at < first.width || is_at_end;
    let (mut reference, passes) =
        if is_cut_off && first.significance >= FAINTEST { (1.0, 2) } else { (0.0, 1) };
    if passes == 2 {
        measure.take_again(sweep.store, sweep.trace);
    }
    if passes == 2 && first.at >= first.width {
        let other = measure.read(Reading { reference: 1.0, ..Reading::FIRST }).ok_or(nothing)?;
        // Compared with the end, what is truly sharp near the end is most unlike the start, or anything blurred alike.
        let is_no_peak =
            other.width > WIDEST * Bookings::BINS as f64 || other.significance < LEAST_SIGNIFICANCE;
        if other.at < START * other.width || is_no_peak {
            reference = 0.0;
        }
    }
    let mut found = measure.read_all(Filter::Fine, reference).ok_or(nothing)?;
    if !found.is_sound()
        && let Some(coarse) = measure.read_all(Filter::Coarse, reference)
        && (coarse.is_sound() || coarse.apex.significance > found.apex.significance)
    {
        found = coarse;
    }
    if found.apex.significance < FAINTEST {
        return Err(SearchError::Weak { significance: found.apex.significance });
    }
    Ok(in_counts(measure, &found, (noise_hz, passes), travel, sweep))
}

fn in_counts(
    measure: &StructureMeasure,
    found: &Found,
    (noise_hz, passes): (f64, u32),
    travel: Travel,
    sweep: &Sweep<'_>,
) -> StructureAnswer {
    let Found { apex, filter, scatter, rival, tiles } = *found;
    let counts = libm::fabs(travel.counts_per_bin());
    let end = measure.bins_covered() as f64;
    let Estimate { position, t_us, interval_us, .. } = travel.estimate(sweep, apex.at, apex.width, passes);
    StructureAnswer {
        position,
        width: apex.width * counts,
        significance: apex.significance,
        scatter: scatter * counts,
        noise_hz,
        velocity: travel.velocity(sweep, apex.at, apex.width / 2.0),
        rival: rival.map(|rival| travel.position_of(rival.at)),
        is_coarse: filter == Filter::Coarse,
        is_unsure: found.is_unsure(),
        is_at_edge: apex.at.min(end - apex.at) < EDGE * apex.width,
        is_flat: apex.width > WIDEST * Bookings::BINS as f64,
        tiles: tiles.map(|tile| TileAnswer {
            position: travel.position_of(tile.at),
            significance: tile.significance,
            error_bar: tile.error_bar() * counts,
        }),
        passes,
        t_us,
        interval_us,
    }
}
