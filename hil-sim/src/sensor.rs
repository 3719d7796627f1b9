//! The simulated sensor: pixels, their noise, and the read-out, advanced on a fixed grid of time.
//!
//! Its clock counts microseconds since the rig was made; the camera's own clock and the link are the camera's business.

mod config;
mod foreign;
mod noise;
mod patches;
mod pixels;
mod rate_cap;
mod readout;
mod response;

use rand_xoshiro::Xoshiro256PlusPlus;

pub use config::{CameraModel, Light, SensorConfig};
use noise::Noise;
pub use patches::PatchNoise;
use patches::Patches;
use pixels::Pixels;
pub use rate_cap::RateCap;
use readout::ReadOut;
pub use response::Logarithm;

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

/// Events of one step that did not come out of the sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Dropped {
    /// Found the queue of the read-out full: the camera reports them.
    pub(crate) by_queue: u64,
    /// Above the rate cap: the camera says nothing.
    pub(crate) by_cap: u64,
}

/// The sensor.
#[derive(Debug)]
pub(crate) struct Sensor {
    pixels: Pixels,
    noise: Noise,
    patches: Option<Patches>,
    readout: ReadOut,
    rng: Xoshiro256PlusPlus,
}

impl Sensor {
    /// A sensor that has looked at `image` for a while.
    pub(crate) fn new(config: &SensorConfig, image: &[f32], start_micros: i64, seed: u64) -> Self {
        let mut mismatch = Stream::Mismatch.generator(seed);
        let noise = |stream: Stream| {
            let mut rng = stream.generator(seed);
            // Two runs of one rig that start at different times do not share their noise.
            for _ in 0..(start_micros / STEP_MICROS).rem_euclid(1021) {
                rand::Rng::next_u64(&mut rng);
            }
            rng
        };
        Self {
            pixels: Pixels::new(config, image, &mut mismatch),
            noise: Noise::new(config, image.len(), start_micros, &mut mismatch),
            patches: Patches::new(config, noise(Stream::PatchNoise)),
            readout: ReadOut::new(config, start_micros),
            rng: noise(Stream::Noise),
        }
    }

    /// Advances by one step, to the end of which `image` belongs. Adds the events that are read out by then, in the order of
    /// their times, to `out`.
    pub(crate) fn step(&mut self, image: &[f32], start_micros: i64, out: &mut Vec<Spike>) -> Dropped {
        let spikes = self.readout.inbox();
        let first = spikes.len();
        self.pixels.step(image, start_micros, spikes, &mut self.rng);
        self.noise.step(image, start_micros, &mut self.pixels, spikes, &mut self.rng);
        if let Some(patches) = &mut self.patches {
            patches.step(start_micros, &mut self.pixels, spikes);
        }
        self.readout.step(first, start_micros, out, &mut self.rng)
    }
}
