//! Noise in patches: its rate, its polarity, and who shares it.

use evfocus_core::Event;
use hil_sim::{PatchNoise, RigConfig};

use crate::sensor::{PIXELS, on_share, quiet, second, with};

const WIDTH: usize = 64;
/// Windows in which polarities are added up.
const WINDOWS: usize = 20;

fn patchy(events_hz: f64, patch_px: u16) -> RigConfig {
    with(quiet(), |sensor| sensor.patch_noise = Some(PatchNoise { events_hz, patch_px }))
}

/// Correlation of the sums of polarity of horizontal neighbours, over the pairs whose left pixel is in a column of `pairs`.
fn correlation(events: &[Event], pairs: impl Fn(usize) -> bool) -> f64 {
    let mut sums = vec![[0.0_f64; WINDOWS]; PIXELS as usize];
    for event in events {
        let window = (event.t.0 as usize * WINDOWS / 1_000_000).min(WINDOWS - 1);
        let sign = if event.polarity.is_on() { 1.0 } else { -1.0 };
        sums[usize::from(event.y) * WIDTH + usize::from(event.x)][window] += sign;
    }
    let (mut product, mut power) = (0.0, 0.0);
    for (index, left) in sums.iter().enumerate() {
        if index % WIDTH + 1 < WIDTH && pairs(index % WIDTH) {
            for (left, right) in left.iter().zip(&sums[index + 1]) {
                product += left * right;
                power += 0.5 * (left * left + right * right);
            }
        }
    }
    product / power
}

#[test]
fn it_makes_the_configured_rate_in_both_polarities() {
    for hertz in [2.0, 8.0] {
        let events = second(&patchy(hertz, 4)).0;
        let seen = events.len() as f64 / PIXELS;
        println!("{seen:.2} Hz of {hertz}, ON {:.2}", on_share(&events));
        // 192 patches: the numbers scatter as those of so many changes a second.
        assert!((seen / hertz - 1.0).abs() < 0.15);
        assert!((on_share(&events) - 0.5).abs() < 0.06);
    }
}

#[test]
fn neighbours_share_it_within_a_patch_only() {
    let events = second(&patchy(6.0, 4)).0;
    let (within, across) =
        (correlation(&events, |column| column % 4 < 3), correlation(&events, |column| column % 4 == 3));
    let shot = second(&with(quiet(), |sensor| {
        (sensor.shot_noise_black_hz, sensor.shot_noise_white_hz) = (6.0, 6.0);
    }));
    let independent = correlation(&shot.0, |_| true);
    println!(
        "correlation {within:.2} within patches, {across:.2} across their margins, {independent:.2} of shot noise"
    );
    assert!(within > 0.7);
    assert!(across.abs() < 0.15 && independent.abs() < 0.05);
}

#[test]
fn it_repeats_with_the_seed() {
    let again = |seed| second(&RigConfig { seed, ..patchy(5.0, 6) }).0;
    assert!(again(3) == again(3));
    assert!(again(3) != again(4));
}
