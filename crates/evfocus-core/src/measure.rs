//! Focus measures: how sharp the picture was during an interval of time.

use alloc::vec;
use alloc::vec::Vec;

use crate::counter::{CounterError, CumulativeCounter};
use crate::event::Geometry;
use crate::event_store::EventStore;
use crate::units::EventRate;

/// `er`: the events in the interval by its length, as the authors' published code scores it; the paper's F_ev with the
/// per-pixel rates added up instead of squared.
///
/// # Errors
/// [`CounterError`] if the counter does not cover the interval, or if it has no length.
pub fn event_rate(counter: &CumulativeCounter, from_us: f64, to_us: f64) -> Result<EventRate, CounterError> {
    if to_us <= from_us {
        return Err(CounterError::NotAnInterval { from_us, to_us });
    }
    Ok(EventRate(counter.count_between(from_us, to_us)?.total() / ((to_us - from_us) * 1e-6)))
}

/// Room to count events per pixel; allocated once.
#[derive(Debug, Clone)]
pub struct PixelCounts {
    geometry: Geometry,
    counts: Vec<u32>,
}

impl PixelCounts {
    /// Counters for every pixel of `geometry`.
    pub fn new(geometry: Geometry) -> Self {
        Self { geometry, counts: vec![0; geometry.pixels()] }
    }

    /// `er-squared`: the sum over all pixels of the squared event rate of the pixel, in (events/s)^2; the paper's F_ev with
    /// R(x, t) the events of pixel x in the interval by its length. Reads the events of the interval twice: once to count,
    /// once to clear, so the cost does not depend on the number of pixels.
    pub fn event_rate_squared(&mut self, store: &EventStore, from_us: f64, to_us: f64) -> f64 {
        let events = store.first_at_or_after(from_us)..store.first_at_or_after(to_us);
        let mut sum_of_squares: u64 = 0;
        for index in events.clone() {
            if let Some(count) = self.pixel(store, index) {
                // n^2 = 1 + 3 + 5 + ... + (2n - 1)
                sum_of_squares += 2 * u64::from(*count) + 1;
                *count += 1;
            }
        }
        for index in events {
            if let Some(count) = self.pixel(store, index) {
                *count = 0;
            }
        }
        let seconds = (to_us - from_us) * 1e-6;
        sum_of_squares as f64 / (seconds * seconds)
    }

    fn pixel(&mut self, store: &EventStore, index: usize) -> Option<&mut u32> {
        let event = store.get(index)?;
        let place = usize::from(event.y) * usize::from(self.geometry.width) + usize::from(event.x);
        self.counts.get_mut(place).filter(|_| self.geometry.contains(event.x, event.y))
    }
}
