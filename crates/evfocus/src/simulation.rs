//! A sweep on a simulated rig in virtual time, as a recording: events, lens positions, truth, and frames if wanted.
//!
//! Not its job: the physics (`hil_sim`), the focus run (`evfocusd`).

mod frames;
mod truth;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use anyhow::Context;
use evfocus_core::{CameraMicros, EventBatch, HostMicros, LensPosition, LensSpeed, LensTrace};
use evfocus_hal::{Camera, Clock, Lens, VirtualClock};
use evfocus_record::{Evt3Writer, positions};
use hil_sim::{LinkConfig, Rig, RigConfig, SimCamera, SimLens};

use frames::FrameWriter;
pub(crate) use truth::Truth;

/// Virtual time from one look at camera and lens to the next.
const STEP: Duration = Duration::from_millis(1);
/// Events that a batch holds: 1 ms at 65 million events a second.
const BATCH_EVENTS: usize = 65_536;

/// What to simulate, and where to put it.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    pub(crate) rig: RigConfig,
    pub(crate) recording: PathBuf,
    pub(crate) positions: PathBuf,
    pub(crate) truth: PathBuf,
    pub(crate) speed: LensSpeed,
    pub(crate) both_directions: bool,
    /// Before, between and after the sweeps.
    pub(crate) rest: Duration,
    pub(crate) frames: Option<(PathBuf, f64)>,
}

/// Makes the recording that `plan` describes.
pub(crate) fn simulate(plan: &Plan) -> anyhow::Result<Truth> {
    let mut session = Session::new(plan)?;
    let range = plan.rig.lens.range;
    session.rest(plan.rest)?;
    session.sweep(range.max(), plan.speed)?;
    session.rest(plan.rest)?;
    if plan.both_directions {
        session.sweep(range.min(), plan.speed)?;
        session.rest(plan.rest)?;
    }
    session.finish(plan)
}

/// A simulated rig under way and the files it fills.
struct Session {
    clock: Arc<VirtualClock>,
    rig: Rig,
    camera: SimCamera,
    lens: SimLens,
    batch: EventBatch,
    recording: Evt3Writer,
    events: u64,
    lost: u64,
    trace: LensTrace<CameraMicros>,
    /// Where the glass really was.
    glass: LensTrace<CameraMicros>,
    frames: Option<FrameWriter>,
}

impl Session {
    fn new(plan: &Plan) -> anyhow::Result<Self> {
        let mut config = plan.rig.clone();
        // One clock for camera and lens, so that positions need no conversion; events arrive at once.
        config.link = LinkConfig {
            clock_offset: Duration::ZERO,
            clock_drift_ppm: 0.0,
            delay: Duration::ZERO,
            delay_jitter: Duration::ZERO,
        };
        config.lens.start = config.lens.range.min();
        config.lens.max_speed = plan.speed;
        let clock = Arc::new(VirtualClock::new());
        let rig = Rig::new(config, clock.clone())?;
        let (mut camera, lens) = rig.devices();
        camera.start()?;
        let sweep_s = plan.rig.lens.range.length() / plan.speed.counts_per_second();
        let samples = ((4.0 * sweep_s + 3.0 * plan.rest.as_secs_f64() + 2.0) * 1e3) as usize;
        let geometry = camera.info().geometry;
        let mut session = Self {
            clock,
            rig,
            camera,
            lens,
            batch: EventBatch::with_capacity(BATCH_EVENTS),
            recording: Evt3Writer::create(&plan.recording, geometry)?,
            events: 0,
            lost: 0,
            trace: LensTrace::with_capacity(samples),
            glass: LensTrace::with_capacity(samples),
            frames: plan
                .frames
                .as_ref()
                .map(|(folder, fps)| FrameWriter::new(folder, *fps, geometry))
                .transpose()?,
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

    fn sweep(&mut self, target: LensPosition, speed: LensSpeed) -> anyhow::Result<()> {
        self.lens.move_to(target, speed)?;
        while self.step()? {}
        Ok(())
    }

    /// Lets a millisecond pass; returns whether the lens moves.
    fn step(&mut self) -> anyhow::Result<bool> {
        self.clock.advance_to(self.clock.now() + STEP);
        self.read()?;
        if let Some(frames) = &mut self.frames {
            frames.write_until(self.clock.now(), &self.rig)?;
        }
        self.sample()
    }

    fn read(&mut self) -> anyhow::Result<()> {
        loop {
            self.camera.read(&mut self.batch, Duration::ZERO)?;
            self.lost += self.batch.lost;
            if self.batch.events.is_empty() {
                return Ok(());
            }
            self.recording.write(&self.batch.events)?;
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

    fn finish(mut self, plan: &Plan) -> anyhow::Result<Truth> {
        // What the last milliseconds' pixels still have to say.
        self.read()?;
        self.recording.advance(CameraMicros(self.clock.now().0))?;
        self.recording.finish()?;
        positions::write(&plan.positions, &self.trace)?;
        let frames = self.frames.map(FrameWriter::finish).transpose()?;
        let truth = Truth::new(plan, &self.rig, &self.glass, (self.events, self.lost), frames);
        truth.write(&plan.truth).with_context(|| format!("{}: cannot write", shown(&plan.truth)))?;
        Ok(truth)
    }
}

fn shown(path: &Path) -> std::path::Display<'_> {
    path.display()
}
