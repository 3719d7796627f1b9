//! The simulated sensor: pixels, their noise, and the read-out, advanced on a fixed grid of time.
//!
//! Its clock counts microseconds since the rig was made; the camera's own clock and the link are the camera's business.

mod config;
mod noise;
mod pixels;
mod readout;

use rand_xoshiro::Xoshiro256PlusPlus;

pub use config::{CameraModel, Light, SensorConfig};
use noise::Noise;
use pixels::Pixels;
use readout::ReadOut;

use crate::random::Stream;

/// The grid, microseconds. Event times lie between its points, interpolated.
pub(crate) const STEP_MICROS: i64 = 1000;

/// One event on the rig's own time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Spike {
    /// Microseconds since the rig was made.
    pub(crate) micros: i64,
    /// Row times width plus column.
    pub(crate) pixel: u32,
    pub(crate) on: bool,
}

/// The sensor.
#[derive(Debug)]
pub(crate) struct Sensor {
    pixels: Pixels,
    noise: Noise,
    readout: ReadOut,
    rng: Xoshiro256PlusPlus,
}

impl Sensor {
    /// A sensor that has looked at `image` for a while.
    pub(crate) fn new(config: &SensorConfig, image: &[f32], start_micros: i64, seed: u64) -> Self {
        let mut mismatch = Stream::Mismatch.generator(seed);
        let mut rng = Stream::Noise.generator(seed);
        // Two runs of one rig that start at different times do not share their noise.
        for _ in 0..(start_micros / STEP_MICROS).rem_euclid(1021) {
            rand::Rng::next_u64(&mut rng);
        }
        Self {
            pixels: Pixels::new(config, image, &mut mismatch),
            noise: Noise::new(config, image.len(), start_micros, &mut mismatch),
            readout: ReadOut::new(config, start_micros),
            rng,
        }
    }

    /// Advances by one step, to the end of which `image` belongs. Adds the events that are read out by then, in the order of
    /// their times, to `out`; returns how many were lost.
    pub(crate) fn step(&mut self, image: &[f32], start_micros: i64, out: &mut Vec<Spike>) -> u64 {
        let spikes = self.readout.inbox();
        let first = spikes.len();
        self.pixels.step(image, start_micros, spikes, &mut self.rng);
        self.noise.step(image, start_micros, &mut self.pixels, spikes, &mut self.rng);
        self.readout.step(first, start_micros, out, &mut self.rng)
    }
}
