//! Pixels that fire by themselves, learnt while lens and scene rest.

use alloc::vec;
use alloc::vec::Vec;
use core::time::Duration;

use crate::event::{Event, Geometry};
use crate::event_list::Events;

/// A pixel that fires this often while the lens rests is hot, whatever the scene: shake makes tens of events a second.
const HOT_RATE_HZ: f64 = 250.0;
/// And this many times as often as the mean pixel: a scene that is busy all over has no hot pixels.
const HOT_RATIO: f64 = 20.0;
/// Fewer events than this prove nothing.
const FEWEST_EVENTS: u16 = 12;
/// If a larger share of the pixels than this looks hot, it is the scene.
const LARGEST_SHARE: f64 = 0.01;

/// Learns which pixels are hot, then tells. All memory is allocated at the start.
#[derive(Debug, Clone)]
pub struct HotPixels {
    geometry: Geometry,
    counts: Vec<u16>,
    hot: Vec<bool>,
    number: usize,
}

impl HotPixels {
    /// No pixel is hot yet.
    pub fn new(geometry: Geometry) -> Self {
        let pixels = geometry.pixels();
        Self { geometry, counts: vec![0; pixels], hot: vec![false; pixels], number: 0 }
    }

    /// Forgets what has been learnt.
    pub fn restart(&mut self) {
        self.counts.fill(0);
        self.hot.fill(false);
        self.number = 0;
    }

    fn place(&self, event: &Event) -> Option<usize> {
        let place = usize::from(event.y) * usize::from(self.geometry.width) + usize::from(event.x);
        self.geometry.contains(event.x, event.y).then_some(place)
    }

    /// Counts the events of the rest.
    pub fn observe(&mut self, events: Events<'_>) {
        for event in events.iter() {
            if let Some(count) = self.place(&event).and_then(|place| self.counts.get_mut(place)) {
                *count = count.saturating_add(1);
            }
        }
    }

    /// Decides, after a rest of `duration`.
    pub fn learn(&mut self, duration: Duration) {
        let total: u64 = self.counts.iter().map(|&count| u64::from(count)).sum();
        let mean = total as f64 / self.counts.len().max(1) as f64;
        let limit =
            (HOT_RATE_HZ * duration.as_secs_f64()).max(HOT_RATIO * mean).max(f64::from(FEWEST_EVENTS));
        self.number = 0;
        for (hot, &count) in self.hot.iter_mut().zip(&self.counts) {
            *hot = f64::from(count) >= limit;
            self.number += usize::from(*hot);
        }
        if self.number as f64 > LARGEST_SHARE * self.counts.len() as f64 {
            self.hot.fill(false);
            self.number = 0;
        }
    }

    /// How many pixels are hot.
    pub fn number(&self) -> usize {
        self.number
    }

    /// Whether `event` comes from a hot pixel.
    pub fn is_hot(&self, event: &Event) -> bool {
        self.number > 0 && self.place(event).and_then(|place| self.hot.get(place)).copied().unwrap_or(false)
    }
}
