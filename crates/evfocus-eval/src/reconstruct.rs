//! Pictures from events alone, as the paper made them for its Table 1: direct integration, 100 pictures a second.
//!
//! C. Brandli, L. Muller, T. Delbruck, "Real-time, high-speed video decompression using a frame- and event-based DAVIS sensor", ISCAS
//! (2014) 686-689: each event moves the logarithm of its pixel by one contrast threshold. There it starts from a frame. Without frames, as
//! here, it starts from an even grey. What the paper leaves open, chosen here: the threshold is [`CONTRAST`] for both polarities, the grey
//! is [`START_LEVEL`], the pictures have 8 bits, and nothing fades: noise adds up to the end of the sweep, as the paper's large errors for
//! pictures from events suggest.

use evfocus_core::{CameraMicros, Events, Geometry};

use crate::GreyImage;

/// Pictures per second.
pub const PICTURES_PER_S: i64 = 100;
/// Rise of the natural logarithm of the light that an event stands for.
pub const CONTRAST: f64 = 0.2;
/// Value from which all pixels start, 0 to 1.
pub const START_LEVEL: f64 = 0.3;

/// Hands `see` the picture that `events` add up to, a hundred times a second from the first event to the last, with its time.
pub fn pictures(geometry: Geometry, events: Events<'_>, mut see: impl FnMut(CameraMicros, &GreyImage)) {
    let (Some(first), Some(last)) = (events.first(), events.last()) else { return };
    let period = 1_000_000 / PICTURES_PER_S;
    let mut counts = vec![0_i32; geometry.pixels()];
    let mut picture = GreyImage::new(geometry.width.into(), vec![level(0); geometry.pixels()]);
    let mut due = CameraMicros(first.t.0.saturating_add(period));
    let mut rest = events;
    while due <= last.t {
        let before = rest.range(0..rest.first_at_or_after(due));
        for event in before.iter().filter(|event| geometry.contains(event.x, event.y)) {
            let pixel = usize::from(event.y) * usize::from(geometry.width) + usize::from(event.x);
            counts[pixel] += if event.polarity.is_on() { 1 } else { -1 };
            picture.values_mut()[pixel] = level(counts[pixel]);
        }
        see(due, &picture);
        rest = rest.from(before.len());
        due = CameraMicros(due.0 + period);
    }
}

/// The value of a pixel with so many more ON than OFF events.
fn level(count: i32) -> f64 {
    let value = START_LEVEL * (CONTRAST * f64::from(count)).exp();
    (value.min(1.0) * 255.0).round() / 255.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use evfocus_core::{Event, EventList, Polarity};

    #[test]
    fn a_pixel_rises_by_a_threshold_an_event_and_stays() {
        let event = |t, polarity| Event { t: CameraMicros(t), x: 1, y: 0, polarity };
        let events = [
            event(0, Polarity::On),
            event(5_000, Polarity::On),
            event(15_000, Polarity::Off),
            event(30_000, Polarity::On),
        ];
        let events = EventList::of(events).expect("they are close together");
        let mut seen = Vec::new();
        pictures(Geometry { width: 2, height: 1 }, events.as_slice(), |time, picture| {
            seen.push((time.0, picture.values()[0], picture.values()[1]));
        });
        let times: Vec<i64> = seen.iter().map(|seen| seen.0).collect();
        assert_eq!(times, [10_000, 20_000, 30_000]);
        assert!(seen.iter().all(|seen| (seen.1 - START_LEVEL).abs() < 0.002));
        let rises: Vec<f64> = seen.iter().map(|seen| (seen.2 / START_LEVEL).ln() / CONTRAST).collect();
        for (rise, expected) in rises.iter().zip([2.0, 1.0, 1.0]) {
            assert!((rise - expected).abs() < 0.05, "{rises:?}");
        }
    }
}
