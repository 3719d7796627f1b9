//! A sweep on a simulated rig in virtual time, as a recording: events, lens positions, truth, and frames if wanted.
//!
//! Not its job: the physics (`hil_sim`), the sweep (`evfocus_eval::simulated_sweep`), the focus run (`evfocusd`).

mod frames;
mod truth;

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Context;
use evfocus_core::{Events, HostMicros, LensSpeed};
use evfocus_eval::simulated_sweep::{SweepObserver, SweepPlan, Ways};
use evfocus_record::{Evt3Writer, positions};
use hil_sim::{Rig, RigConfig};

use frames::FrameWriter;
pub(crate) use truth::Truth;

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
    // Before any file is made.
    plan.rig.validate()?;
    let geometry = plan.rig.sensor.geometry;
    let mut files = Files {
        recording: Evt3Writer::create(&plan.recording, geometry)?,
        frames: plan
            .frames
            .as_ref()
            .map(|(folder, fps)| FrameWriter::new(folder, *fps, geometry))
            .transpose()?,
    };
    let ways = if plan.both_directions { Ways::UpAndDown } else { Ways::Up };
    let sweep = SweepPlan { rig: plan.rig.clone(), speed: plan.speed, ways, rest: plan.rest };
    let made = sweep.simulate(&mut files)?;
    files.recording.advance(made.end)?;
    files.recording.finish()?;
    positions::write(&plan.positions, &made.trace)?;
    let frames = files.frames.map(FrameWriter::finish).transpose()?;
    let truth = Truth::new(plan, &made, frames);
    truth.write(&plan.truth).with_context(|| format!("{}: cannot write", shown(&plan.truth)))?;
    Ok(truth)
}

/// The files that a sweep fills while it is simulated.
struct Files {
    recording: Evt3Writer,
    frames: Option<FrameWriter>,
}

impl SweepObserver for Files {
    fn events(&mut self, events: Events<'_>) -> anyhow::Result<()> {
        Ok(self.recording.write(events.iter())?)
    }

    fn passed(&mut self, now: HostMicros, rig: &Rig) -> anyhow::Result<()> {
        self.frames.as_mut().map_or(Ok(()), |frames| frames.write_until(now, rig))
    }
}

fn shown(path: &Path) -> std::path::Display<'_> {
    path.display()
}
