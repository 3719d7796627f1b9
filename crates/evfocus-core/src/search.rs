//! Searches for the sharpest moment of a sweep.

mod egs;
mod egs_official;
mod er_fixed;
mod mirror_pairs;
mod structure;

use core::fmt;
use core::str::FromStr;
use core::time::Duration;

use crate::counter::CounterError;
use crate::event::Geometry;
use crate::event_store::EventStore;
use crate::lens_trace::{LensTrace, LensTraceError};
use crate::measure::PixelCounts;
use crate::sweep::Sweep;
use crate::units::{CameraMicros, LensPosition};

pub use egs::{Comparison, GOLDEN_RATIO, MAX_ITERATIONS, STOP_INTERVAL_US, golden_search};
pub use structure::{
    Apex, ApexFinder, Bookings, Filter, LEAST_SIGNIFICANCE, MOST_WINDOWS, NoiseMeter, Reading,
    StructureAnswer, StructureKernel, StructureMeasure, TileAnswer, TileSet, Travel, TravelStep,
};

use mirror_pairs::MirrorPairs;
pub(crate) use structure::{FAINTEST, StructureSearch};

/// A focus measure together with the search that looks for its maximum.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Method {
    /// Golden search on the event rate: the paper's Algorithm 2, with its offsets corrected.
    Egs,
    /// What the code that the paper's authors published does, step by step.
    EgsOfficial,
    /// The highest event rate at a fixed accumulation interval: the paper's Algorithm 1.
    ErFixed,
    /// Golden search on the sum of the squared event rates of the pixels: the paper's F_ev to the letter.
    ErSquared,
    /// The highest energy of the fine structure of the picture that the events add up to.
    Structure,
    /// The middle between the two places of the lens at which pixels were equally bright.
    MirrorPairs,
    /// `structure`, with everything that speaks against its answer.
    Auto,
}

impl Method {
    /// Every method.
    pub const ALL: [Self; 7] = [
        Self::Egs,
        Self::EgsOfficial,
        Self::ErFixed,
        Self::ErSquared,
        Self::Structure,
        Self::MirrorPairs,
        Self::Auto,
    ];

    /// The name users know it by.
    pub fn name(self) -> &'static str {
        match self {
            Self::Egs => "egs",
            Self::EgsOfficial => "egs-official",
            Self::ErFixed => "er-fixed",
            Self::ErSquared => "er-squared",
            Self::Structure => "structure",
            Self::MirrorPairs => "mirror-pairs",
            Self::Auto => "auto",
        }
    }

    /// Whether it goes over every event, so that its cost grows with their number. The others take differences of totals or look a
    /// few events up.
    pub fn reads_every_event(self) -> bool {
        match self {
            Self::Egs | Self::EgsOfficial | Self::ErFixed => false,
            Self::ErSquared | Self::Structure | Self::MirrorPairs | Self::Auto => true,
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A method name that is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("no such method; use one of egs, egs-official, er-fixed, er-squared, structure, mirror-pairs, auto")]
pub struct UnknownMethod;

impl FromStr for Method {
    type Err = UnknownMethod;
    fn from_str(name: &str) -> Result<Self, UnknownMethod> {
        Self::ALL.into_iter().find(|method| method.name() == name).ok_or(UnknownMethod)
    }
}

/// What a search found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The lens position of the answer.
    pub position: LensPosition,
    /// Its time on the camera's clock, microseconds.
    pub t_us: f64,
    /// Comparisons (golden searches), windows (fixed interval) or passes over the events (structure) made.
    pub iterations: u32,
    /// Length of the last accumulation interval; for structure the time that the lens spent within the full width at half height
    /// of the peak; microseconds.
    pub interval_us: f64,
}

/// Why a search has no answer.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum SearchError {
    /// All events have the same time.
    #[error("the sweep has no length: all of its events are at {at_us} us")]
    NoLength {
        /// That time, microseconds.
        at_us: i64,
    },
    /// The fixed interval is longer than the sweep.
    #[error(
        "an accumulation interval of {interval_us} us does not fit a sweep of {sweep_us} us; use a shorter one"
    )]
    IntervalTooLong {
        /// Interval, microseconds.
        interval_us: f64,
        /// Sweep, microseconds.
        sweep_us: f64,
    },
    /// The method needs every event, and there was not room for all.
    #[error(
        "{not_kept} of the sweep's events did not fit the event buffer, and this method needs every one; enlarge the buffer or use egs"
    )]
    EventsNotKept {
        /// Events beyond the buffer.
        not_kept: u64,
    },
    /// The sweep begins and ends at the same lens position.
    #[error("the sweep begins and ends at the same lens position, {at}")]
    NoTravel {
        /// That position.
        at: LensPosition,
    },
    /// No lens position makes the picture sharper by more than chance does.
    #[error(
        "no peak above chance (significance {significance:.1}, {LEAST_SIGNIFICANCE} is needed): nothing with texture is in view, or it is too dark"
    )]
    Weak {
        /// How high the highest peak is in units of what chance makes.
        significance: f64,
    },
    /// Too few pixels were equally bright twice.
    #[error("no two sides of a peak: too few pixels went there and came back")]
    NoPairs,
    /// The counter does not cover the sweep.
    #[error(transparent)]
    Counter(#[from] CounterError),
    /// The lens trace does not cover the answer.
    #[error(transparent)]
    Trace(#[from] LensTraceError),
}

/// What a search needs beside the sweep; allocated once.
#[derive(Debug, Clone)]
pub struct Searcher {
    pixel_counts: PixelCounts,
    structure: StructureSearch,
    mirror_pairs: MirrorPairs,
}

impl Searcher {
    /// A searcher for sweeps of sensors of `geometry`.
    pub fn new(geometry: Geometry) -> Self {
        Self {
            pixel_counts: PixelCounts::new(geometry),
            structure: StructureSearch::new(geometry),
            mirror_pairs: MirrorPairs::new(geometry),
        }
    }

    pub(crate) fn structure(&mut self) -> &mut StructureSearch {
        &mut self.structure
    }

    /// Begins to take the events of a sweep along `travel` as they come.
    pub(crate) fn begin(&mut self, travel: Travel) {
        self.structure.begin(travel);
        self.mirror_pairs.begin(travel);
    }

    /// Takes the events that it has not taken yet, up to the time `until`.
    pub(crate) fn take(&mut self, store: &EventStore, trace: &LensTrace<CameraMicros>, until: CameraMicros) {
        self.structure.take(store, trace, until);
        self.mirror_pairs.take(store, trace, until);
    }

    /// What mirror pairs say of the sweep that was begun.
    pub(crate) fn mirror_pairs(&mut self, sweep: &Sweep<'_>) -> Result<Estimate, SearchError> {
        self.mirror_pairs.answer(sweep)
    }

    /// Looks for the sharpest moment of `sweep`. `interval` is the accumulation interval of [`Method::ErFixed`] (the paper
    /// uses 55 and 65 ms); the other methods find their own. Allocates nothing.
    ///
    /// # Errors
    /// [`SearchError`], naming what the sweep lacks.
    pub fn search(
        &mut self,
        method: Method,
        sweep: &Sweep<'_>,
        interval: Duration,
    ) -> Result<Estimate, SearchError> {
        if sweep.end <= sweep.start {
            return Err(SearchError::NoLength { at_us: sweep.start.0 });
        }
        match method {
            Method::Egs => egs::search(sweep),
            Method::ErSquared => egs::search_squared(sweep, &mut self.pixel_counts),
            Method::EgsOfficial => egs_official::search(sweep),
            Method::ErFixed => er_fixed::search(sweep, interval),
            Method::Structure | Method::Auto => {
                self.structure.begin(Travel::of(sweep)?);
                Ok(self.structure.answer(sweep)?.significant()?.estimate())
            }
            Method::MirrorPairs => {
                self.mirror_pairs.begin(Travel::of(sweep)?);
                self.mirror_pairs.answer(sweep)
            }
        }
    }
}

fn all_events_kept(sweep: &Sweep<'_>) -> Result<(), SearchError> {
    if sweep.store.is_complete() {
        Ok(())
    } else {
        Err(SearchError::EventsNotKept { not_kept: sweep.store.not_kept() })
    }
}
