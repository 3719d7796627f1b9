//! What a sweep says, and whether to believe it: the same code for a live run and for a recording.

use core::time::Duration;

use crate::event::{Geometry, Window};
use crate::event_list::Events;
use crate::lens_trace::LensTrace;
use crate::quality::SweepQuality;
use crate::report::{Failure, LegReport};
use crate::search::{Method, Searcher, StructureAnswer, Travel};
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

/// What is asked of a sweep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Question {
    /// The estimator that decides.
    pub method: Method,
    /// Accumulation interval of [`Method::ErFixed`].
    pub interval: Duration,
    /// What the sweep must hold.
    pub limits: SweepLimits,
    /// Whether every estimator is asked, whatever it costs; otherwise those that go beside `method`.
    pub ask_all: bool,
}

impl Question {
    /// Beside a measure that reads every event the others of its kind cost little more; beside the others they would be most of the
    /// cost. The squared event rate runs only when asked for.
    fn asks(&self, other: Method) -> bool {
        let is_deciding = self.method == other;
        match other {
            Method::Egs | Method::EgsOfficial | Method::ErFixed => true,
            Method::Structure | Method::MirrorPairs => {
                self.ask_all || is_deciding || self.method.reads_every_event()
            }
            Method::ErSquared => self.ask_all || is_deciding,
            Method::Auto => is_deciding,
        }
    }
}

/// Analyzes sweeps. All memory is allocated at the start, but for that of windows.
#[derive(Debug, Clone)]
pub struct Analyzer {
    searcher: Searcher,
    has_begun: bool,
}

impl Analyzer {
    /// An analyzer for sweeps of sensors of `geometry`.
    pub fn new(geometry: Geometry) -> Self {
        Self { searcher: Searcher::new(geometry), has_begun: false }
    }

    /// Looks at these windows of the picture too; the first [`MOST_WINDOWS`](crate::search::MOST_WINDOWS) count.
    pub fn set_windows(&mut self, windows: impl Iterator<Item = Window> + Clone) {
        self.searcher.structure().set_windows(windows);
    }

    /// The lens has come to rest before its sweep; what was seen before is forgotten.
    pub fn begin_rest(&mut self) {
        self.searcher.structure().begin_rest();
    }

    /// Takes events made while the lens rests.
    pub fn observe_rest(&mut self, events: Events<'_>) {
        self.searcher.structure().observe_rest(events);
    }

    /// The rest is over.
    pub fn end_rest(&mut self) {
        self.searcher.structure().end_rest();
    }

    /// Begins to take the events of a sweep along `travel` as they come, so that little is left to do at its end.
    pub fn begin(&mut self, travel: Travel) {
        self.searcher.begin(travel);
        self.has_begun = true;
    }

    /// Takes the events of `recorder` up to the newest position of `trace`.
    pub fn take(&mut self, recorder: &SweepRecorder, trace: &LensTrace<CameraMicros>) {
        if let (true, Some((newest, _))) = (self.has_begun, trace.last()) {
            self.searcher.take(recorder.store(), trace, newest);
        }
    }

    /// Whether the lens has gone far enough beyond the peak that the answer will not change any more; always `false` for a sweep that
    /// was not begun.
    pub fn has_passed_peak(&mut self) -> bool {
        self.has_begun && self.searcher.structure().has_passed_peak()
    }

    /// Writes what `recorder` counted and what every estimator says of it into `report`, whose `lost` is given.
    ///
    /// # Errors
    /// The [`Failure`] that makes the sweep unfit to find focus with. The report holds what was seen all the same.
    pub fn analyze(
        &mut self,
        recorder: &SweepRecorder,
        trace: &LensTrace<CameraMicros>,
        question: Question,
        report: &mut LegReport,
    ) -> Result<(), Failure> {
        let has_begun = core::mem::take(&mut self.has_begun);
        let limits = question.limits;
        let sweep = describe(recorder, trace, report);
        let counted = report.on + report.off;
        let too_few = Failure::TooFewEvents { events: counted, needed: limits.fewest_events };
        if counted < limits.fewest_events {
            return Err(too_few);
        }
        let sweep = sweep.ok_or(too_few)?;
        let quality = SweepQuality::of(&sweep).map_err(|error| Failure::NoAnswer(error.into()))?;
        report.quality = quality;
        if question.asks(Method::Structure) || question.asks(Method::MirrorPairs) {
            if !has_begun {
                self.searcher.begin(Travel::of(&sweep).map_err(Failure::NoAnswer)?);
            }
            if question.asks(Method::Structure) {
                self.ask_structure(&sweep, report);
            }
        }
        for other in Method::ALL.into_iter().filter(|&other| question.asks(other)) {
            let said = match other {
                Method::Structure | Method::Auto => report
                    .structure
                    .map(|said| said.and_then(StructureAnswer::significant).map(|answer| answer.estimate())),
                Method::MirrorPairs => Some(self.searcher.mirror_pairs(&sweep)),
                Method::Egs | Method::EgsOfficial | Method::ErFixed | Method::ErSquared => {
                    Some(self.searcher.search(other, &sweep, question.interval))
                }
            };
            if let Some(place) = report.estimates.get_mut(other as usize) {
                *place = said;
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
        let is_windowed = report.windows.iter().any(Option::is_some);
        match report.estimate(question.method) {
            Some(Err(error)) if !is_windowed => Err(Failure::of_search(error)),
            Some(_) | None => Ok(()),
        }
    }

    fn ask_structure(&mut self, sweep: &Sweep<'_>, report: &mut LegReport) {
        let structure = self.searcher.structure();
        report.structure = Some(structure.answer(sweep));
        let mut answers = structure.window_answers(sweep);
        for place in &mut report.windows {
            *place = answers.next();
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
