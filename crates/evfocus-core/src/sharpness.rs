//! How sharp the picture is at a lens at rest, from events alone.
//!
//! The event rate says how fast the scene moves, and nothing of focus. But wherever an edge passes, neighbouring pixels see the same
//! change, and how far around it they do so is the width of the edge: blur makes it wider, speed only makes it come sooner. So events
//! are gathered until a certain share of the pixels has seen one, whatever time that takes, and what is compared is how alike the
//! signs of pixels are that lie [`LAGS`] apart. Noise is alike nowhere, and a change of the light everywhere: neither counts, since the
//! pixel itself and far neighbours only set the scale.

use alloc::vec;
use alloc::vec::Vec;
use core::time::Duration;

use crate::event::{Event, Geometry, Window};
use crate::units::CameraMicros;

/// Distances at which pixels are compared, along rows and columns: the fine ones and the one that stands for "far".
const LAGS: [usize; 3] = [1, 2, 8];
/// The largest of them.
const REACH: usize = 8;
/// A picture is complete when one of so many pixels has seen an event: the scene has moved by a fraction of a pixel then.
const PIXELS_PER_EVENT: usize = 16;
/// A picture that takes longer than this is given up: it would be noise mostly.
const LONGEST_PICTURE: Duration = Duration::from_secs(1);
/// From the begin of one picture to the next: what bounds the work at high event rates.
const EVERY: Duration = Duration::from_millis(20);
/// Likeness at short distance, in standard deviations of what chance makes, from which it can be read.
const SIGNIFICANT: f64 = 12.0;
/// Pictures that a reading takes at least, so that it does not hang on a moment.
const FEWEST_PICTURES: u32 = 8;
/// Pictures that have not come to a reading by then say nothing.
const MOST_PICTURES: u32 = 200;

/// Turns events into readings of sharpness: 1 for edges as fine as a pixel, towards 0 for coarser ones. All memory is allocated at the
/// start: a byte a pixel, and four for each pixel of a picture.
#[derive(Debug, Clone)]
pub struct SharpnessMeter {
    window: Window,
    stride: usize,
    /// The sign of the last event of each pixel, 0 for none; with a margin at the right and below.
    signs: Vec<i8>,
    touched: Vec<u32>,
    enough: usize,
    began: CameraMicros,
    /// Sums over pixels of the product of signs at each lag, and how many products were not 0.
    likeness: [i64; LAGS.len()],
    pairs: u64,
    pictures: u32,
}

impl SharpnessMeter {
    /// A meter that looks at the whole of a sensor.
    pub fn new(geometry: Geometry) -> Self {
        let stride = usize::from(geometry.width) + REACH;
        let enough = geometry.pixels() / PIXELS_PER_EVENT;
        Self {
            window: Window::whole(geometry),
            stride,
            signs: vec![0; stride * (usize::from(geometry.height) + REACH)],
            touched: Vec::with_capacity(enough),
            enough,
            began: CameraMicros(i64::MIN),
            likeness: [0; LAGS.len()],
            pairs: 0,
            pictures: 0,
        }
    }

    /// Begins anew, and looks only at `window` from now on.
    pub fn look_at(&mut self, window: Window) {
        self.restart();
        self.window = window;
        let pixels = usize::from(window.width) * usize::from(window.height);
        self.enough = (pixels / PIXELS_PER_EVENT).clamp(1, self.touched.capacity());
    }

    /// Forgets all events.
    pub fn restart(&mut self) {
        self.clear_picture();
        self.began = CameraMicros(i64::MIN);
        self.forget_sums();
    }

    /// Takes events at a lens at rest; their times must not decrease. Returns the newest reading that they completed.
    pub fn take(&mut self, events: &[Event]) -> Option<f64> {
        let mut reading = None;
        let mut rest = events;
        while let Some(first) = rest.first() {
            if self.touched.is_empty() {
                let due = CameraMicros(self.began.0.saturating_add(EVERY.as_micros() as i64));
                // A camera that started anew counts from zero again.
                if first.t < due && first.t >= self.began {
                    let wait = rest.partition_point(|event| event.t < due);
                    rest = rest.get(wait.max(1)..).unwrap_or_default();
                    continue;
                }
                self.began = first.t;
            }
            let used = self.fill(rest);
            rest = rest.get(used..).unwrap_or_default();
            let newest = events.get(events.len() - rest.len() - 1).map_or(self.began, |event| event.t);
            if self.touched.len() >= self.enough {
                reading = self.read().or(reading);
            } else if newest.0.saturating_sub(self.began.0) > LONGEST_PICTURE.as_micros() as i64 {
                self.clear_picture();
            }
        }
        reading
    }

    /// Puts events into the picture until it is complete. Returns how many it took, at least one.
    fn fill(&mut self, events: &[Event]) -> usize {
        for (index, event) in events.iter().enumerate() {
            let Some((x, y)) = self.window.place_of(event.x, event.y) else { continue };
            let place = usize::from(y) * self.stride + usize::from(x);
            let Some(sign) = self.signs.get_mut(place) else { continue };
            let is_first = *sign == 0;
            *sign = 2 * event.polarity as i8 - 1;
            if is_first {
                self.touched.push(place as u32);
                if self.touched.len() >= self.enough {
                    return index + 1;
                }
            }
        }
        events.len()
    }

    /// Adds the complete picture to the sums, and reads them if they say enough.
    fn read(&mut self) -> Option<f64> {
        let sign = |place: usize| self.signs.get(place).copied().unwrap_or(0);
        for &place in &self.touched {
            let place = place as usize;
            let here = i64::from(sign(place));
            for (sum, lag) in self.likeness.iter_mut().zip(LAGS) {
                *sum += here * i64::from(sign(place + lag) + sign(place + lag * self.stride));
            }
            self.pairs += u64::from(sign(place + 1) != 0) + u64::from(sign(place + self.stride) != 0);
        }
        self.clear_picture();
        self.pictures += 1;
        let [near, middle, far] = self.likeness.map(|sum| sum as f64);
        let significant = near - far > SIGNIFICANT * libm::sqrt(2.0 * self.pairs as f64);
        let reading =
            (significant && self.pictures >= FEWEST_PICTURES).then(|| (near - middle) / (near - far));
        if reading.is_some() || self.pictures >= MOST_PICTURES {
            self.forget_sums();
        }
        reading
    }

    fn clear_picture(&mut self) {
        for &place in &self.touched {
            if let Some(sign) = self.signs.get_mut(place as usize) {
                *sign = 0;
            }
        }
        self.touched.clear();
    }

    fn forget_sums(&mut self) {
        self.likeness = [0; LAGS.len()];
        (self.pairs, self.pictures) = (0, 0);
    }
}
