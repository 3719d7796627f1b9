//! What the control thread counts while it works: single numbers that others may read at any time.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Upper ends of the latencies that are told apart, microseconds.
pub(crate) const LATENCIES_US: [u64; 10] =
    [100, 250, 500, 1_000, 2_500, 5_000, 10_000, 25_000, 100_000, 1_000_000];

/// The numbers. Clones share them.
#[derive(Debug, Clone, Default)]
pub(crate) struct Vitals(Arc<Numbers>);

#[derive(Debug, Default)]
struct Numbers {
    beats: AtomicU64,
    batches_high: AtomicU64,
    samples_high: AtomicU64,
    /// One more than there are limits, for what is above all.
    latencies: [AtomicU64; LATENCIES_US.len() + 1],
    latency_sum_us: AtomicU64,
}

impl Vitals {
    /// The control thread has passed through its loop once more: what the watchdog goes by.
    pub(crate) fn beat(&self) {
        self.0.beats.fetch_add(1, Ordering::Relaxed);
    }

    /// The passes so far.
    pub(crate) fn beats(&self) -> u64 {
        self.0.beats.load(Ordering::Relaxed)
    }

    /// So many batches and lens samples were waiting.
    pub(crate) fn waiting(&self, batches: usize, samples: usize) {
        self.0.batches_high.fetch_max(batches as u64, Ordering::Relaxed);
        self.0.samples_high.fetch_max(samples as u64, Ordering::Relaxed);
    }

    /// The most batches and the most lens samples that ever waited.
    pub(crate) fn most_waiting(&self) -> (u64, u64) {
        (self.0.batches_high.load(Ordering::Relaxed), self.0.samples_high.load(Ordering::Relaxed))
    }

    /// A batch was handled so long after its arrival.
    pub(crate) fn latency(&self, latency: Duration) {
        let us = latency.as_micros() as u64;
        let place = LATENCIES_US.partition_point(|&limit| limit < us);
        if let Some(count) = self.0.latencies.get(place) {
            count.fetch_add(1, Ordering::Relaxed);
        }
        self.0.latency_sum_us.fetch_add(us, Ordering::Relaxed);
    }

    /// How many batches took up to each of [`LATENCIES_US`], and more than all; and the sum, microseconds.
    pub(crate) fn latencies(&self) -> (Vec<u64>, u64) {
        let counts = self.0.latencies.iter().map(|count| count.load(Ordering::Relaxed)).collect();
        (counts, self.0.latency_sum_us.load(Ordering::Relaxed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_latency_falls_under_the_first_limit_that_it_does_not_exceed() {
        let vitals = Vitals::default();
        for us in [0, 100, 101, 2_000_000] {
            vitals.latency(Duration::from_micros(us));
        }
        let (counts, sum) = vitals.latencies();
        assert_eq!((counts[0], counts[1], counts[LATENCIES_US.len()], sum), (2, 1, 1, 2_000_201));
    }

    #[test]
    fn high_water_stays_where_it_was() {
        let vitals = Vitals::default();
        vitals.waiting(5, 1);
        vitals.waiting(2, 3);
        assert_eq!(vitals.most_waiting(), (5, 3));
    }
}
