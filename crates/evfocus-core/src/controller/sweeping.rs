//! What the controller gathers during a sweep, and the search in it.

use alloc::vec::Vec;
use core::time::Duration;

use super::ControllerConfig;
use crate::analysis::{Analyzer, Question, describe};
use crate::clock_map::ClockMap;
use crate::curve::CurvePoint;
use crate::event::{EventBatch, Geometry};
use crate::event_list::Events;
use crate::hot_pixels::HotPixels;
use crate::lens_trace::{LensSample, LensTrace};
use crate::measure::event_rate;
use crate::report::{Failure, FocusPlan, LegReport, Windows};
use crate::search::Travel;
use crate::sweep::SweepRecorder;
use crate::units::{CameraMicros, HostMicros};

/// Camera time from one point of the live curve to the next, microseconds: what an eye can follow.
const LIVE_STEP_US: i64 = 20_000;
/// Points of the live curve: the longest sweep that can be configured, 120 s.
const LIVE_POINTS: usize = 6_000;
/// Camera time between two looks whether a sweep may end.
const LOOK_EVERY: Duration = Duration::from_millis(10);

#[derive(Debug)]
pub(super) struct SweepState {
    recorder: SweepRecorder,
    analyzer: Analyzer,
    hot_pixels: HotPixels,
    camera_trace: LensTrace<CameraMicros>,
    began: HostMicros,
    longest: Duration,
    origin: CameraMicros,
    end: Option<CameraMicros>,
    lost: u64,
    live_curve: Vec<CurvePoint>,
    live_until: CameraMicros,
    /// Camera time at which it is looked next whether the sweep may end.
    next_look: CameraMicros,
}

impl SweepState {
    pub(super) fn new(geometry: Geometry, config: &ControllerConfig) -> Self {
        Self {
            recorder: SweepRecorder::new(geometry, config.capacity),
            analyzer: Analyzer::new(geometry),
            hot_pixels: HotPixels::new(geometry),
            camera_trace: LensTrace::with_capacity(config.lens_samples),
            began: HostMicros(0),
            longest: config.capacity.longest,
            origin: CameraMicros(0),
            end: None,
            lost: 0,
            live_curve: Vec::with_capacity(LIVE_POINTS),
            live_until: CameraMicros(0),
            next_look: CameraMicros(0),
        }
    }

    /// Forgets the run before.
    pub(super) fn forget(&mut self) {
        self.live_curve.clear();
        self.hot_pixels.restart();
    }

    pub(super) fn set_windows(&mut self, windows: &Windows) {
        self.analyzer.set_windows(windows.iter().flatten().copied());
    }

    pub(super) fn begin_rest(&mut self) {
        self.hot_pixels.restart();
        self.analyzer.begin_rest();
    }

    pub(super) fn observe_rest(&mut self, events: Events<'_>) {
        self.hot_pixels.observe(events);
        self.analyzer.observe_rest(events);
    }

    pub(super) fn end_rest(&mut self, duration: Duration) {
        self.hot_pixels.learn(duration);
        self.analyzer.end_rest();
    }

    pub(super) fn hot_pixels(&self) -> usize {
        self.hot_pixels.number()
    }

    /// Begins to count at `origin`; `sample` is the lens at rest where the sweep starts, `travel` its way.
    pub(super) fn begin(
        &mut self,
        origin: CameraMicros,
        sample: &LensSample,
        travel: Option<Travel>,
        clock: &ClockMap,
        now: HostMicros,
    ) {
        if let Some(travel) = travel {
            self.analyzer.begin(travel);
        }
        self.recorder.start(origin);
        self.camera_trace.clear();
        self.next_look = origin;
        self.began = now;
        self.origin = origin;
        self.end = None;
        self.lost = 0;
        self.live_curve.clear();
        self.live_until = origin;
        self.add_lens(sample, clock);
    }

    /// No events after `end` belong to the sweep.
    pub(super) fn end(&mut self, end: CameraMicros) {
        self.end = Some(end);
    }

    /// Whether all events up to the end are counted.
    pub(super) fn is_complete(&self, clock: &ClockMap) -> bool {
        matches!((self.end, clock.newest()), (Some(end), Some(newest)) if newest >= end)
    }

    pub(super) fn is_too_long(&self, now: HostMicros) -> bool {
        now.since(self.began) > self.longest
    }

    /// Takes a word of the lens, in camera time by what `clock` knows now: the map creeps by microseconds during a sweep, in which a
    /// lens goes hundredths of a count.
    pub(super) fn add_lens(&mut self, sample: &LensSample, clock: &ClockMap) {
        if let Ok(time) = clock.to_camera(sample.time()) {
            self.camera_trace.push_if_later(time, sample.position);
            self.analyzer.take(&self.recorder, &self.camera_trace);
        }
    }

    /// Whether the lens is far enough beyond the peak. Looks every 10 ms of camera time: each look costs as much as thousands of events.
    pub(super) fn has_passed_peak(&mut self) -> bool {
        let Some((newest, _)) = self.camera_trace.last() else { return false };
        if newest < self.next_look {
            return false;
        }
        self.next_look = newest + LOOK_EVERY;
        self.analyzer.has_passed_peak()
    }

    /// Counts what belongs to the sweep: events since its origin, before its end, of pixels that are not hot.
    pub(super) fn feed(&mut self, batch: &EventBatch, reached: CameraMicros) {
        let events = batch.events.as_slice();
        let from = events.first_at_or_after(self.origin);
        let to = self.end.map_or(events.len(), |end| events.first_at_or_after(end));
        let hot_pixels = &self.hot_pixels;
        for run in events.range(from..to).split(|event| hot_pixels.is_hot(event)) {
            self.recorder.feed(run);
        }
        self.recorder.advance_to(reached);
        self.lost += batch.lost;
    }

    pub(super) fn live_curve(&self) -> &[CurvePoint] {
        &self.live_curve
    }

    /// Adds a point to the live curve for every whole step that has been counted.
    pub(super) fn extend_live_curve(&mut self, reached: CameraMicros) {
        // After a leap in time, only what the counter still holds: the effort stays bounded whatever the camera says.
        self.live_until = self.live_until.max(self.recorder.counter().oldest());
        while reached.micros_since(self.live_until) >= LIVE_STEP_US && self.live_curve.len() < LIVE_POINTS {
            let (from, to) = (self.live_until.0, self.live_until.0 + LIVE_STEP_US);
            self.live_until = CameraMicros(to);
            let middle = CameraMicros(i64::midpoint(from, to));
            let position = self.camera_trace.position_near(middle.0 as f64);
            let rate = event_rate(self.recorder.counter(), from as f64, to as f64);
            if let (Some(position), Ok(rate)) = (position, rate) {
                self.live_curve.push(CurvePoint { t_us: middle.0 as f64, position, rate });
            }
        }
    }

    /// Searches the sweep and writes what was found into `report`.
    pub(super) fn search(
        &mut self,
        plan: &FocusPlan,
        config: &ControllerConfig,
        report: &mut LegReport,
    ) -> Result<(), Failure> {
        report.lost = self.lost;
        let question = Question {
            method: plan.method,
            interval: plan.interval,
            limits: config.sweep_limits,
            ask_all: false,
        };
        self.analyzer.analyze(&self.recorder, &self.camera_trace, question, report)
    }

    /// Writes what has been counted of a sweep that is not searched into `report`.
    pub(super) fn report_unfinished(&mut self, report: &mut LegReport) {
        report.lost = self.lost;
        describe(&self.recorder, &self.camera_trace, report);
    }
}
