//! Noise that neighbours share: brightness that wanders in patches of a few pixels.

use rand::RngExt;
use rand_distr::{Distribution, Poisson};
use rand_xoshiro::Xoshiro256PlusPlus;

use super::config::SensorConfig;
use super::pixels::Pixels;
use super::{STEP_MICROS, Spike};
use crate::ConfigError;

/// How long a change of brightness takes; each pixel of the patch crosses its threshold at its own moment of it.
const CHANGE_MICROS: i64 = 10_000;

/// Slow fluctuations of the brightness, common to the pixels of a patch and independent between patches.
///
/// Each patch rises by a threshold and falls back again at random times (a random telegraph signal): all its pixels fire
/// once, within 10 ms, ON and OFF in turn. The spectrum is flat up to `events_hz` / pi and falls beyond. As with shot noise
/// the pixels' memory of the light stays as it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PatchNoise {
    /// Events per second of each pixel, both polarities together; 0.01 to 100.
    pub events_hz: f64,
    /// Side of a patch, pixels; 1 to 64.
    pub patch_px: u16,
}

impl PatchNoise {
    pub(super) fn validate(self) -> Result<(), ConfigError> {
        ConfigError::check("sensor.patch_noise.events_hz", self.events_hz, 0.01, 100.0)?;
        ConfigError::check("sensor.patch_noise.patch_px", f64::from(self.patch_px), 1.0, 64.0)
    }
}

/// The patches of one sensor.
#[derive(Debug)]
pub(super) struct Patches {
    side: usize,
    width: usize,
    height: usize,
    columns: usize,
    /// Whether each patch is in its brighter state.
    bright: Vec<bool>,
    /// Changes of all patches in one step.
    changes: Poisson<f64>,
    /// Spikes of changes under way.
    pending: Vec<Spike>,
    rng: Xoshiro256PlusPlus,
}

impl Patches {
    /// Nothing if the sensor has no such noise.
    pub(super) fn new(config: &SensorConfig, mut rng: Xoshiro256PlusPlus) -> Option<Self> {
        let noise = config.patch_noise?;
        let (width, height) = (usize::from(config.geometry.width), usize::from(config.geometry.height));
        let side = usize::from(noise.patch_px);
        let columns = width.div_ceil(side);
        let bright: Vec<bool> = (0..columns * height.div_ceil(side)).map(|_| rng.random()).collect();
        let mean = noise.events_hz * bright.len() as f64 * STEP_MICROS as f64 * 1e-6;
        let changes = Poisson::new(mean).ok()?;
        Some(Self { side, width, height, columns, bright, changes, pending: Vec::new(), rng })
    }

    /// Adds the noise of one step to `spikes`.
    pub(super) fn step(&mut self, start_micros: i64, pixels: &mut Pixels, spikes: &mut Vec<Spike>) {
        for _ in 0..self.changes.sample(&mut self.rng) as u64 {
            self.change(start_micros);
        }
        let end_micros = start_micros + STEP_MICROS;
        self.pending.retain(|spike| {
            let due = spike.micros < end_micros;
            if due && spike.micros >= pixels.ready(spike.pixel as usize) {
                pixels.fired(spike.pixel as usize, spike.micros);
                spikes.push(*spike);
            }
            !due
        });
    }

    /// A patch changes from now on.
    fn change(&mut self, start_micros: i64) {
        let patch = self.rng.random_range(0..self.bright.len());
        self.bright[patch] = !self.bright[patch];
        let on = self.bright[patch];
        let begin = start_micros + self.rng.random_range(0..STEP_MICROS);
        let (left, top) = (patch % self.columns * self.side, patch / self.columns * self.side);
        for y in top..self.height.min(top + self.side) {
            for x in left..self.width.min(left + self.side) {
                let micros = begin + self.rng.random_range(0..CHANGE_MICROS);
                self.pending.push(Spike { micros, pixel: (y * self.width + x) as u32, on });
            }
        }
    }
}
