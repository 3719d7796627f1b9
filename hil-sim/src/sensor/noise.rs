//! Events without cause: shot noise and hot pixels.

use rand::RngExt;
use rand_distr::{Distribution, Exp1, Poisson};
use rand_xoshiro::Xoshiro256PlusPlus;

use super::config::SensorConfig;
use super::pixels::Pixels;
use super::{STEP_MICROS, Spike};

/// The causeless events of one sensor.
#[derive(Debug)]
pub(super) struct Noise {
    /// Draws per step at the highest rate of any pixel; `None` if there is no noise.
    draws: Option<Poisson<f64>>,
    black_hz: f64,
    white_hz: f64,
    hot: Vec<HotPixel>,
    hot_interval_micros: f64,
}

#[derive(Debug)]
struct HotPixel {
    pixel: usize,
    next_micros: f64,
}

impl Noise {
    pub(super) fn new(
        config: &SensorConfig,
        pixels: usize,
        start_micros: i64,
        rng: &mut Xoshiro256PlusPlus,
    ) -> Self {
        let (black_hz, white_hz) = (config.shot_noise_black_hz, config.shot_noise_white_hz);
        let most = black_hz.max(white_hz) * pixels as f64 * STEP_MICROS as f64 * 1e-6;
        let hot_interval_micros = 1e6 / config.hot_pixel_hz;
        let hot = (0..config.hot_pixels).map(|_| HotPixel {
            pixel: rng.random_range(0..pixels),
            next_micros: start_micros as f64 + rng.sample::<f64, _>(Exp1) * hot_interval_micros,
        });
        Self { draws: Poisson::new(most).ok(), black_hz, white_hz, hot: hot.collect(), hot_interval_micros }
    }

    /// Adds the noise of one step to `spikes`.
    pub(super) fn step(
        &mut self,
        image: &[f32],
        start_micros: i64,
        pixels: &mut Pixels,
        spikes: &mut Vec<Spike>,
        rng: &mut Xoshiro256PlusPlus,
    ) {
        let most = self.black_hz.max(self.white_hz);
        let draws = self.draws.map_or(0.0, |draws| draws.sample(rng)) as u64;
        for _ in 0..draws {
            let pixel = rng.random_range(0..image.len());
            let brightness = f64::from(image[pixel]).min(255.0) / 255.0;
            let hertz = self.black_hz + brightness * (self.white_hz - self.black_hz);
            let micros = start_micros + rng.random_range(0..STEP_MICROS);
            let on = rng.random::<bool>();
            if rng.random::<f64>() * most < hertz && micros >= pixels.ready(pixel) {
                pixels.fired(pixel, micros);
                spikes.push(Spike { micros, pixel: pixel as u32, on });
            }
        }
        let end = (start_micros + STEP_MICROS) as f64;
        for hot in &mut self.hot {
            while hot.next_micros < end {
                let micros = hot.next_micros as i64;
                if micros >= pixels.ready(hot.pixel) {
                    pixels.fired(hot.pixel, micros);
                    spikes.push(Spike { micros, pixel: hot.pixel as u32, on: rng.random() });
                }
                hot.next_micros += rng.sample::<f64, _>(Exp1) * self.hot_interval_micros;
            }
        }
    }
}
