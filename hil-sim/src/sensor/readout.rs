//! The read-out: latency and jitter, order of time, a limited rate and a limited queue.

use std::collections::VecDeque;

use rand::RngExt;
use rand_distr::StandardNormal;
use rand_xoshiro::Xoshiro256PlusPlus;

use super::config::SensorConfig;
use super::rate_cap::Gate;
use super::{Dropped, STEP_MICROS, Spike};

/// Jitter goes no further than this many standard deviations.
const JITTER_LIMIT: f64 = 3.0;

/// From the pixels to the time-stamped stream.
#[derive(Debug)]
pub(super) struct ReadOut {
    /// Spikes whose latency has not passed yet, in no order.
    waiting: Vec<Spike>,
    /// Read-out spikes whose time stamp lies beyond the step.
    queue: VecDeque<Spike>,
    ordered: Vec<Spike>,
    buckets: Vec<u32>,
    gate: Option<Gate>,
    latency: f64,
    jitter: f64,
    service_micros: f64,
    capacity: f64,
    /// When the read-out is done with what it has, microseconds.
    free_micros: f64,
}

impl ReadOut {
    pub(super) fn new(config: &SensorConfig, start_micros: i64) -> Self {
        Self {
            waiting: Vec::new(),
            queue: VecDeque::new(),
            ordered: Vec::new(),
            buckets: Vec::new(),
            gate: config.rate_cap.map(Gate::new),
            latency: config.latency.as_secs_f64() * 1e6,
            jitter: config.jitter.as_secs_f64() * 1e6,
            service_micros: 1e6 / config.readout_events_per_s,
            capacity: f64::from(config.readout_queue),
            free_micros: start_micros as f64,
        }
    }

    /// Where the pixels put their spikes.
    pub(super) fn inbox(&mut self) -> &mut Vec<Spike> {
        &mut self.waiting
    }

    /// Reads out what is due by the end of the step; spikes in the inbox from index `first` on are new.
    pub(super) fn step(
        &mut self,
        first: usize,
        start_micros: i64,
        out: &mut Vec<Spike>,
        rng: &mut Xoshiro256PlusPlus,
    ) -> Dropped {
        for spike in &mut self.waiting[first..] {
            let deviation = rng.sample::<f64, _>(StandardNormal).clamp(-JITTER_LIMIT, JITTER_LIMIT);
            spike.micros += (self.latency + self.jitter * deviation).max(0.0) as i64;
        }
        self.order(start_micros);
        let end = start_micros + STEP_MICROS;
        let mut dropped = Dropped::default();
        for &spike in &self.ordered {
            if self.gate.as_mut().is_some_and(|gate| !gate.passes(&spike)) {
                dropped.by_cap += 1;
                continue;
            }
            let start = self.free_micros.max(spike.micros as f64);
            if start - spike.micros as f64 > self.capacity * self.service_micros {
                dropped.by_queue += 1;
                continue;
            }
            self.free_micros = start + self.service_micros;
            self.queue.push_back(Spike { micros: start as i64, ..spike });
        }
        let due = self.queue.partition_point(|spike| spike.micros < end);
        out.extend(self.queue.drain(..due));
        dropped
    }

    /// Moves the spikes of this step from the inbox to `ordered`, by time; equal times keep their order. They all lie
    /// within the step, since earlier ones went with an earlier step: so each microsecond is a bucket.
    fn order(&mut self, start_micros: i64) {
        let bucket = |spike: &Spike| (spike.micros - start_micros).max(0) as usize;
        let steps = STEP_MICROS as usize;
        self.buckets.clear();
        self.buckets.resize(steps + 1, 0);
        for spike in &self.waiting {
            if let Some(count) = self.buckets.get_mut(bucket(spike) + 1) {
                *count += 1;
            }
        }
        for index in 0..steps {
            self.buckets[index + 1] += self.buckets[index];
        }
        let total = self.buckets[steps] as usize;
        self.ordered.clear();
        self.ordered.resize(total, Spike { micros: 0, pixel: 0, on: false });
        let (buckets, ordered) = (&mut self.buckets, &mut self.ordered);
        self.waiting.retain(|spike| {
            let bucket = bucket(spike);
            if bucket >= steps {
                return true;
            }
            ordered[buckets[bucket] as usize] = *spike;
            buckets[bucket] += 1;
            false
        });
    }
}
