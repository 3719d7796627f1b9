//! What only the simulator knows of a recording.

use std::fs;
use std::path::Path;

use evfocus_core::CameraMicros;
use evfocus_eval::simulated_sweep::SimulatedSweep;
use serde::Serialize;

use super::Plan;
use super::frames::STEPS_PER_DN;

/// The truth file. Positions in lens counts, times in microseconds of the camera's clock.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Truth {
    /// Where the scene is sharp; the first of `positions`.
    pub(crate) position: f64,
    /// One position, or two for a scene with two depths.
    pub(crate) positions: Vec<f64>,
    /// When the glass passed the first of them.
    pub(crate) times_us: Vec<f64>,
    pub(crate) events: u64,
    /// Events that the simulated read-out or link lost.
    pub(crate) lost: u64,
    pub(crate) seed: u64,
    scene: &'static str,
    camera: String,
    width: u16,
    height: u16,
    speed_counts_per_s: f64,
    both_directions: bool,
    duration_us: i64,
    shake_px_rms: f64,
    velocity_px_per_s: f64,
    flicker_hz: Option<f64>,
    backlash_counts: f64,
    blur_px_per_count: f64,
    on_threshold: f64,
    off_threshold: f64,
    frames: Option<Frames>,
}

#[derive(Debug, Clone, Serialize)]
struct Frames {
    number: u64,
    fps: f64,
    /// A frame's value by this is the intensity in DN, 0 to 255 for scenes without lamps.
    steps_per_dn: f32,
}

impl Truth {
    pub(super) fn new(plan: &Plan, made: &SimulatedSweep, frames: Option<(u64, f64)>) -> Self {
        let SimulatedSweep { rig, glass, events, lost, .. } = made;
        let (config, truth) = (rig.config(), rig.truth());
        let first = truth.first().copied().unwrap_or(config.focus);
        Self {
            position: first.0,
            positions: truth.iter().map(|position| position.0).collect(),
            times_us: glass.crossings(first).collect(),
            events: *events,
            lost: *lost,
            seed: config.seed,
            scene: config.scene.name(),
            camera: config.sensor.model.clone(),
            width: config.sensor.geometry.width,
            height: config.sensor.geometry.height,
            speed_counts_per_s: plan.speed.counts_per_second(),
            both_directions: plan.both_directions,
            duration_us: glass.last().map_or(0, |(CameraMicros(end), _)| end),
            shake_px_rms: config.motion.shake_px_rms,
            velocity_px_per_s: config.motion.velocity_px_per_s.0,
            flicker_hz: config.flicker.map(|flicker| flicker.hertz),
            backlash_counts: config.lens.backlash,
            blur_px_per_count: config.optics.blur_px_per_count,
            on_threshold: config.sensor.on_threshold,
            off_threshold: config.sensor.off_threshold,
            frames: frames.map(|(number, fps)| Frames { number, fps, steps_per_dn: STEPS_PER_DN }),
        }
    }

    pub(super) fn write(&self, path: &Path) -> anyhow::Result<()> {
        Ok(fs::write(path, format!("{}\n", serde_json::to_string_pretty(self)?))?)
    }
}
