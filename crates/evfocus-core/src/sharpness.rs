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

use crate::event::{Geometry, Window};
use crate::event_list::Events;
use crate::units::CameraMicros;

/// Distances at which pixels are compared, along rows and columns: the fine ones and the one that stands for "far".
const LAGS: [usize; 3] = [1, 2, 8];
/// The largest of them.
const REACH: usize = 8;
/// A picture is complete when one of so many pixels has seen an event: the scene has moved by a fraction of a pixel then.
const PIXELS_PER_EVENT: usize = 16;
/// Or, of a small window, so many pixels.
const FEWEST_PIXELS: usize = 256;
/// A picture that takes longer than this is given up: it would be noise mostly.
const LONGEST_PICTURE: Duration = Duration::from_secs(1);
/// From the begin of one picture to the next: what bounds the work at high event rates.
const EVERY: Duration = Duration::from_millis(20);
/// Likeness at short distance, in standard deviations of what chance makes, from which it can be read.
const SIGNIFICANT: f64 = 12.0;
/// Pictures that a reading takes at least, so that it does not hang on a moment.
const FEWEST_PICTURES: u32 = 16;
/// Pictures that have not come to a reading by then say nothing.
const MOST_PICTURES: u32 = 200;

/// How many pixels with an event make a picture of `pixels`.
fn pixels_of_picture(pixels: usize) -> usize {
    (pixels / PIXELS_PER_EVENT).max(FEWEST_PIXELS).min(pixels / 2).max(1)
}

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
        let enough = pixels_of_picture(geometry.pixels());
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
        // Of what was allocated for the whole.
        let pixels = usize::from(window.width) * usize::from(window.height);
        self.enough = pixels_of_picture(pixels).min(self.touched.capacity());
    }

    /// Forgets all events.
    pub fn restart(&mut self) {
        self.clear_picture();
        self.began = CameraMicros(i64::MIN);
        self.forget_sums();
    }

    /// Takes events at a lens at rest; their times must not decrease. Returns the newest reading that they completed.
    pub fn take(&mut self, events: Events<'_>) -> Option<f64> {
        let mut reading = None;
        let mut rest = events;
        while let Some(first) = rest.first() {
            if self.touched.is_empty() {
                let due = CameraMicros(self.began.0.saturating_add(EVERY.as_micros() as i64));
                // A camera that started anew counts from zero again.
                if first.t < due && first.t >= self.began {
                    rest = rest.from(rest.first_at_or_after(due).max(1));
                    continue;
                }
                self.began = first.t;
            }
            let used = self.fill(rest);
            rest = rest.from(used);
            let newest = events.at(events.len() - rest.len() - 1).map_or(self.began, |event| event.t);
            if self.touched.len() >= self.enough {
                reading = self.read().or(reading);
            } else if newest.0.saturating_sub(self.began.0) > LONGEST_PICTURE.as_micros() as i64 {
                self.clear_picture();
            }
        }
        reading
    }

    /// Puts events into the picture until it is complete. Returns how many it took, at least one.
    fn fill(&mut self, events: Events<'_>) -> usize {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::{Event, Polarity};
    use crate::event_list::EventList;

    const GEOMETRY: Geometry = Geometry { width: 160, height: 120 };

    /// Events of a second from stripes of `stripe` pixels that move on and on, so that events of one sign sweep over them; `share` of
    /// them, the rest is noise.
    fn events(rate: u64, stripe: u64, share: f64) -> Vec<Event> {
        let mut random: u64 = 0x9E37_79B9_7F4A_7C15;
        let mut next = || {
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            random >> 8
        };
        let event = |index: u64| {
            let (x, y) = (next() % 160, next() % 120);
            let is_noise = (next() % 1000) as f64 >= 1000.0 * share;
            let on = if is_noise { next() % 2 == 1 } else { (x / stripe + y / stripe) % 2 == 1 };
            let t = CameraMicros((index * 1_000_000 / rate) as i64);
            Event { t, x: x as u16, y: y as u16, polarity: Polarity::from_on(on) }
        };
        (0..rate).map(event).collect()
    }

    fn take(meter: &mut SharpnessMeter, events: &[Event]) -> Option<f64> {
        let mut list = EventList::default();
        assert_eq!(list.append(events.iter().copied()), 0);
        meter.take(list.as_slice())
    }

    fn reading(rate: u64, stripe: u64, share: f64) -> Option<f64> {
        take(&mut SharpnessMeter::new(GEOMETRY), &events(rate, stripe, share))
    }

    #[test]
    fn finer_structure_reads_higher_at_every_rate() {
        for rate in [200_000, 1_000_000, 5_000_000] {
            let [fine, middle, coarse] =
                [3, 6, 8].map(|stripe| reading(rate, stripe, 0.9).unwrap_or_else(|| panic!("{rate}")));
            assert!(fine > 1.2 * middle && middle > 1.2 * coarse, "{rate}: {fine} {middle} {coarse}");
            let slow = reading(100_000, 3, 0.9).unwrap_or_else(|| panic!("{rate}"));
            // A reading is significant by 12 standard deviations.
            assert!((fine / slow - 1.0).abs() < 2.0 / 12.0, "{rate}: {fine} {slow}");
        }
    }

    #[test]
    fn noise_silence_and_light_say_nothing() {
        assert_eq!(reading(1_000_000, 3, 0.0), None);
        assert_eq!(reading(500, 3, 1.0), None);
        let light: Vec<_> =
            events(1_000_000, 3, 0.0).into_iter().map(|e| Event { polarity: Polarity::On, ..e }).collect();
        assert_eq!(take(&mut SharpnessMeter::new(GEOMETRY), &light), None);
    }

    #[test]
    fn noise_lowers_no_reading() {
        let (clean, noisy) = (reading(1_000_000, 3, 1.0), reading(1_000_000, 3, 0.7));
        let ratio = clean.zip(noisy).map(|(clean, noisy)| noisy / clean);
        assert!(ratio.is_some_and(|ratio| (ratio - 1.0).abs() < 0.1), "{clean:?} {noisy:?}");
    }

    #[test]
    fn batches_of_any_size_read_alike_and_only_the_window_counts() {
        let all = events(1_000_000, 3, 0.9);
        let mut meter = SharpnessMeter::new(GEOMETRY);
        let pieces: Vec<_> = all.chunks(97).filter_map(|piece| take(&mut meter, piece)).collect();
        assert_eq!(pieces.last().copied(), take(&mut SharpnessMeter::new(GEOMETRY), &all));
        // Outside of the window the stripes are wide.
        let mut mixed = events(1_000_000, 9, 0.9);
        for (event, fine) in mixed.iter_mut().zip(&all) {
            if fine.x >= 80 {
                *event = *fine;
            } else if event.x >= 80 {
                event.x -= 80;
            }
        }
        meter.look_at(Window { x: 80, y: 0, width: 80, height: 120 });
        let (window, whole) = (take(&mut meter, &mixed), pieces.last());
        let ratio = window.zip(whole).map(|(window, whole)| window / whole);
        assert!(ratio.is_some_and(|ratio| (ratio - 1.0).abs() < 0.1), "{window:?} {whole:?}");
    }

    #[test]
    fn a_camera_that_counts_anew_is_read_on() {
        let mut meter = SharpnessMeter::new(GEOMETRY);
        let late = |event: Event| Event { t: CameraMicros(event.t.0 + 1_000_000_000), ..event };
        let later: Vec<_> = events(1_000_000, 3, 0.9).into_iter().map(late).collect();
        assert!(take(&mut meter, &later).is_some());
        assert!(take(&mut meter, &events(1_000_000, 3, 0.9)).is_some());
        // Or has no time at all.
        let at = |t, x, y| [Event { t: CameraMicros(t), x, y, polarity: Polarity::On }];
        assert!(take(&mut meter, &at(i64::MAX, 500, 500)).is_none());
        take(&mut meter, &at(i64::MIN, 5, 5));
    }
}
