//! A sweep on a simulated rig in virtual time.
//!
//! Not its job: the physics (`hil_sim`), files, the focus run.

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::{CameraMicros, EventBatch, Events, HostMicros, LensPosition, LensSpeed, LensTrace};
use evfocus_hal::{Camera, Clock, Lens, VirtualClock};
use hil_sim::{LinkConfig, Rig, RigConfig, SimCamera, SimLens};

/// Virtual time from one look at camera and lens to the next.
const STEP: Duration = Duration::from_millis(1);
/// Events that a batch holds: 1 ms at 65 million events a second.
const BATCH_EVENTS: usize = 65_536;

/// Which way the lens goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ways {
    /// From the lowest position to the highest.
    Up,
    /// From the highest position to the lowest.
    Down,
    /// Up, and then down.
    UpAndDown,
}

/// What to simulate.
#[derive(Debug, Clone, PartialEq)]
pub struct SweepPlan {
    /// The rig. Camera and lens get one clock, so that positions need no conversion, and events arrive at once; the lens starts where
    /// the sweep does.
    pub rig: RigConfig,
    /// Speed of the sweep; counts per second.
    pub speed: LensSpeed,
    /// Which way the lens goes.
    pub ways: Ways,
    /// How long the lens stands before, between and after the sweeps.
    pub rest: Duration,
}

/// Who is told of a sweep while it is simulated.
pub trait SweepObserver {
    /// The next events, in the order of their times.
    ///
    /// # Errors
    /// Whatever ends the simulation.
    fn events(&mut self, events: Events<'_>) -> anyhow::Result<()>;

    /// The rig's time is `now`, a millisecond after the call before.
    ///
    /// # Errors
    /// Whatever ends the simulation.
    fn passed(&mut self, now: HostMicros, rig: &Rig) -> anyhow::Result<()>;
}

/// What was simulated.
#[derive(Debug)]
pub struct SimulatedSweep {
    /// The rig, which knows the truth.
    pub rig: Rig,
    /// What the lens reported.
    pub trace: LensTrace<CameraMicros>,
    /// Where the glass really was.
    pub glass: LensTrace<CameraMicros>,
    /// Events that the observer got.
    pub events: u64,
    /// Events that the simulated read-out or link lost.
    pub lost: u64,
    /// When it was over.
    pub end: CameraMicros,
}

impl SweepPlan {
    /// Simulates.
    ///
    /// # Errors
    /// A rig that makes no sense, or what `observer` fails with.
    pub fn simulate(&self, observer: &mut impl SweepObserver) -> anyhow::Result<SimulatedSweep> {
        let (low, high) = (self.rig.lens.range.min(), self.rig.lens.range.max());
        let (start, targets): (LensPosition, &[LensPosition]) = match self.ways {
            Ways::Up => (low, &[high]),
            Ways::Down => (high, &[low]),
            Ways::UpAndDown => (low, &[high, low]),
        };
        let mut session = Session::new(self, start, observer)?;
        session.rest(self.rest)?;
        for &target in targets {
            session.lens.move_to(target, self.speed)?;
            while session.step()? {}
            session.rest(self.rest)?;
        }
        session.finish()
    }
}

/// A simulated rig under way.
struct Session<'a, O> {
    clock: Arc<VirtualClock>,
    rig: Rig,
    camera: SimCamera,
    lens: SimLens,
    batch: EventBatch,
    observer: &'a mut O,
    events: u64,
    lost: u64,
    trace: LensTrace<CameraMicros>,
    glass: LensTrace<CameraMicros>,
}

impl<'a, O: SweepObserver> Session<'a, O> {
    fn new(plan: &SweepPlan, start: LensPosition, observer: &'a mut O) -> anyhow::Result<Self> {
        let mut config = plan.rig.clone();
        config.link = LinkConfig {
            clock_offset: Duration::ZERO,
            clock_drift_ppm: 0.0,
            delay: Duration::ZERO,
            delay_jitter: Duration::ZERO,
        };
        config.lens.start = start;
        config.lens.max_speed = plan.speed;
        let clock = Arc::new(VirtualClock::new());
        let rig = Rig::new(config, clock.clone())?;
        let (mut camera, lens) = rig.devices();
        camera.start()?;
        let sweep_s = plan.rig.lens.range.length() / plan.speed.counts_per_second();
        let samples = ((4.0 * sweep_s + 3.0 * plan.rest.as_secs_f64() + 2.0) * 1e3) as usize;
        let mut session = Self {
            clock,
            rig,
            camera,
            lens,
            batch: EventBatch::with_capacity(BATCH_EVENTS),
            observer,
            events: 0,
            lost: 0,
            trace: LensTrace::with_capacity(samples),
            glass: LensTrace::with_capacity(samples),
        };
        session.sample()?;
        Ok(session)
    }

    fn rest(&mut self, duration: Duration) -> anyhow::Result<()> {
        let end = self.clock.now() + duration;
        while self.clock.now() < end {
            self.step()?;
        }
        Ok(())
    }

    /// Lets a millisecond pass; returns whether the lens moves.
    fn step(&mut self) -> anyhow::Result<bool> {
        self.clock.advance_to(self.clock.now() + STEP);
        self.read()?;
        self.observer.passed(self.clock.now(), &self.rig)?;
        self.sample()
    }

    fn read(&mut self) -> anyhow::Result<()> {
        loop {
            self.camera.read(&mut self.batch, Duration::ZERO)?;
            self.lost += self.batch.lost;
            if self.batch.events.is_empty() {
                return Ok(());
            }
            self.observer.events(self.batch.events.as_slice())?;
            self.events += self.batch.events.len() as u64;
        }
    }

    fn sample(&mut self) -> anyhow::Result<bool> {
        let sample = self.lens.sample()?;
        let HostMicros(time) = sample.time();
        self.trace.push_if_later(CameraMicros(time), sample.position);
        let now = self.clock.now();
        self.glass.push_if_later(CameraMicros(now.0), self.rig.glass(now));
        Ok(sample.moving)
    }

    fn finish(mut self) -> anyhow::Result<SimulatedSweep> {
        // What the last milliseconds' pixels still have to say.
        self.read()?;
        Ok(SimulatedSweep {
            end: CameraMicros(self.clock.now().0),
            rig: self.rig,
            trace: self.trace,
            glass: self.glass,
            events: self.events,
            lost: self.lost,
        })
    }
}
