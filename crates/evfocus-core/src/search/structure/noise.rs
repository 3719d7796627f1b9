//! How noisy the pixels are, read off the parts of the picture in which least happens.

use alloc::vec;
use alloc::vec::Vec;

use crate::event::{Event, Window};

/// Columns and rows of a tile.
const TILE: u16 = 16;
/// How long events are counted, microseconds.
const SPAN_US: i64 = 60_000;
/// The part of all counts that is taken for noise alone.
const QUIETEST: f64 = 0.1;
/// Counts that are told apart; what is noisier is as noisy as that: 33 Hz.
const COUNTS: usize = 512;

/// Counts the OFF events of small tiles over short spans: where nothing moves they are noise. ON events would count the leakage
/// too, which does not grow as the light falls.
#[derive(Debug, Clone)]
pub struct NoiseMeter {
    columns: u16,
    rows: u16,
    window: Window,
    counts: Vec<u16>,
    span_end: Option<i64>,
    /// How many tiles and spans had each count.
    seen: Vec<u64>,
    /// The same while the lens stood still before the sweeps.
    at_rest: Vec<u64>,
}

impl NoiseMeter {
    /// A meter for the pixels of `window`. All memory is allocated here.
    pub fn new(window: Window) -> Self {
        let (columns, rows) = (window.width / TILE, window.height / TILE);
        let tiles = usize::from(columns) * usize::from(rows);
        Self {
            columns,
            rows,
            window,
            counts: vec![0; tiles],
            span_end: None,
            seen: vec![0; COUNTS],
            at_rest: vec![0; COUNTS],
        }
    }

    /// Forgets everything.
    pub fn forget(&mut self) {
        self.at_rest.fill(0);
        self.begin();
    }

    /// Begins a sweep: what was taken before, if it was at rest, counts for this sweep and for those that follow.
    pub fn begin(&mut self) {
        self.counts.fill(0);
        self.seen.copy_from_slice(&self.at_rest);
        self.span_end = None;
    }

    /// What was taken since [`forget`](Self::forget) was taken at rest: nothing but noise, if the scene is still.
    pub fn end_rest(&mut self) {
        self.at_rest.copy_from_slice(&self.seen);
    }

    /// Takes an event; times must not decrease by more than jitter.
    #[inline]
    pub fn take(&mut self, event: &Event) {
        let end = *self.span_end.get_or_insert(event.t.0 + SPAN_US);
        if event.t.0 >= end {
            self.close_spans(event.t.0, end);
        }
        let Some((x, y)) = self.window.place_of(event.x, event.y) else { return };
        let (column, row) = (x / TILE, y / TILE);
        if column < self.columns && row < self.rows {
            let place = usize::from(row) * usize::from(self.columns) + usize::from(column);
            if let Some(count) = self.counts.get_mut(place) {
                // Polarities come by chance, and a branch on them would cost more than an addition of nothing.
                *count = count.saturating_add(u16::from(!event.polarity.is_on()));
            }
        }
    }

    fn close_spans(&mut self, now: i64, end: i64) {
        for count in &mut self.counts {
            if let Some(number) = self.seen.get_mut(usize::from(*count).min(COUNTS - 1)) {
                *number += 1;
            }
            *count = 0;
        }
        let silent_spans = (now - end) / SPAN_US;
        if let Some(number) = self.seen.first_mut() {
            // A leap of the camera's clock makes many; 64 bits hold every one that there is time for.
            *number += silent_spans as u64 * self.counts.len() as u64;
        }
        self.span_end = Some(end + (silent_spans + 1) * SPAN_US);
    }

    /// Noise events per second and pixel, ON and OFF together: twice the mean OFF rate of the quietest tenth of the tiles and spans. 0
    /// for a window that holds no whole tile.
    pub fn noise_hz(&self) -> f64 {
        let all: u64 = self.seen.iter().sum();
        let quietest = QUIETEST * all as f64;
        let (mut left, mut events) = (quietest, 0.0);
        for (count, &number) in self.seen.iter().enumerate() {
            let taken = (number as f64).min(left);
            events += taken * count as f64;
            left -= taken;
        }
        if quietest <= 0.0 {
            return 0.0;
        }
        2.0 * events / quietest / (f64::from(TILE) * f64::from(TILE) * SPAN_US as f64 * 1e-6)
    }
}
