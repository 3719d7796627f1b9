//! A camera, a lens and a scene made of a few numbers, in virtual time.

use core::f64::consts::TAU;
use core::time::Duration;

use evfocus_core::controller::{Accepted, Action, Command, FocusRequest, Input, Pace, Refusal};
use evfocus_core::{
    CameraMicros, Controller, ControllerConfig, Event, EventBatch, Geometry, HostMicros, LensPosition,
    LensRange, LensSample, LensSpeed, Method, Outcome, Phase, Polarity, SweepCapacity,
};

use crate::random::Xorshift;

pub(crate) const GEOMETRY: Geometry = Geometry { width: 32, height: 24 };
/// Host time minus camera time at the start, and what a transfer takes, microseconds.
const CLOCK_OFFSET_US: i64 = 5_000_000;
const DELAY_US: i64 = 300;

/// What is wrong with the lens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum LensFault {
    None,
    /// It does not move at all.
    Stuck,
    /// Something stands in its way at this position.
    Blocked(f64),
    /// It comes to rest this far beyond its target.
    Overshoots(f64),
    /// It slips by this much once it has said that it has arrived.
    Slips(f64),
    /// It moves at this speed whatever it is told.
    Creeps(f64),
    /// It is where it should be and says that it moves.
    NeverArrives,
    Silent,
    NotANumber,
}

/// What is wrong with the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum CameraFault {
    None,
    Silent,
    /// It sends transfers, and its time does not go on.
    TimeStandsStill,
    /// It loses this many events in each transfer.
    Loses(u64),
}

/// What the camera sees.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scene {
    pub(crate) focus: f64,
    /// How much later focus is met on the way back, counts.
    pub(crate) hysteresis: f64,
    pub(crate) floor_rate: f64,
    pub(crate) peak_rate: f64,
    /// The read-out makes no more than this, at regular intervals.
    pub(crate) highest_rate: f64,
    /// Share of the events that follow the mains.
    pub(crate) flicker: f64,
    /// Share of the events that follow the picture: stripes that gain contrast on the way to focus and lose it beyond.
    pub(crate) texture: f64,
    /// Width of the stripes, pixels: blur makes them wider.
    pub(crate) stripe: u16,
}

#[derive(Debug)]
pub(crate) struct Rig {
    pub(crate) controller: Controller,
    pub(crate) now: HostMicros,
    pub(crate) lens_fault: LensFault,
    pub(crate) camera_fault: CameraFault,
    pub(crate) scene: Scene,
    pub(crate) clock_offset_us: i64,
    pub(crate) position: f64,
    /// Where the lens goes, and how fast.
    order: Option<(f64, f64)>,
    /// Which way it was sent last: 1 or -1.
    way: f64,
    random: Xorshift,
    batch: EventBatch,
    /// What the controller wanted done, all of it and what is not done yet.
    pub(crate) done: Vec<Action>,
    actions: Vec<Action>,
    /// The phases seen, each change of them.
    pub(crate) phases: Vec<Phase>,
}

pub(crate) fn config() -> ControllerConfig {
    let limits = LensRange::new(LensPosition(0.0), LensPosition(1_000.0)).unwrap();
    let capacity =
        SweepCapacity { longest: Duration::from_secs(5), events: 200_000, ..SweepCapacity::default() };
    ControllerConfig {
        sweep_speed: LensSpeed::new(1_000.0).unwrap(),
        // The scene of these tests is a rate first of all; what `auto` adds has tests of its own.
        method: Method::Egs,
        pace: Pace::Accurate,
        capacity,
        lens_samples: 4_000,
        ..ControllerConfig::for_lens(limits, LensSpeed::new(2_000.0).unwrap())
    }
}

impl Rig {
    /// A sound rig whose lens stands at 300; focus is at 600.
    pub(crate) fn new(config: ControllerConfig) -> Self {
        let now = HostMicros(1_000_000_000);
        let scene = Scene {
            focus: 600.0,
            hysteresis: 0.0,
            floor_rate: 2e3,
            peak_rate: 1e5,
            highest_rate: f64::INFINITY,
            flicker: 0.0,
            texture: 0.9,
            stripe: 2,
        };
        let mut rig = Self {
            controller: Controller::new(config, GEOMETRY, now),
            now,
            lens_fault: LensFault::None,
            camera_fault: CameraFault::None,
            scene,
            clock_offset_us: CLOCK_OFFSET_US,
            position: 300.0,
            order: None,
            way: 1.0,
            random: Xorshift::new(1),
            batch: EventBatch::with_capacity(10_000),
            done: Vec::with_capacity(1_000),
            actions: Vec::with_capacity(16),
            phases: Vec::with_capacity(1_000),
        };
        rig.steps(20);
        rig
    }

    /// A rig whose camera has not said anything yet.
    pub(crate) fn with_silent_camera(config: ControllerConfig) -> Self {
        let mut rig = Self::new(config);
        rig.controller = Controller::new(rig.controller.config().clone(), GEOMETRY, rig.now);
        rig.camera_fault = CameraFault::Silent;
        rig.steps(20);
        rig
    }

    pub(crate) fn command(&mut self, command: Command) -> Result<Accepted, Refusal> {
        let answer = self.controller.command(command, self.now, &mut self.actions);
        self.carry_out();
        answer
    }

    pub(crate) fn focus(&mut self) {
        let answer = self.command(Command::Focus(FocusRequest::default()));
        assert!(matches!(answer, Ok(Accepted::Started(_))), "{answer:?}");
    }

    pub(crate) fn input(&mut self, input: Input<'_>) {
        self.controller.handle(input, self.now, &mut self.actions);
        self.carry_out();
    }

    /// Lets `milliseconds` pass.
    pub(crate) fn steps(&mut self, milliseconds: u32) {
        for _ in 0..milliseconds {
            self.step();
        }
    }

    /// Goes on until the run ends, and says how. `at_phase` is called at the begin of each phase.
    pub(crate) fn finish(&mut self, mut at_phase: impl FnMut(&mut Self, Phase)) -> Outcome {
        let mut seen = None;
        for _ in 0..120_000 {
            let phase = self.controller.snapshot().phase;
            if let Some(phase) = phase
                && seen != Some(phase)
            {
                at_phase(self, phase);
            }
            seen = phase;
            if self.controller.snapshot().run.is_none() {
                break;
            }
            self.step();
        }
        assert_eq!(self.done.last(), Some(&Action::RunEnded), "a run ends within two minutes");
        self.controller.report().unwrap().outcome
    }

    /// Goes on until the run is in `phase`.
    pub(crate) fn until(&mut self, phase: Phase) {
        for _ in 0..60_000 {
            if self.controller.snapshot().phase == Some(phase) {
                return;
            }
            self.step();
        }
        panic!("no {} within a minute", phase.name());
    }

    /// One millisecond.
    pub(crate) fn step(&mut self) {
        self.now += Duration::from_millis(1);
        self.move_lens();
        self.make_events();
        let millisecond = self.now.0 / 1_000;
        if millisecond % 4 == 0 && self.camera_fault != CameraFault::Silent {
            self.send_batch();
        }
        if millisecond % 5 == 0 && self.lens_fault != LensFault::Silent {
            self.send_position();
        }
        self.input(Input::Tick);
    }

    fn move_lens(&mut self) {
        let Some((target, speed)) = self.order else { return };
        let (target, speed) = match self.lens_fault {
            LensFault::Stuck => return,
            LensFault::Blocked(at) if (self.position <= at) != (target <= at) => (at, speed),
            LensFault::Overshoots(by) => (target + by * self.way, speed),
            LensFault::Creeps(speed) => (target, speed),
            LensFault::None
            | LensFault::Blocked(_)
            | LensFault::Slips(_)
            | LensFault::NeverArrives
            | LensFault::Silent
            | LensFault::NotANumber => (target, speed),
        };
        let missing = target - self.position;
        if missing.abs() <= speed * 1e-3 {
            self.position = target;
            self.order = None;
        } else {
            self.position += missing.signum() * speed * 1e-3;
        }
    }

    fn make_events(&mut self) {
        let start = self.now.0 - 1_000 - DELAY_US - self.clock_offset_us;
        let late = if self.way < 0.0 { self.scene.hysteresis } else { 0.0 };
        let distance = (self.position - self.scene.focus - late) / 80.0;
        let rate = self.scene.floor_rate + self.scene.peak_rate * (-distance * distance).exp();
        let mut t = 0.0;
        loop {
            let gap = if rate > self.scene.highest_rate {
                1e6 / self.scene.highest_rate
            } else {
                self.random.exponential(1e6 / rate.max(1e-3))
            };
            t += gap;
            if t >= 1_000.0 {
                return;
            }
            let time = CameraMicros(start + t as i64);
            let flicker = self.scene.flicker * (TAU * 100.0 * time.0 as f64 * 1e-6).sin();
            let chance = self.random.uniform();
            let place = self.random.next();
            let (x, y) = (place as u16 % GEOMETRY.width, (place >> 16) as u16 % GEOMETRY.height);
            let stripe = if (x / self.scene.stripe).is_multiple_of(2) { 1.0 } else { -1.0 };
            let gains = -distance.signum() * self.way;
            let picture = self.scene.texture * (1.0 - self.scene.flicker) * stripe * gains;
            let polarity = Polarity::from_on(chance < f64::midpoint(1.0, flicker + picture));
            self.batch.events.push(Event { t: time, x, y, polarity }).unwrap();
        }
    }

    fn send_batch(&mut self) {
        let mut batch = core::mem::take(&mut self.batch);
        batch.arrival = self.now;
        if self.camera_fault == CameraFault::TimeStandsStill {
            batch.events.clear();
            batch.reached = self.controller.clock().newest();
        } else {
            batch.reached = Some(CameraMicros(self.now.0 - DELAY_US - self.clock_offset_us));
        }
        if let CameraFault::Loses(lost) = self.camera_fault {
            batch.lost = lost;
        }
        self.input(Input::Batch(&batch));
        batch.clear();
        self.batch = batch;
    }

    fn send_position(&mut self) {
        let mut position = self.position;
        match self.lens_fault {
            LensFault::NotANumber => position = f64::NAN,
            LensFault::Slips(by) if self.controller.snapshot().phase == Some(Phase::Verifying) => {
                position += by;
            }
            LensFault::None
            | LensFault::Stuck
            | LensFault::Blocked(_)
            | LensFault::Overshoots(_)
            | LensFault::Slips(_)
            | LensFault::Creeps(_)
            | LensFault::NeverArrives
            | LensFault::Silent => {}
        }
        let is_blocked = matches!(self.lens_fault, LensFault::Stuck | LensFault::Blocked(_));
        let moving = self.lens_fault == LensFault::NeverArrives || self.order.is_some() && !is_blocked;
        self.input(Input::Lens(LensSample {
            requested: self.now - Duration::from_millis(1),
            replied: self.now,
            position: LensPosition(position),
            moving,
        }));
    }

    fn go(&mut self, target: f64, speed: f64) {
        self.way = if target < self.position { -1.0 } else { 1.0 };
        self.order = Some((target, speed));
    }

    fn carry_out(&mut self) {
        for index in 0..self.actions.len() {
            let action = self.actions[index];
            match action {
                Action::Home => self.go(0.0, 500.0),
                Action::MoveLens { target, speed } => {
                    assert!(
                        self.controller.config().limits.contains(target),
                        "{target} is outside of the limits"
                    );
                    assert!(speed <= self.controller.config().max_speed);
                    self.go(target.0, speed.counts_per_second());
                }
                Action::StopLens => self.order = None,
                Action::RunEnded => {}
            }
            self.done.push(action);
        }
        self.actions.clear();
        if let Some(phase) = self.controller.snapshot().phase
            && self.phases.last() != Some(&phase)
        {
            self.phases.push(phase);
        }
    }
}
