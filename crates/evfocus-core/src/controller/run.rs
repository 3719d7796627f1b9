//! The arrows of a focus run.

use alloc::vec::Vec;
use core::time::Duration;

use super::motion::Motion;
use super::{APPROACHES, Action, Controller, FocusState, OnFailure, State};
use crate::answer::{Answer, answer};
use crate::delay::DelayModel;
use crate::flags::Flag;
use crate::lens_trace::LensSample;
use crate::report::{Directions, Failure, FocusPlan, LegReport, Outcome, Phase, RunId, RunReport};
use crate::search::{Method, Travel};
use crate::units::{HostMicros, LensPosition, LensRange, LensSpeed};

/// How far the link may be behind at the end of a sweep; a camera that is silent is given up sooner.
const LINK_BACKLOG: Duration = Duration::from_secs(10);

/// How often the range may be extended in one run.
const MOST_EXTENSIONS: u32 = 3;
/// An extension that the limits leave less than this part of is not worth a sweep.
const LEAST_EXTENSION: f64 = 0.2;
/// Delay for which the way back leaves room.
const LONGEST_DELAY_S: f64 = 0.05;
/// One way is enough for an answer of this confidence,
const SURE: f64 = 0.9;
/// on a rig whose delay was never measured only if its pixels have light: they make less noise than this, and what they have in common holds.
const LEAST_NOISE_HZ: f64 = 0.02;

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
    /// The pixels' delay as known before the run.
    delays: DelayModel,
    answer: Option<Answer>,
    /// How far back the second sweep must go.
    enough: Option<LensPosition>,
    extensions: u32,
    phase_since: HostMicros,
    phases: [Duration; Phase::ALL.len()],
}

impl Run {
    pub(super) fn new(
        id: RunId,
        plan: FocusPlan,
        delays: DelayModel,
        position_before: LensPosition,
        now: HostMicros,
    ) -> Self {
        Self {
            id,
            plan,
            started: now,
            position_before,
            legs: [None, None],
            spare: [Some(LegReport::empty()), Some(LegReport::empty())],
            delays,
            answer: None,
            enough: None,
            extensions: 0,
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

    /// Half the difference of the two directions as a time.
    fn delay_us(&self) -> Option<f64> {
        let half_difference = self.answer.and_then(|found| found.half_difference)?;
        Some(half_difference / self.plan.speed.counts_per_second() * 1e6)
    }

    /// Forgets the sweeps made, for others over `range`.
    fn extend(&mut self, range: LensRange) {
        self.plan.range = range;
        self.extensions += 1;
        self.enough = None;
        self.legs = [None, None];
        self.spare = [Some(LegReport::empty()), Some(LegReport::empty())];
    }

    /// Where the sweep of `leg` ends. The way back is over once it is one width past the peak, if it may end early.
    fn end(&self, leg: usize) -> LensPosition {
        let range = self.plan.range;
        match (leg, self.enough) {
            (0, _) => range.max(),
            (_, Some(enough)) if self.plan.early_stop => range.clamp(enough),
            (_, _) => range.min(),
        }
    }

    /// The way by which positions are counted: as long as the range whatever part of it is swept, so that the first sweep and the way
    /// back are cut into the same bins.
    fn travel(&self, from: LensPosition, leg: usize) -> Option<Travel> {
        let length = self.plan.range.length();
        let to = LensPosition(if leg == 0 { from.0 + length } else { from.0 - length });
        if self.plan.method.reads_every_event() { Travel::new(from, to).ok() } else { None }
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
        let Some(start) = self.run.as_ref().map(|run| run.plan.range.min()) else { return };
        let motion = self.start_motion(start, self.config.max_speed, now, actions);
        self.enter(State::ToStart(motion), now);
    }

    pub(super) fn begin_sweep(&mut self, leg: usize, now: HostMicros, actions: &mut Vec<Action>) {
        let Some(run) = &self.run else { return };
        // Rest and silence checks have seen camera time, so the clock map can answer.
        let (Ok(origin), Some(sample)) = (self.clock.to_camera(now), self.lens) else {
            self.fail(Failure::CameraSilent, now, actions);
            return;
        };
        let (end, speed) = (run.end(leg), run.plan.speed);
        self.sweep.begin(origin, &sample, run.travel(sample.position, leg), &self.clock, now);
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
        let mut verdict = self.sweep.search(&run.plan, &self.config, &mut report);
        if clock.residual_us > self.config.largest_clock_residual.as_micros() as f64 {
            verdict = Err(Failure::ClockUnusable);
        }
        if let Some(place) = run.legs.get_mut(leg) {
            *place = Some(report);
        }
        let sweeps = match (run.plan.method, run.plan.directions) {
            // The others do not know what they do not know.
            (Method::Structure | Method::Auto, Directions::Both | Directions::BackIfUnsure) => 2,
            _ => 1,
        };
        let verdict = match verdict {
            Err(failure) if !failure.is_final(sweeps) => Ok(()),
            verdict => verdict,
        };
        match (verdict, leg, run.plan.directions) {
            (Err(failure), _, _) => self.fail(failure, now, actions),
            (Ok(()), 0, Directions::Both) => self.turn_round(now, actions),
            (Ok(()), 0, Directions::BackIfUnsure) if self.is_unsure() => self.turn_round(now, actions),
            (Ok(()), _, _) => self.decide(now, actions),
        }
    }

    /// Whether the way back may tell what the first sweep does not. Where focus lies beyond the range it cannot.
    fn is_unsure(&self) -> bool {
        let Some(Run { legs: [Some(first), _], delays, .. }) = &self.run else { return false };
        let knows_the_delay = delays.measurements > 0
            || first.structure.and_then(Result::ok).is_none_or(|said| said.noise_hz < LEAST_NOISE_HZ);
        match self.judge() {
            Ok(found) => {
                let is_sure =
                    found.confidence.is_some_and(|confidence| confidence >= SURE) && knows_the_delay;
                !is_sure && !found.flags.contains(Flag::Edge)
            }
            Err(failure) => !failure.is_final(2),
        }
    }

    /// Begins the way back, which need not go further than one width beyond the peak of the first sweep; with a margin for the delays of
    /// both, which put the second peak further on.
    fn turn_round(&mut self, now: HostMicros, actions: &mut Vec<Action>) {
        if let (Ok(found), Some(run)) = (self.judge(), &mut self.run) {
            let speed = run.plan.speed.counts_per_second();
            let margin = found.width.map(|width| width + 2.0 * speed * LONGEST_DELAY_S);
            let lowest = found.second_depth.map_or(found.position.0, |other| other.0.min(found.position.0));
            run.enough = margin.map(|margin| LensPosition(lowest - margin));
        }
        self.begin_sweep(1, now, actions);
    }

    fn decide(&mut self, now: HostMicros, actions: &mut Vec<Action>) {
        match self.judge() {
            Err(Failure::PeakAtEdge { position }) => {
                if !self.extend_range(position, now, actions) {
                    self.fail(Failure::PeakAtEdge { position }, now, actions);
                }
            }
            Err(failure) => self.fail(failure, now, actions),
            Ok(found) => {
                let is_cut_off = found.flags.contains(Flag::Edge);
                if is_cut_off && self.extend_range(found.position, now, actions) {
                    return;
                }
                if let Some((noise_hz, delay)) = found.measured {
                    self.delays.learn(noise_hz, delay.seconds, delay.uncertainty_s);
                }
                if let Some(run) = &mut self.run {
                    run.answer = Some(found);
                }
                self.approach(found.position, 1, now, actions);
            }
        }
    }

    /// What the sweeps made say.
    fn judge(&self) -> Result<Answer, Failure> {
        let no_sweep = Failure::TooFewEvents { events: 0, needed: self.config.sweep_limits.fewest_events };
        let Some(Run { plan, legs: [Some(first), second], delays, .. }) = &self.run else {
            return Err(no_sweep);
        };
        let rules = self.config.rules(plan.range, plan.prefer, *delays);
        answer(first, second.as_ref(), plan.method, &rules)
    }

    /// Begins anew over a range that goes further at the end where `position` is; `false` if the lens cannot.
    fn extend_range(&mut self, position: LensPosition, now: HostMicros, actions: &mut Vec<Action>) -> bool {
        let Some(run) = &mut self.run else { return false };
        let (range, limits) = (run.plan.range, self.config.limits);
        let more = self.config.extension * range.length();
        let is_low = position.distance(range.min()) < position.distance(range.max());
        let (low, high) = (
            range.min().0 - if is_low { more } else { 0.0 },
            range.max().0 + if is_low { 0.0 } else { more },
        );
        let (low, high) = (limits.clamp(LensPosition(low)), limits.clamp(LensPosition(high)));
        let Ok(extended) = LensRange::new(low, high) else { return false };
        let seconds = extended.length() / run.plan.speed.counts_per_second();
        let is_worth_it = extended.length() >= range.length() + LEAST_EXTENSION * more && more > 0.0;
        let fits = seconds <= self.config.capacity.longest.as_secs_f64();
        if run.extensions >= MOST_EXTENSIONS || !is_worth_it || !fits {
            return false;
        }
        run.extend(extended);
        self.go_to_start(now, actions);
        true
    }

    /// Whether the first sweep has gone far enough beyond the peak.
    pub(super) fn may_stop_early(&mut self) -> bool {
        let Some(run) = &self.run else { return false };
        run.plan.early_stop && run.plan.method.reads_every_event() && self.sweep.has_passed_peak()
    }

    /// A sweep that ends before its time leaves what it has counted in the report.
    pub(super) fn keep_unfinished_sweep(&mut self) {
        let (State::Sweeping { leg, .. } | State::Draining { leg, .. }) = self.state else { return };
        let Some(run) = &mut self.run else { return };
        if let (Some(mut report), Some(place)) =
            (run.spare.get_mut(leg).and_then(Option::take), run.legs.get_mut(leg))
        {
            self.sweep.report_unfinished(&mut report);
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
        let window = run
            .answer
            .and_then(|answer| answer.window)
            .and_then(|index| run.plan.windows.get(usize::from(index)).copied().flatten());
        self.note_outcome(outcome, run.position_before, window, now);
        self.report = Some(RunReport {
            id: run.id,
            plan: run.plan,
            rules: self.config.rules(run.plan.range, run.plan.prefer, run.delays),
            started: run.started,
            ended: now,
            position_before: run.position_before,
            position_after: self.lens.map_or(run.position_before, |sample| sample.position),
            outcome,
            delay_us: run.delay_us(),
            answer: run.answer,
            legs: run.legs,
            hot_pixels: self.sweep.hot_pixels(),
            clock: self.clock.quality(),
            phases: run.phases,
        });
        actions.push(Action::RunEnded);
    }
}
