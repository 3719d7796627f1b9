//! What a sweep says, and whether to believe it: the same code for a live run and for a recording.

use core::time::Duration;

use crate::event::Geometry;
use crate::lens_trace::LensTrace;
use crate::quality::SweepQuality;
use crate::report::{Failure, LegReport};
use crate::search::{Method, Searcher};
use crate::sweep::{Sweep, SweepRecorder};
use crate::units::{CameraMicros, EventRate};

/// What a sweep must hold to be believed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SweepLimits {
    /// A sweep with fewer events is not searched.
    pub fewest_events: u64,
    /// The largest share of events that may be lost.
    pub largest_lost_share: f64,
    /// The largest share of events that may follow the mains (see [`SweepQuality::flicker_depth`]).
    pub largest_flicker_depth: f64,
}

impl Default for SweepLimits {
    fn default() -> Self {
        Self { fewest_events: 2_000, largest_lost_share: 0.05, largest_flicker_depth: 0.6 }
    }
}

/// Analyzes sweeps. All memory is allocated at the start.
#[derive(Debug, Clone)]
pub struct Analyzer {
    searcher: Searcher,
}

impl Analyzer {
    /// An analyzer for sweeps of sensors of `geometry`.
    pub fn new(geometry: Geometry) -> Self {
        Self { searcher: Searcher::new(geometry) }
    }

    /// Writes what `recorder` counted and what every estimator says of it into `report`, whose `lost` is given.
    ///
    /// # Errors
    /// The [`Failure`] that makes the sweep unfit to find focus with. The report holds what was seen all the same.
    pub fn analyze(
        &mut self,
        recorder: &SweepRecorder,
        trace: &LensTrace<CameraMicros>,
        method: Method,
        interval: Duration,
        limits: SweepLimits,
        report: &mut LegReport,
    ) -> Result<(), Failure> {
        let sweep = describe(recorder, trace, report);
        let counted = report.on + report.off;
        let too_few = Failure::TooFewEvents { events: counted, needed: limits.fewest_events };
        if counted < limits.fewest_events {
            return Err(too_few);
        }
        let sweep = sweep.ok_or(too_few)?;
        let quality = SweepQuality::of(&sweep).map_err(|error| Failure::NoAnswer(error.into()))?;
        report.quality = quality;
        for other in Method::ALL {
            // The cost of these grows with the number of events; they run only when they are what was asked for.
            if !other.reads_every_event() || method == other {
                let said = self.searcher.search(other, &sweep, interval);
                if let Some(place) = report.estimates.get_mut(other as usize) {
                    *place = Some(said);
                }
            }
        }
        // The most telling reason first: lamps fill the link, and what fills the link is lost.
        if quality.flicker_depth > limits.largest_flicker_depth {
            return Err(Failure::Flicker { hz: quality.flicker_hz });
        }
        if report.lost as f64 > limits.largest_lost_share * (counted + report.lost) as f64 {
            return Err(Failure::EventsLost { lost: report.lost, counted });
        }
        if quality.is_saturated() {
            return Err(Failure::Saturated);
        }
        if quality.is_flat() {
            return Err(Failure::Flat);
        }
        match report.estimate(method) {
            Some(Err(error)) => Err(Failure::NoAnswer(error)),
            Some(Ok(_)) | None => Ok(()),
        }
    }
}

/// Writes what `recorder` counted into `report`, and the focus curve as far as there is one. Returns the sweep, if it has events
/// at known lens positions.
pub(crate) fn describe<'a>(
    recorder: &'a SweepRecorder,
    trace: &'a LensTrace<CameraMicros>,
    report: &mut LegReport,
) -> Option<Sweep<'a>> {
    (report.on, report.off) = recorder.counter().totals();
    report.not_kept = recorder.store().not_kept();
    if let (Some((_, from)), Some((_, to))) = (trace.first(), trace.last()) {
        (report.from, report.to) = (from, to);
    }
    let sweep = recorder.sweep(trace)?;
    (report.start, report.end) = (sweep.start, sweep.end);
    report.curve.fill(&sweep);
    report.peak_rate = EventRate(report.curve.points().iter().map(|point| point.rate.0).fold(0.0, f64::max));
    Some(sweep)
}
