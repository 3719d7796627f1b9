//! The arrows of a focus run.

use alloc::vec::Vec;
use core::time::Duration;

use super::motion::Motion;
use super::{APPROACHES, Action, Controller, FocusState, OnFailure, State};
use crate::answer::{combine, is_at_edge};
use crate::lens_trace::LensSample;
use crate::report::{Directions, Failure, FocusPlan, LegReport, Outcome, Phase, RunId, RunReport};
use crate::units::{HostMicros, LensPosition, LensSpeed};

/// How far the link may be behind at the end of a sweep; a camera that is silent is given up sooner.
const LINK_BACKLOG: Duration = Duration::from_secs(10);

/// What belongs to the run under way.
#[derive(Debug)]
pub(super) struct Run {
    pub(super) id: RunId,
    pub(super) plan: FocusPlan,
    started: HostMicros,
    pub(super) position_before: LensPosition,
    pub(super) legs: [Option<LegReport>; 2],
    /// Reports waiting for their sweep, so that none is allocated between its start and its result.
    spare: [Option<LegReport>; 2],
    delay_us: Option<f64>,
    phase_since: HostMicros,
    phases: [Duration; Phase::ALL.len()],
}

impl Run {
    pub(super) fn new(id: RunId, plan: FocusPlan, position_before: LensPosition, now: HostMicros) -> Self {
        Self {
            id,
            plan,
            started: now,
            position_before,
            legs: [None, None],
            spare: [Some(LegReport::empty()), Some(LegReport::empty())],
            delay_us: None,
            phase_since: now,
            phases: [Duration::ZERO; Phase::ALL.len()],
        }
    }

    fn leave_phase(&mut self, phase: Option<Phase>, now: HostMicros) {
        if let Some(spent) = phase.and_then(|phase| self.phases.get_mut(phase as usize)) {
            *spent += now.since(self.phase_since);
        }
        self.phase_since = now;
    }

    /// Where the sweep of `leg` begins and ends.
    fn ends(&self, leg: usize) -> (LensPosition, LensPosition) {
        let range = self.plan.range;
        if leg == 0 { (range.min(), range.max()) } else { (range.max(), range.min()) }
    }

    /// The answer of the sweeps made, or why there is none.
    fn answer(&mut self, largest_mismatch_share: f64) -> Result<LensPosition, Failure> {
        let estimate_of = |leg: &LegReport| match leg.estimate(self.plan.method) {
            Some(Ok(estimate)) => Ok(estimate.position),
            Some(Err(error)) => Err(Failure::NoAnswer(error)),
            None => Err(Failure::NoAnswer(crate::SearchError::NoLength { at_us: leg.start.0 })),
        };
        let [Some(first), second] = &self.legs else {
            return Err(Failure::TooFewEvents { events: 0, needed: 1 });
        };
        let forward = estimate_of(first)?;
        let Some(second) = second else { return Ok(forward) };
        let combined = combine(forward, estimate_of(second)?, self.plan.range, largest_mismatch_share)?;
        self.delay_us = Some(combined.half_difference / self.plan.speed.counts_per_second() * 1e6);
        Ok(combined.position)
    }
}

impl Controller {
    /// Every change of state goes through here, so that the time of each phase is kept.
    pub(super) fn enter(&mut self, state: State, now: HostMicros) {
        let phase = self.phase();
        if let Some(run) = &mut self.run {
            run.leave_phase(phase, now);
        }
        self.state = state;
    }

    pub(super) fn start_motion(
        &mut self,
        target: LensPosition,
        speed: LensSpeed,
        now: HostMicros,
        actions: &mut Vec<Action>,
    ) -> Motion {
        actions.push(Action::MoveLens { target, speed });
        let from = self.lens.map_or(target, |sample| sample.position);
        Motion::new(from, target, speed, now, &self.config)
    }

    pub(super) fn go_to_start(&mut self, now: HostMicros, actions: &mut Vec<Action>) {
        let Some((start, _)) = self.run.as_ref().map(|run| run.ends(0)) else { return };
        let motion = self.start_motion(start, self.config.max_speed, now, actions);
        self.enter(State::ToStart(motion), now);
    }

    pub(super) fn begin_sweep(&mut self, leg: usize, now: HostMicros, actions: &mut Vec<Action>) {
        let Some((end, speed)) = self.run.as_ref().map(|run| (run.ends(leg).1, run.plan.speed)) else {
            return;
        };
        // Rest and silence checks have seen camera time, so the clock map can answer.
        let (Ok(origin), Some(sample)) = (self.clock.to_camera(now), self.lens) else {
            self.fail(Failure::CameraSilent, now, actions);
            return;
        };
        self.sweep.begin(origin, &sample, now);
        let motion = self.start_motion(end, speed, now, actions);
        self.enter(State::Sweeping { leg, motion }, now);
    }

    /// The lens has arrived: the events up to now are still on their way.
    pub(super) fn drain(
        &mut self,
        leg: usize,
        last: &LensSample,
        now: HostMicros,
        actions: &mut Vec<Action>,
    ) {
        let Ok(end) = self.clock.to_camera(last.time()) else {
            self.fail(Failure::ClockUnusable, now, actions);
            return;
        };
        self.sweep.end(end);
        let deadline = now + LINK_BACKLOG;
        self.enter(State::Draining { leg, deadline }, now);
    }

    pub(super) fn search(&mut self, leg: usize, now: HostMicros, actions: &mut Vec<Action>) {
        let Some(run) = &mut self.run else { return };
        let Some(mut report) = run.spare.get_mut(leg).and_then(Option::take) else { return };
        let clock = self.clock.quality();
        let mut verdict = self.sweep.search(&run.plan, &self.config, &self.clock, &mut report);
        if clock.residual_us > self.config.largest_clock_residual.as_micros() as f64 {
            verdict = Err(Failure::ClockUnusable);
        }
        if let Some(place) = run.legs.get_mut(leg) {
            *place = Some(report);
        }
        let directions = run.plan.directions;
        match (verdict, leg, directions) {
            (Err(failure), _, _) => self.fail(failure, now, actions),
            (Ok(()), 0, Directions::Both) => self.begin_sweep(1, now, actions),
            (Ok(()), _, _) => self.decide(now, actions),
        }
    }

    fn decide(&mut self, now: HostMicros, actions: &mut Vec<Action>) {
        let Some(run) = &mut self.run else { return };
        let range = run.plan.range;
        match run.answer(self.config.largest_mismatch_share) {
            Err(failure) => self.fail(failure, now, actions),
            Ok(answer) => {
                if is_at_edge(answer, range, self.config.edge_share) {
                    self.fail(Failure::PeakAtEdge { position: answer }, now, actions);
                } else {
                    self.approach(answer, 1, now, actions);
                }
            }
        }
    }

    /// A sweep that ends before its time leaves what it has counted in the report.
    pub(super) fn keep_unfinished_sweep(&mut self) {
        let (State::Sweeping { leg, .. } | State::Draining { leg, .. }) = self.state else { return };
        let Some(run) = &mut self.run else { return };
        if let (Some(mut report), Some(place)) =
            (run.spare.get_mut(leg).and_then(Option::take), run.legs.get_mut(leg))
        {
            self.sweep.report_unfinished(&self.clock, &mut report);
            *place = Some(report);
        }
    }

    /// Goes to `answer` in the direction of the first sweep, from far enough before it that backlash is taken up.
    fn approach(&mut self, answer: LensPosition, attempt: u32, now: HostMicros, actions: &mut Vec<Action>) {
        let before = self.config.limits.clamp(LensPosition(answer.0 - self.config.approach_margin));
        let is_before =
            self.lens.is_some_and(|sample| sample.position.0 <= before.0 + self.config.position_tolerance);
        if is_before {
            self.approach_finally(answer, attempt, now, actions);
        } else {
            let motion = self.start_motion(before, self.config.max_speed, now, actions);
            self.enter(State::Approaching { motion, answer, attempt, run_up: true }, now);
        }
    }

    pub(super) fn approach_finally(
        &mut self,
        answer: LensPosition,
        attempt: u32,
        now: HostMicros,
        actions: &mut Vec<Action>,
    ) {
        let motion = self.start_motion(answer, self.config.max_speed, now, actions);
        self.enter(State::Approaching { motion, answer, attempt, run_up: false }, now);
    }

    pub(super) fn verify(
        &mut self,
        answer: LensPosition,
        attempt: u32,
        now: HostMicros,
        actions: &mut Vec<Action>,
    ) {
        let Some(sample) = self.lens else { return };
        if sample.position.distance(answer) <= self.config.position_tolerance {
            self.finish(Outcome::Focused { position: answer }, now, actions);
        } else if attempt < APPROACHES {
            self.approach(answer, attempt + 1, now, actions);
        } else if sample.position > answer {
            self.fail(Failure::LensOvershoot, now, actions);
        } else {
            self.fail(Failure::LensStoppedShort, now, actions);
        }
    }

    /// A device failed: that ends a run, or a motion.
    pub(super) fn on_failure(&mut self, failure: Failure, now: HostMicros, actions: &mut Vec<Action>) {
        if self.run.is_some() {
            self.fail(failure, now, actions);
        } else if failure.is_of_lens() && self.state != State::Idle {
            self.give_up_motion(now, actions);
        }
    }

    pub(super) fn give_up_motion(&mut self, now: HostMicros, actions: &mut Vec<Action>) {
        actions.push(Action::StopLens);
        self.enter(State::Idle, now);
    }

    /// Ends the run without focus: the lens goes back to where it was, or stops if it is the lens that failed.
    pub(super) fn fail(&mut self, failure: Failure, now: HostMicros, actions: &mut Vec<Action>) {
        let Some(before) = self.run.as_ref().map(|run| run.position_before) else { return };
        // A failure on the way back does not hide the first one. The lens just stops; for the camera it is too late to matter.
        if let State::Restoring { failure: first, .. } = self.state {
            if failure.is_of_lens() {
                actions.push(Action::StopLens);
                self.finish(Outcome::Failed(first), now, actions);
            }
            return;
        }
        self.keep_unfinished_sweep();
        let go_back = self.config.on_failure == OnFailure::Restore
            && !failure.is_of_lens()
            && !matches!(failure, Failure::TimedOut(_))
            && self.lens_ready
            && self.homed
            && self.config.limits.contains(before);
        if go_back {
            let motion = self.start_motion(before, self.config.max_speed, now, actions);
            self.enter(State::Restoring { motion, failure }, now);
        } else {
            actions.push(Action::StopLens);
            self.finish(Outcome::Failed(failure), now, actions);
        }
    }

    pub(super) fn finish(&mut self, outcome: Outcome, now: HostMicros, actions: &mut Vec<Action>) {
        self.enter(State::Idle, now);
        self.outcome = match outcome {
            Outcome::Focused { .. } => FocusState::Focused,
            Outcome::Failed(_) => FocusState::Failed,
            Outcome::Aborted => FocusState::Idle,
        };
        let Some(run) = self.run.take() else { return };
        self.report = Some(RunReport {
            id: run.id,
            plan: run.plan,
            started: run.started,
            ended: now,
            position_before: run.position_before,
            position_after: self.lens.map_or(run.position_before, |sample| sample.position),
            outcome,
            legs: run.legs,
            delay_us: run.delay_us,
            hot_pixels: self.sweep.hot_pixels(),
            clock: self.clock.quality(),
            phases: run.phases,
        });
        actions.push(Action::RunEnded);
    }
}
