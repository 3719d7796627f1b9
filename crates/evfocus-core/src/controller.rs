//! The focus controller: a pure state machine from (input, now) to actions.
//!
//! ```text
//!                 Focus                arrived        rested                 arrived               counts complete
//!  Idle --------------------> ToStart ---------> Resting ------> Sweeping(0) -------> Draining(0) ------------------+
//!   |  \ needs homing           ^                                                                                   |
//!   |   +------------> Homing --+ at rest                                       both directions                     v
//!   |                                               +---- Draining(1) <------ Sweeping(1) <------------------- [search]
//!   | MoveTo                                        v          arrived                                              |
//!   +-------> Moving -> Idle                    [search]                                              one direction |
//!                                                   |                                                               |
//!                                                   +-----> Approaching(run-up) -> Approaching(final) <-------------+
//!                                                               ^                          | arrived
//!                                                               +------- off target --- Verifying ----> Idle, Focused
//!
//!  Idle, mode continuous --- focus unknown, or lost for long enough ---> as if Focus had been called
//!  any state of a run --- failure --> Restoring -> Idle, Failed      (lens or camera gone: lens stopped, Idle, Failed at once)
//!  any state ------------ Abort ----> lens stopped, Idle
//! ```

mod config;
mod continuous;
mod interface;
mod motion;
mod request;
mod run;
mod sweeping;
mod watcher;

pub use config::{ControllerConfig, OnFailure};
pub use continuous::{Pause, PauseState};
pub use interface::{Action, DeviceFailure, FocusState, Input, Snapshot};
pub use request::{Accepted, Command, FocusRequest, Mode, Pace, Refusal, check_windows};
pub use watcher::WatchConfig;

use alloc::vec::Vec;
use core::time::Duration;

use crate::clock_map::{ClockEvent, ClockMap};
use crate::delay::DelayModel;
use crate::event::{EventBatch, Geometry};
use crate::lens_trace::LensSample;
use crate::report::{Failure, FocusPlan, Outcome, Phase, RunId, RunReport};
use crate::units::{EventRate, HostMicros, LensPosition};

use continuous::Continuous;
use motion::{Motion, Progress};
use run::Run;
use sweeping::SweepState;

#[derive(Debug, Clone, Copy, PartialEq)]
enum State {
    Idle,
    Moving(Motion),
    Homing { since: HostMicros, seen_moving: bool },
    ToStart(Motion),
    Resting { since: HostMicros },
    Sweeping { leg: usize, motion: Motion },
    Draining { leg: usize, deadline: HostMicros },
    Approaching { motion: Motion, answer: LensPosition, attempt: u32, run_up: bool },
    Verifying { since: HostMicros, answer: LensPosition, attempt: u32 },
    Restoring { motion: Motion, failure: Failure },
}

/// How often the approach is tried before the lens is said not to keep its position.
const APPROACHES: u32 = 3;
/// A lens that has not begun to move this long after the order to home is at its reference already.
const HOMING_BEGINS: Duration = Duration::from_millis(500);
/// Over how long the event rate in a snapshot is taken.
const RATE_WINDOW: Duration = Duration::from_millis(100);

/// The controller.
#[derive(Debug)]
pub struct Controller {
    config: ControllerConfig,
    mode: Mode,
    state: State,
    outcome: FocusState,
    homed: bool,
    next_run: u64,
    run: Option<Run>,
    report: Option<RunReport>,
    clock: ClockMap,
    delays: DelayModel,
    geometry: Geometry,
    sweep: SweepState,
    lens: Option<LensSample>,
    camera_heard: HostMicros,
    lens_heard: HostMicros,
    camera_ready: bool,
    lens_ready: bool,
    events: u64,
    lost: u64,
    continuous: Continuous,
    rate_window: (HostMicros, u64),
    event_rate: EventRate,
}

impl Controller {
    /// A controller for a camera of `geometry`. All memory that the event path needs is allocated here.
    pub fn new(config: ControllerConfig, geometry: Geometry, now: HostMicros) -> Self {
        Self {
            mode: Mode::Auto,
            state: State::Idle,
            outcome: FocusState::Idle,
            homed: !config.needs_homing,
            next_run: 1,
            run: None,
            report: None,
            clock: ClockMap::new(None),
            delays: config.delays,
            geometry,
            sweep: SweepState::new(geometry, &config),
            lens: None,
            camera_heard: now,
            lens_heard: now,
            camera_ready: true,
            lens_ready: true,
            events: 0,
            lost: 0,
            continuous: Continuous::new(&config, geometry, now),
            rate_window: (now, 0),
            event_rate: EventRate(0.0),
            config,
        }
    }

    /// The settings.
    pub fn config(&self) -> &ControllerConfig {
        &self.config
    }

    /// Takes new settings for the runs to come, for the same lens. What runs have taught stays. Allocates; a run under way must
    /// end first, so `false` means that nothing has changed.
    pub fn reconfigure(&mut self, config: ControllerConfig) -> bool {
        if self.run.is_some() {
            return false;
        }
        self.sweep = SweepState::new(self.geometry, &config);
        self.continuous.watcher.configure(config.watch);
        self.config = config;
        true
    }

    /// Counts on `delays` from now on, whatever was learnt.
    pub fn set_delays(&mut self, delays: DelayModel) {
        self.delays = delays;
    }

    /// The next run gets this number or a higher one: numbers go on after a restart.
    pub fn number_runs_from(&mut self, first: RunId) {
        self.next_run = self.next_run.max(first.0);
    }

    /// The record of the last run that ended.
    pub fn report(&self) -> Option<&RunReport> {
        self.report.as_ref()
    }

    /// How late the pixels of this rig are, as far as its runs have taught.
    pub fn delays(&self) -> DelayModel {
        self.delays
    }

    /// How camera time and host time are related.
    pub fn clock(&self) -> &ClockMap {
        &self.clock
    }

    /// The focus curve of the sweep under way, as far as it has come, or of the last one.
    pub fn live_curve(&self) -> &[crate::CurvePoint] {
        self.sweep.live_curve()
    }

    /// What can be seen from outside.
    pub fn snapshot(&self) -> Snapshot {
        let scanning = self.run.is_some();
        Snapshot {
            mode: self.mode,
            pause: self.continuous.pause,
            sharpness: self.sharpness(),
            continuous_runs: self.continuous.runs,
            state: if scanning { FocusState::Scanning } else { self.outcome },
            phase: self.phase(),
            run: self.run.as_ref().map(|run| run.id),
            lens: self.lens,
            event_rate: self.event_rate,
            events: self.events,
            lost: self.lost,
            camera_ready: self.camera_ready,
            lens_ready: self.lens_ready,
        }
    }

    fn phase(&self) -> Option<Phase> {
        match self.state {
            State::Idle | State::Moving(_) => None,
            State::Homing { .. } => Some(Phase::Homing),
            State::ToStart(_) => Some(Phase::ToStart),
            State::Resting { .. } => Some(Phase::Resting),
            State::Sweeping { leg: 0, .. } => Some(Phase::Sweeping),
            State::Sweeping { .. } => Some(Phase::Returning),
            State::Draining { .. } => Some(Phase::Searching),
            State::Approaching { .. } => Some(Phase::Approaching),
            State::Verifying { .. } => Some(Phase::Verifying),
            State::Restoring { .. } => Some(Phase::Restoring),
        }
    }

    /// Takes a command.
    ///
    /// # Errors
    /// [`Refusal`] says why the command was not taken; nothing has changed then.
    pub fn command(
        &mut self,
        command: Command,
        now: HostMicros,
        actions: &mut Vec<Action>,
    ) -> Result<Accepted, Refusal> {
        match command {
            Command::Focus(request) => self.focus(request, now, actions),
            Command::Abort => {
                self.abort(now, actions);
                // Or it would move again at once.
                self.continuous.pause = PauseState::Paused;
                Ok(Accepted::Done)
            }
            Command::Pause(pause) => self.pause(pause, now, actions).map(|()| Accepted::Done),
            Command::MoveTo(target) => self.move_to(target, now, actions),
            Command::SetMode(mode) => {
                if mode != self.mode {
                    if self.state != State::Idle {
                        self.abort(now, actions);
                    }
                    let keeps_focus = mode == Mode::Continuous && self.outcome == FocusState::Focused;
                    self.mode = mode;
                    self.enter_continuous(now);
                    if !keeps_focus {
                        self.outcome = FocusState::Idle;
                    }
                }
                Ok(Accepted::Done)
            }
        }
    }

    fn focus(
        &mut self,
        request: FocusRequest,
        now: HostMicros,
        actions: &mut Vec<Action>,
    ) -> Result<Accepted, Refusal> {
        if self.mode == Mode::Manual {
            return Err(Refusal::ManualMode);
        }
        let plan = request.resolve(&self.config, self.geometry)?;
        if let Some(run) = &self.run {
            let same = run.plan == plan || request == FocusRequest::default();
            return if same { Ok(Accepted::UnderWay(run.id)) } else { Err(Refusal::Busy { run: run.id }) };
        }
        let run = self.start(plan, now, actions)?;
        self.continuous.request = request;
        Ok(Accepted::Started(run))
    }

    fn start(
        &mut self,
        plan: FocusPlan,
        now: HostMicros,
        actions: &mut Vec<Action>,
    ) -> Result<RunId, Refusal> {
        if !self.camera_ready {
            return Err(Refusal::NoCamera);
        }
        let Some(lens) = self.lens.filter(|_| self.lens_ready) else {
            return Err(Refusal::NoLens);
        };
        let id = RunId(self.next_run);
        self.next_run += 1;
        self.run = Some(Run::new(id, plan, self.delays, lens.position, now));
        self.camera_heard = now;
        self.lens_heard = now;
        self.sweep.forget();
        self.sweep.set_windows(&plan.windows);
        if self.homed {
            self.go_to_start(now, actions);
        } else {
            actions.push(Action::Home);
            self.enter(State::Homing { since: now, seen_moving: false }, now);
        }
        Ok(id)
    }

    fn move_to(
        &mut self,
        target: LensPosition,
        now: HostMicros,
        actions: &mut Vec<Action>,
    ) -> Result<Accepted, Refusal> {
        if let Some(run) = &self.run {
            return Err(Refusal::Busy { run: run.id });
        }
        if !self.config.limits.contains(target) {
            return Err(Refusal::OutOfRange {
                what: "position",
                value: target.0,
                limits: self.config.limits,
            });
        }
        if !self.lens_ready || self.lens.is_none() {
            return Err(Refusal::NoLens);
        }
        if !self.homed {
            return Err(Refusal::NotHomed);
        }
        let motion = self.start_motion(target, self.config.max_speed, now, actions);
        self.outcome = FocusState::Idle;
        self.enter(State::Moving(motion), now);
        Ok(Accepted::Done)
    }

    /// Stops the lens whatever is under way: it may be moving without the controller's knowledge.
    fn abort(&mut self, now: HostMicros, actions: &mut Vec<Action>) {
        actions.push(Action::StopLens);
        if self.run.is_some() {
            self.keep_unfinished_sweep();
            self.finish(Outcome::Aborted, now, actions);
        } else {
            self.enter(State::Idle, now);
        }
    }

    /// Takes an input. The event path ([`Input::Batch`]) allocates nothing.
    pub fn handle(&mut self, input: Input<'_>, now: HostMicros, actions: &mut Vec<Action>) {
        match input {
            Input::Batch(batch) => self.on_batch(batch, now, actions),
            Input::Lens(sample) => self.on_lens(sample, now, actions),
            Input::CameraFailed(failure) => {
                self.camera_ready = false;
                self.on_failure(
                    match failure {
                        DeviceFailure::Gone => Failure::CameraLost,
                        DeviceFailure::Fault => Failure::CameraFault,
                        DeviceFailure::Silent => Failure::CameraSilent,
                    },
                    now,
                    actions,
                );
            }
            Input::CameraReady => {
                self.camera_ready = true;
                self.camera_heard = now;
                // It may count from zero again.
                self.clock = ClockMap::new(None);
                self.continuous.watcher.interrupt();
                self.continuous.watcher.device_is_back(now);
            }
            Input::LensFailed(failure) => {
                self.lens_ready = false;
                self.lens = None;
                self.homed = !self.config.needs_homing;
                self.on_failure(
                    match failure {
                        DeviceFailure::Gone => Failure::LensLost,
                        DeviceFailure::Fault => Failure::LensFault,
                        DeviceFailure::Silent => Failure::LensSilent,
                    },
                    now,
                    actions,
                );
            }
            Input::LensReady => {
                self.lens_ready = true;
                self.lens_heard = now;
                self.continuous.watcher.device_is_back(now);
            }
            Input::Tick => self.watch_time(now, actions),
        }
    }

    fn on_batch(&mut self, batch: &EventBatch, now: HostMicros, actions: &mut Vec<Action>) {
        self.events += batch.events.len() as u64;
        self.lost += batch.lost;
        let Some(reached) = batch.reached.or(batch.events.last().map(|event| event.t)) else {
            return;
        };
        self.camera_heard = now;
        let clock_event = self.clock.observe(reached, batch.arrival);
        match self.state {
            State::Resting { .. } => self.sweep.observe_rest(batch.events.as_slice()),
            State::Sweeping { .. } | State::Draining { .. } => {
                if clock_event == ClockEvent::Reset {
                    self.fail(Failure::ClockUnusable, now, actions);
                } else {
                    self.sweep.feed(batch, reached);
                    self.sweep.extend_live_curve(reached);
                }
            }
            State::Idle => self.watch_events(batch.events.as_slice(), now),
            State::Moving(_)
            | State::Homing { .. }
            | State::ToStart(_)
            | State::Approaching { .. }
            | State::Verifying { .. }
            | State::Restoring { .. } => {}
        }
    }

    fn on_lens(&mut self, sample: LensSample, now: HostMicros, actions: &mut Vec<Action>) {
        if !sample.position.0.is_finite() {
            self.on_failure(Failure::LensFault, now, actions);
            return;
        }
        self.lens = Some(sample);
        self.lens_heard = now;
        match self.state {
            State::Idle | State::Resting { .. } | State::Verifying { .. } => {}
            State::Draining { .. } => self.sweep.add_lens(&sample, &self.clock),
            State::Moving(mut motion) => match motion.observe(&sample) {
                Progress::UnderWay => self.state = State::Moving(motion),
                Progress::Arrived => self.enter(State::Idle, now),
                Progress::Failed(_) | Progress::Overdue => self.give_up_motion(now, actions),
            },
            State::Homing { since, seen_moving } => {
                if sample.moving {
                    self.state = State::Homing { since, seen_moving: true };
                } else if seen_moving || now.since(since) >= HOMING_BEGINS {
                    self.homed = true;
                    if let Some(run) = &mut self.run {
                        // Positions mean something only now.
                        run.position_before = sample.position;
                    }
                    self.go_to_start(now, actions);
                }
            }
            State::ToStart(mut motion) => match motion.observe(&sample) {
                Progress::UnderWay => self.state = State::ToStart(motion),
                Progress::Arrived => {
                    self.sweep.begin_rest();
                    self.enter(State::Resting { since: now }, now);
                }
                Progress::Failed(failure) => self.fail(failure, now, actions),
                Progress::Overdue => self.fail(Failure::TimedOut(Phase::ToStart), now, actions),
            },
            State::Sweeping { leg, mut motion } => {
                self.sweep.add_lens(&sample, &self.clock);
                match motion.observe(&sample) {
                    Progress::UnderWay => {
                        if leg == 0 && !motion.is_stopping() && self.may_stop_early() {
                            actions.push(Action::StopLens);
                            motion = motion.stop(now);
                        }
                        self.state = State::Sweeping { leg, motion };
                    }
                    Progress::Arrived => self.drain(leg, &sample, now, actions),
                    Progress::Failed(failure) => self.fail(failure, now, actions),
                    Progress::Overdue => {
                        let phase = if leg == 0 { Phase::Sweeping } else { Phase::Returning };
                        self.fail(Failure::TimedOut(phase), now, actions);
                    }
                }
            }
            State::Approaching { mut motion, answer, attempt, run_up } => match motion.observe(&sample) {
                Progress::UnderWay => self.state = State::Approaching { motion, answer, attempt, run_up },
                Progress::Arrived if run_up => self.approach_finally(answer, attempt, now, actions),
                Progress::Arrived => self.enter(State::Verifying { since: now, answer, attempt }, now),
                Progress::Failed(failure) => self.fail(failure, now, actions),
                Progress::Overdue => self.fail(Failure::TimedOut(Phase::Approaching), now, actions),
            },
            State::Restoring { mut motion, failure } => match motion.observe(&sample) {
                Progress::UnderWay => self.state = State::Restoring { motion, failure },
                Progress::Arrived => self.finish(Outcome::Failed(failure), now, actions),
                Progress::Failed(_) | Progress::Overdue => {
                    actions.push(Action::StopLens);
                    self.finish(Outcome::Failed(failure), now, actions);
                }
            },
        }
    }

    /// What time alone brings about: rests that end, silences, deadlines.
    fn watch_time(&mut self, now: HostMicros, actions: &mut Vec<Action>) {
        let (since, events) = self.rate_window;
        if now.since(since) >= RATE_WINDOW {
            self.event_rate = EventRate((self.events - events) as f64 / now.since(since).as_secs_f64());
            self.rate_window = (now, self.events);
        }
        if self.state == State::Idle {
            self.watch_focus(now, actions);
            return;
        }
        if now.since(self.lens_heard) >= self.config.silence_timeout {
            self.on_failure(Failure::LensSilent, now, actions);
            return;
        }
        // The way back after a failure needs no camera.
        let needs_camera = self.run.is_some() && !matches!(self.state, State::Restoring { .. });
        if needs_camera && now.since(self.camera_heard) >= self.config.silence_timeout {
            self.fail(Failure::CameraSilent, now, actions);
            return;
        }
        match self.state {
            // A camera that has just been started may not have said anything yet.
            State::Resting { since }
                if now.since(since) >= self.config.rest && self.clock.newest().is_some() =>
            {
                self.sweep.end_rest(now.since(since));
                self.begin_sweep(0, now, actions);
            }
            // The lens must have said since where it came to rest.
            State::Verifying { since, answer, attempt }
                if now.since(since) >= self.config.rest && self.lens_heard > since =>
            {
                self.verify(answer, attempt, now, actions);
            }
            State::Homing { since, .. } if now.since(since) >= self.config.homing_timeout => {
                self.fail(Failure::TimedOut(Phase::Homing), now, actions);
            }
            State::Draining { leg, deadline } => {
                if self.sweep.is_complete(&self.clock) {
                    self.search(leg, now, actions);
                } else if now >= deadline {
                    self.fail(Failure::TimedOut(Phase::Searching), now, actions);
                }
            }
            State::Sweeping { .. } if self.sweep.is_too_long(now) => {
                self.fail(Failure::SweepTooLong, now, actions);
            }
            State::Moving(motion) if motion.is_overdue(now) => self.give_up_motion(now, actions),
            State::Idle
            | State::Moving(_)
            | State::Homing { .. }
            | State::ToStart(_)
            | State::Resting { .. }
            | State::Sweeping { .. }
            | State::Approaching { .. }
            | State::Verifying { .. }
            | State::Restoring { .. } => {}
        }
    }
}
