//! The second pass: the events of each sweep through the recorder and the analyzer that the daemon uses.

use std::time::Duration;

use evfocus_core::{
    Analyzer, EventBatch, Events, Geometry, HotPixels, LegReport, Question, SweepCapacity, SweepLimits,
    SweepRecorder, Windows,
};
use evfocus_record::{MAX_EVENTS_PER_READ, Recording};

use super::legs::SweepLeg;
use super::{Request, SweepAnalysis};

/// Events kept at most, 8 bytes each: half a gigabyte. Methods that need more say so; `egs` needs none.
const MOST_EVENTS_KEPT: u64 = 1 << 26;
/// Room in the counter beyond the longest sweep.
const SPARE: Duration = Duration::from_millis(100);

/// Analyzes each of `legs`, which are in the order of time.
pub(super) fn analyze_sweeps(
    request: &Request,
    geometry: Geometry,
    windows: &Windows,
    events: u64,
    legs: &[SweepLeg],
) -> anyhow::Result<Vec<SweepAnalysis>> {
    let longest = legs.iter().map(|leg| leg.end.since(leg.start)).max().unwrap_or_default() + SPARE;
    let capacity =
        SweepCapacity { longest, events: events.min(MOST_EVENTS_KEPT) as usize, ..SweepCapacity::default() };
    let mut recording = Recording::open(&request.recording, request.format)?;
    let mut batch = EventBatch::with_capacity(MAX_EVENTS_PER_READ);
    let mut stage = Stage {
        recorder: SweepRecorder::new(geometry, capacity),
        analyzer: Analyzer::new(geometry),
        hot_pixels: HotPixels::new(geometry),
        hot_pixels_learnt: false,
        lost: 0,
        started: false,
    };
    stage.analyzer.set_windows(windows.iter().flatten().copied());
    let mut waiting = legs.iter();
    let mut current = waiting.next();
    let mut sweeps = Vec::with_capacity(legs.len());
    while let Some(leg) = current {
        if !recording.read(&mut batch)? {
            break;
        }
        stage.lost += batch.lost;
        let mut events = batch.events.as_slice();
        let mut leg = leg;
        while let Some(after) = stage.feed(leg, events) {
            events = after;
            sweeps.push(stage.finish(leg, request));
            current = waiting.next();
            match current {
                Some(next) => leg = next,
                None => break,
            }
        }
    }
    for leg in current.into_iter().chain(waiting) {
        stage.start(leg);
        sweeps.push(stage.finish(leg, request));
    }
    Ok(sweeps)
}

/// What one sweep after the other goes through.
struct Stage {
    recorder: SweepRecorder,
    analyzer: Analyzer,
    hot_pixels: HotPixels,
    hot_pixels_learnt: bool,
    lost: u64,
    started: bool,
}

impl Stage {
    /// Takes the events of `leg` out of `events`; returns those after it once there are any.
    fn feed<'a>(&mut self, leg: &SweepLeg, events: Events<'a>) -> Option<Events<'a>> {
        // Not a binary search: a few events of a damaged recording may be out of order.
        let starts = events.iter().position(|event| event.t >= leg.start).unwrap_or(events.len());
        let (before, from_start) = (events.range(0..starts), events.from(starts));
        if !self.started
            && !self.hot_pixels_learnt
            && let Some(since) = leg.rest_since
        {
            let rested = before.iter().position(|event| event.t >= since).unwrap_or(before.len());
            self.hot_pixels.observe(before.from(rested));
        }
        if from_start.is_empty() {
            return None;
        }
        self.start(leg);
        let ends = from_start.iter().position(|event| event.t >= leg.end);
        let inside = from_start.range(0..ends.unwrap_or(from_start.len()));
        let hot_pixels = &self.hot_pixels;
        for run in inside.split(|event| hot_pixels.is_hot(event)) {
            self.recorder.feed(run);
        }
        ends.map(|ends| from_start.from(ends))
    }

    fn start(&mut self, leg: &SweepLeg) {
        if self.started {
            return;
        }
        // Once, as the controller does: pixels that were hot before the first sweep stay so.
        if let Some(since) = leg.rest_since.filter(|_| !self.hot_pixels_learnt) {
            self.hot_pixels.learn(leg.start.since(since));
            self.hot_pixels_learnt = true;
        }
        self.recorder.start(leg.start);
        self.started = true;
    }

    fn finish(&mut self, leg: &SweepLeg, request: &Request) -> SweepAnalysis {
        self.recorder.advance_to(leg.end);
        let mut report = LegReport { lost: std::mem::take(&mut self.lost), ..LegReport::empty() };
        let verdict = self.analyzer.analyze(
            &self.recorder,
            &leg.trace,
            Question {
                method: request.method,
                interval: request.interval,
                limits: SweepLimits::default(),
                ask_all: true,
            },
            &mut report,
        );
        self.started = false;
        SweepAnalysis {
            direction: leg.direction,
            speed: leg.speed,
            trace: leg.trace.clone(),
            report,
            hot_pixels: self.hot_pixels.number(),
            verdict,
        }
    }
}
