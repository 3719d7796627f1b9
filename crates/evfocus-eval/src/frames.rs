//! Frames as the frame camera beside the event pixels takes them: motion blur over the exposure, read noise, 8 bits.

use std::time::Duration;

use evfocus_core::{CameraMicros, Geometry, HostMicros};
use hil_sim::{Light, Rig};
use rand_distr::{Distribution, Normal, NormalError};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

use crate::GreyImage;

/// How frames are taken. The paper says nothing of exposure and rate; these are what a DAVIS346's frames look like, and the dark ones are
/// as dim, noisy and blurred as the paper's figures show them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameConfig {
    /// Frames per second; a DAVIS346 makes 25 to 40.
    pub per_second: f64,
    /// How long light is gathered; the picture is the mean over this time.
    pub exposure: Duration,
    /// Share of the light that the sensor makes use of: 1 where white is 255 DN.
    pub gain: f64,
    /// Noise of each pixel of each frame, DN RMS.
    pub read_noise_dn: f64,
    /// Instants that the exposure is made up of.
    pub instants: u32,
}

impl FrameConfig {
    /// The frames of a DAVIS346: 30 a second; in light exposed for 8 ms, in the dark for as long as the rate allows, and dim all the same.
    pub fn davis346(light: Light) -> Self {
        let in_light = Self {
            per_second: 30.0,
            exposure: Duration::from_millis(8),
            gain: 1.0,
            read_noise_dn: 2.0,
            instants: 6,
        };
        match light {
            Light::Light => in_light,
            Light::Dark => {
                Self { exposure: Duration::from_millis(30), gain: 0.06, read_noise_dn: 3.0, ..in_light }
            }
        }
    }
}

/// A series of frames.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Frames {
    /// Columns of each frame.
    pub width: usize,
    /// The middle of each exposure.
    pub times: Vec<CameraMicros>,
    /// Values of 8 bits, frame by frame, row by row.
    pub bytes: Vec<u8>,
}

impl Frames {
    /// The frames with their times.
    pub fn iter(&self) -> impl Iterator<Item = (CameraMicros, GreyImage)> + '_ {
        let length = (self.bytes.len() / self.times.len().max(1)).max(1);
        let pictures = self.bytes.chunks_exact(length);
        self.times.iter().zip(pictures).map(|(&time, bytes)| (time, GreyImage::from_bytes(self.width, bytes)))
    }
}

/// Takes frames while a rig is simulated.
#[derive(Debug)]
pub struct FrameCamera {
    config: FrameConfig,
    noise: Normal<f64>,
    rng: Xoshiro256PlusPlus,
    frames: Frames,
}

impl FrameCamera {
    /// A camera for a sensor of `geometry` whose noise follows from `seed`.
    ///
    /// # Errors
    /// A read noise that is not a number.
    pub fn new(config: FrameConfig, geometry: Geometry, seed: u64) -> Result<Self, NormalError> {
        Ok(Self {
            config,
            noise: Normal::new(0.0, config.read_noise_dn)?,
            rng: Xoshiro256PlusPlus::seed_from_u64(seed),
            frames: Frames { width: geometry.width.into(), ..Frames::default() },
        })
    }

    /// Takes the frames whose exposure is over by `now`.
    pub fn take_until(&mut self, now: HostMicros, rig: &Rig) {
        let exposure = self.config.exposure.as_secs_f64() * 1e6;
        loop {
            let start = self.frames.times.len() as f64 / self.config.per_second * 1e6;
            if start + exposure > now.0 as f64 {
                return;
            }
            self.take(start, exposure, rig);
        }
    }

    fn take(&mut self, start: f64, exposure: f64, rig: &Rig) {
        let mut light: Vec<f32> = Vec::new();
        for instant in 0..self.config.instants.max(1) {
            let share = (f64::from(instant) + 0.5) / f64::from(self.config.instants.max(1));
            let time = HostMicros((start + share * exposure) as i64);
            let seen = rig.intensity_frame(time, rig.glass(time));
            light.resize(seen.len(), 0.0);
            for (sum, seen) in light.iter_mut().zip(seen) {
                *sum += seen;
            }
        }
        let gain = self.config.gain / f64::from(self.config.instants.max(1));
        for sum in light {
            let level = gain * f64::from(sum) + self.noise.sample(&mut self.rng);
            // The conversion saturates at both ends.
            self.frames.bytes.push(level.round() as u8);
        }
        self.frames.times.push(CameraMicros((start + exposure / 2.0) as i64));
    }

    /// The frames taken.
    pub fn into_frames(self) -> Frames {
        self.frames
    }
}
