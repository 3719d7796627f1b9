//! What every candidate says of one sequence.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::time::Duration;

use evfocus_core::search::{Comparison, Reading, StructureMeasure, Travel, golden_search};
use evfocus_core::{
    Analyzer, CameraMicros, DelayModel, Failure, Flag, Geometry, LegReport, LensPosition, LensRange, Method,
    Question, Rules, Searcher, Sweep, SweepCapacity, SweepLimits, SweepRecorder, Window, event_rate,
};

use crate::dataset::{Label, Sequence, Way};
use crate::frames::Frames;
use crate::result::{Answer, Curve, EVENT_RATE, STRUCTURE, SequenceResult};
use crate::{Candidate, GreyImage, Operator, reconstruct};

/// The accumulation interval of the curve that is drawn of the event rate, microseconds.
const CURVE_INTERVAL_US: f64 = 55_000.0;
/// From one point of that curve to the next.
const CURVE_STEP_US: f64 = 10_000.0;
/// What `candidates` say of `sequence`: of its first two ways together, if the lens went both ways.
pub(super) fn ask(
    label: &Label,
    sequence: &Sequence,
    candidates: &[Candidate],
    delays: &DelayModel,
) -> SequenceResult {
    let ways = sequence.ways();
    let ways = ways.iter().take(2).map(|way| Asked::of(sequence.geometry, way, sequence.frames.as_ref()));
    let ways: Vec<Asked> = ways.collect();
    let mut answers = Vec::with_capacity(candidates.len());
    for &candidate in candidates {
        if !matches!(candidate, Candidate::OnFrames(_)) || sequence.frames.is_some() {
            answers.push(say(candidate, &ways, sequence, delays));
        }
    }
    let nearest = |position: f64| {
        sequence.truths.iter().map(|truth| (position - truth).abs()).fold(f64::INFINITY, f64::min)
    };
    let first = ways.into_iter().next().unwrap_or_default();
    SequenceResult {
        label: label.clone(),
        truths: sequence.truths.clone(),
        range: range_of(sequence).map_or(0.0, LensRange::length),
        events: sequence.events.len() as u64,
        answers,
        curves: first.curves,
        search_errors: first.steps.into_iter().map(nearest).collect(),
    }
}

fn range_of(sequence: &Sequence) -> Option<LensRange> {
    let (low, high) = sequence.trace.extent()?;
    LensRange::new(low, high).ok()
}

/// Learns what the pixels' delay was from a sweep both ways.
pub(super) fn teach(sequence: &Sequence, delays: &mut DelayModel) {
    let ways = sequence.ways();
    let ways: Vec<Asked> = ways.iter().take(2).map(|way| Asked::searched(sequence.geometry, way)).collect();
    let answer = by_core(Method::Auto, &ways, sequence, *delays);
    if let Some((noise_hz, delay)) = answer.ok().and_then(|answer| answer.measured) {
        delays.learn(noise_hz, delay.seconds, delay.uncertainty_s);
    }
}

fn say(candidate: Candidate, ways: &[Asked], sequence: &Sequence, delays: &DelayModel) -> Answer {
    let (method, delays) = match candidate {
        Candidate::Search(method) => (Some(method), DelayModel::default()),
        Candidate::Taught => (Some(Method::Auto), *delays),
        Candidate::OnEvents(_) | Candidate::OnFrames(_) | Candidate::FixedInterval(_) => (None, *delays),
    };
    if let Some(method) = method {
        return match by_core(method, ways, sequence, delays) {
            Ok(found) => Answer {
                second_depth: found.second_depth.map(|second| second.0),
                error_bar: found.error_bar,
                confidence: found.confidence,
                flags: found.flags.iter().map(|flag| Flag::name(flag).to_owned()).collect(),
                ..Answer::new(candidate, Ok(found.position.0), &sequence.truths)
            },
            Err(why) => Answer::new(candidate, Err(why), &sequence.truths),
        };
    }
    let said: Result<Vec<f64>, String> = ways.iter().map(|way| way.answer(candidate)).collect();
    let mean = said.and_then(|said| {
        let sum: f64 = said.iter().sum();
        if said.is_empty() { Err(String::from("the lens did not move")) } else { Ok(sum / said.len() as f64) }
    });
    Answer::new(candidate, mean, &sequence.truths)
}

/// The answer of the core by the rules of the daemon; what makes a sweep unfit is held against `auto` only, the others are to show what
/// they say of it.
fn by_core(
    method: Method,
    ways: &[Asked],
    sequence: &Sequence,
    delays: DelayModel,
) -> Result<evfocus_core::Answer, String> {
    let range = range_of(sequence).ok_or("the lens did not move")?;
    let rules = Rules { delays, ..Rules::for_range(range) };
    if method == Method::Auto {
        for way in ways {
            if let Err(failure) = way.verdict
                && failure.is_final(ways.len())
            {
                return Err(failure.to_string());
            }
        }
    }
    let reports: Vec<&LegReport> = ways.iter().filter_map(|way| way.report.as_ref()).collect();
    let first = reports.first().ok_or("no events while the lens moved")?;
    evfocus_core::answer(first, reports.get(1).copied(), method, &rules)
        .map_err(|failure| failure.to_string())
}

/// What was found out about one way of the lens.
#[derive(Debug)]
struct Asked {
    said: BTreeMap<String, Result<f64, String>>,
    report: Option<LegReport>,
    verdict: Result<(), Failure>,
    curves: Vec<Curve>,
    steps: Vec<f64>,
}

impl Default for Asked {
    fn default() -> Self {
        Self { said: BTreeMap::new(), report: None, verdict: Ok(()), curves: Vec::new(), steps: Vec::new() }
    }
}

impl Asked {
    fn of(geometry: Geometry, way: &Way<'_>, frames: Option<&Frames>) -> Self {
        let mut asked = Self::default();
        let mut on_events = OperatorCurves::default();
        reconstruct::pictures(geometry, way.events, |time, picture| on_events.see(way, time, picture));
        asked.take(on_events, Candidate::OnEvents);
        if let Some(frames) = frames {
            let mut on_frames = OperatorCurves::default();
            for (time, picture) in frames.iter().filter(|(time, _)| (way.start..=way.end).contains(time)) {
                on_frames.see(way, time, &picture);
            }
            asked.take(on_frames, Candidate::OnFrames);
        }
        asked.search(geometry, way);
        asked
    }

    /// Without the operators on pictures.
    fn searched(geometry: Geometry, way: &Way<'_>) -> Self {
        let mut asked = Self::default();
        asked.search(geometry, way);
        asked
    }

    fn take(&mut self, curves: OperatorCurves, candidate: fn(Operator) -> Candidate) {
        for (operator, points) in curves.0 {
            let method = candidate(operator).to_string();
            // The first of equals, as the paper's Algorithm 1 has it.
            let best =
                points.iter().copied().reduce(|best, point| if point.1 > best.1 { point } else { best });
            let said = best.map(|(position, _)| position).ok_or_else(|| String::from("no pictures"));
            self.said.insert(method.clone(), said);
            self.curves.push(Curve { method, points });
        }
    }

    fn search(&mut self, geometry: Geometry, way: &Way<'_>) {
        let capacity = SweepCapacity { events: way.events.len(), ..SweepCapacity::default() };
        let mut recorder = SweepRecorder::new(geometry, capacity);
        recorder.start(way.start);
        recorder.feed(way.events);
        recorder.advance_to(way.end);
        let question = Question {
            method: Method::Auto,
            interval: Duration::from_millis(55),
            limits: SweepLimits::default(),
            ask_all: true,
        };
        let mut report = LegReport::empty();
        self.verdict = Analyzer::new(geometry).analyze(&recorder, &way.trace, question, &mut report);
        self.report = Some(report);
        let Some(sweep) = recorder.sweep(&way.trace) else { return };
        let mut searcher = Searcher::new(geometry);
        for candidate in Candidate::searches() {
            if let Candidate::FixedInterval(milliseconds) = candidate {
                let said = searcher.search(Method::ErFixed, &sweep, Duration::from_millis(milliseconds));
                let said = said.map(|said| said.position.0).map_err(|error| error.to_string());
                self.said.insert(candidate.to_string(), said);
            }
        }
        self.steps = search_steps(&sweep);
        self.curves.push(rate_curve(&sweep));
        self.curves.extend(structure_curve(geometry, &sweep));
    }

    fn answer(&self, candidate: Candidate) -> Result<f64, String> {
        let said = self.said.get(&candidate.to_string()).cloned();
        said.unwrap_or_else(|| Err(String::from("no events while the lens moved")))
    }
}

/// The curve of every operator.
#[derive(Default)]
struct OperatorCurves(BTreeMap<Operator, Vec<(f64, f64)>>);

impl OperatorCurves {
    fn see(&mut self, way: &Way<'_>, time: CameraMicros, picture: &GreyImage) {
        let Some(position) = way.trace.position_near(time.0 as f64) else { return };
        let side = picture.width().min(picture.height());
        for operator in Operator::ALL.into_iter().filter(|operator| side >= operator.smallest_side()) {
            self.0.entry(operator).or_default().push((position.0, operator.value(picture)));
        }
    }
}

/// The middle of the golden search's range before its first comparison and after each one, as lens positions.
fn search_steps(sweep: &Sweep<'_>) -> Vec<f64> {
    let mut middles = Vec::new();
    let range = (sweep.start.0 as f64, sweep.end.0 as f64);
    let searched = golden_search(range, |first, second| {
        middles.push(f64::midpoint(first.0, second.1));
        let rate =
            |window: (f64, f64)| event_rate(sweep.counter, window.0, window.1).map_or(0.0, |rate| rate.0);
        Ok::<_, Infallible>(if rate(first) >= rate(second) { Comparison::First } else { Comparison::Second })
    });
    let Ok((left, _)) = searched;
    middles.push(f64::midpoint(left.0, left.1));
    let position = |middle| sweep.position_at(middle).ok().map(|LensPosition(position)| position);
    middles.into_iter().filter_map(position).collect()
}

fn rate_curve(sweep: &Sweep<'_>) -> Curve {
    let mut points = Vec::new();
    let mut from = sweep.start.0 as f64;
    while from + CURVE_INTERVAL_US <= sweep.end.0 as f64 {
        let rate = event_rate(sweep.counter, from, from + CURVE_INTERVAL_US);
        if let (Ok(rate), Ok(position)) = (rate, sweep.position_at(from + CURVE_INTERVAL_US / 2.0)) {
            points.push((position.0, rate.0));
        }
        from += CURVE_STEP_US;
    }
    Curve { method: String::from(EVENT_RATE), points }
}

fn structure_curve(geometry: Geometry, sweep: &Sweep<'_>) -> Option<Curve> {
    let travel = Travel::of(sweep).ok()?;
    let mut measure = StructureMeasure::new(Window::whole(geometry));
    measure.begin(travel);
    measure.take(sweep.store, sweep.trace, sweep.end, |_| {});
    measure.read(Reading::FIRST)?;
    let points = measure.curve().iter().enumerate();
    // Each point holds what happened up to the end of its bin.
    let points = points.map(|(bin, &energy)| (travel.position_of(bin as f64 + 1.0).0, energy)).collect();
    Some(Curve { method: String::from(STRUCTURE), points })
}
