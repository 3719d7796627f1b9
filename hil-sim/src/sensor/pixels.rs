//! The pixels: logarithm, limited bandwidth, memory of the last event, two thresholds, refractory time, leak.

use rand::RngExt;
use rand_distr::StandardNormal;
use rand_xoshiro::Xoshiro256PlusPlus;

use super::config::SensorConfig;
use super::response::Response;
use super::{STEP_MICROS, Spike};

/// Pixels that are worked on together.
const LANES: usize = 32;

/// The leak of a group of pixels is booked once in this many steps: it moves the memory by much less than a threshold.
const LEAK_STEPS: usize = 16;

/// Smallest threshold of any pixel.
const LEAST_THRESHOLD: f64 = 0.01;

/// All pixels of a sensor, as arrays. The last group is filled up with pixels that never fire.
#[derive(Debug)]
pub(super) struct Pixels {
    count: usize,
    /// Logarithm of the intensity behind the low-pass, or behind both of them.
    level: Vec<f32>,
    /// The same between the two; empty without a second one.
    receptor: Vec<f32>,
    /// The level at which the next ON event is due: memory plus threshold.
    upper: Vec<f32>,
    /// The level at which the next OFF event is due.
    lower: Vec<f32>,
    on_threshold: Vec<f32>,
    off_threshold: Vec<f32>,
    /// Fall of the memory in `LEAK_STEPS` steps.
    leak: Vec<f32>,
    /// Time of the last event, microseconds.
    last: Vec<i64>,
    refractory: i64,
    response: Response,
    /// Standard deviation of the thresholds from one event to the next.
    threshold_jitter: f32,
    steps: usize,
}

impl Pixels {
    pub(super) fn new(config: &SensorConfig, image: &[f32], rng: &mut Xoshiro256PlusPlus) -> Self {
        let count = image.len();
        let padded = count.next_multiple_of(LANES);
        let step = STEP_MICROS as f64 * 1e-6;
        let mut pixels = Self {
            count,
            level: vec![0.0; padded],
            receptor: Vec::new(),
            upper: vec![f32::MAX; padded],
            lower: vec![f32::MIN; padded],
            on_threshold: vec![1.0; padded],
            off_threshold: vec![1.0; padded],
            leak: vec![0.0; padded],
            last: vec![i64::MIN / 2; padded],
            refractory: config.refractory.as_micros() as i64,
            response: Response::new(config),
            threshold_jitter: config.threshold_jitter as f32,
            steps: 0,
        };
        for (index, &intensity) in image.iter().enumerate() {
            let mut threshold = |nominal: f64| {
                let deviation: f64 = rng.sample(StandardNormal);
                (nominal + config.threshold_mismatch * deviation).max(LEAST_THRESHOLD) as f32
            };
            let (on, off) = (threshold(config.on_threshold), threshold(config.off_threshold));
            let decades: f64 = rng.sample(StandardNormal);
            let leak_hz = config.leak_hz * 10_f64.powf(config.leak_spread_decades * decades);
            let level = pixels.response.logarithm(intensity);
            // After a long time before the scene the memory lies anywhere between the thresholds.
            let memory = level - on + rng.random::<f32>() * (on + off);
            pixels.level[index] = level;
            pixels.on_threshold[index] = on;
            pixels.off_threshold[index] = off;
            pixels.upper[index] = memory + on;
            pixels.lower[index] = memory - off;
            pixels.leak[index] = (leak_hz * f64::from(on) * step * LEAK_STEPS as f64) as f32;
        }
        if config.source_follower_hz.is_some() {
            pixels.receptor.clone_from(&pixels.level);
        }
        pixels
    }

    /// Time from which on the pixel may fire again.
    pub(super) fn ready(&self, pixel: usize) -> i64 {
        self.last[pixel] + self.refractory
    }

    /// Books an event that has another cause than the light.
    pub(super) fn fired(&mut self, pixel: usize, micros: i64) {
        self.last[pixel] = micros;
    }

    /// Advances by one step, to the end of which `image` belongs, and adds the crossings to `spikes`.
    pub(super) fn step(
        &mut self,
        image: &[f32],
        start_micros: i64,
        spikes: &mut Vec<Spike>,
        rng: &mut Xoshiro256PlusPlus,
    ) {
        let leaking = self.steps % LEAK_STEPS;
        self.steps += 1;
        let response = self.response;
        let mut padding = [0.0; LANES];
        for group in 0..self.level.len() / LANES {
            let first = group * LANES;
            let range = first..first + LANES;
            if group % LEAK_STEPS == leaking {
                let (upper, lower) = (&mut self.upper[range.clone()], &mut self.lower[range.clone()]);
                for ((upper, lower), leak) in upper.iter_mut().zip(lower).zip(&self.leak[range.clone()]) {
                    *upper -= leak;
                    *lower -= leak;
                }
            }
            let light = image.get(range.clone()).unwrap_or_else(|| {
                let rest = &image[first..];
                padding[..rest.len()].copy_from_slice(rest);
                &padding
            });
            let mut before = [0.0; LANES];
            let level = &mut self.level[range.clone()];
            before.copy_from_slice(level);
            let (upper, lower) = (&self.upper[range.clone()], &self.lower[range.clone()]);
            let reached = match self.receptor.get_mut(range) {
                Some(receptor) => follow(level, receptor, light, (upper, lower), response),
                None => advance(level, light, upper, lower, response),
            };
            if reached {
                self.cross(first, &before, start_micros, spikes, rng);
            }
        }
    }

    /// The events of one group.
    fn cross(
        &mut self,
        first: usize,
        before: &[f32; LANES],
        start_micros: i64,
        spikes: &mut Vec<Spike>,
        rng: &mut Xoshiro256PlusPlus,
    ) {
        let end_micros = start_micros + STEP_MICROS;
        for (pixel, &before) in (first..self.count.min(first + LANES)).zip(before) {
            let level = self.level[pixel];
            let on = level >= self.upper[pixel];
            if !on && level > self.lower[pixel] {
                continue;
            }
            let threshold = if on { self.on_threshold[pixel] } else { -self.off_threshold[pixel] };
            let mut due = if on { self.upper[pixel] } else { self.lower[pixel] };
            let mut moved = 0.0;
            while (level >= due) == on || (level - due).abs() <= 0.0 {
                // Already beyond at the beginning: a leak booked for this step, or the end of a refractory time.
                let late = (before >= due) == on;
                let share = if late { rng.random::<f32>() } else { (due - before) / (level - before) };
                let crossing = start_micros + (share * STEP_MICROS as f32) as i64;
                let ready = self.ready(pixel);
                let micros = if late && ready > start_micros { ready } else { crossing.max(ready) };
                if micros >= end_micros {
                    break;
                }
                spikes.push(Spike { micros, pixel: pixel as u32, on });
                self.last[pixel] = micros;
                if self.threshold_jitter > 0.0 {
                    due = self.redraw(pixel, due, on, rng);
                } else {
                    due += threshold;
                    moved += threshold;
                }
            }
            self.upper[pixel] += moved;
            self.lower[pixel] += moved;
        }
    }

    /// Draws both thresholds of a pixel anew about the level that it has just crossed; returns the one on the side of `on`.
    fn redraw(&mut self, pixel: usize, memory: f32, on: bool, rng: &mut Xoshiro256PlusPlus) -> f32 {
        let mut drawn = |nominal: f32| {
            let deviation: f32 = rng.sample(StandardNormal);
            (nominal + self.threshold_jitter * deviation).max(LEAST_THRESHOLD as f32)
        };
        let (rise, fall) = (drawn(self.on_threshold[pixel]), drawn(self.off_threshold[pixel]));
        self.upper[pixel] = memory + rise;
        self.lower[pixel] = memory - fall;
        if on { self.upper[pixel] } else { self.lower[pixel] }
    }
}

/// Passes `light` through the photoreceptor on to `level`; whether any pixel has reached a threshold.
fn advance(level: &mut [f32], light: &[f32], upper: &[f32], lower: &[f32], response: Response) -> bool {
    let mut reached = 0;
    for ((((level, &light), &upper), &lower), _) in
        level.iter_mut().zip(light).zip(upper).zip(lower).zip(0..LANES)
    {
        *level = response.receive(*level, light);
        reached |= u32::from(*level >= upper) | u32::from(*level <= lower);
    }
    reached != 0
}

/// The same through a source follower behind the photoreceptor.
fn follow(
    level: &mut [f32],
    receptor: &mut [f32],
    light: &[f32],
    (upper, lower): (&[f32], &[f32]),
    response: Response,
) -> bool {
    let mut reached = 0;
    for ((((level, receptor), &light), &upper), &lower) in
        level.iter_mut().zip(receptor).zip(light).zip(upper).zip(lower)
    {
        *receptor = response.receive(*receptor, light);
        *level = response.follow(*level, *receptor);
        reached |= u32::from(*level >= upper) | u32::from(*level <= lower);
    }
    reached != 0
}
