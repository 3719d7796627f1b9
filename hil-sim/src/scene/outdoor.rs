//! What a camera out of doors or in a plain room sees: branches, houses, walls with little on them.

use std::f64::consts::{PI, TAU};

use rand::RngExt;
use rand_xoshiro::Xoshiro256PlusPlus;

use super::brush::{cover, hide, stamp};
use crate::fourier::Texture;

/// A number from `low` to `high`, evenly distributed in its logarithm.
fn log_uniform(rng: &mut Xoshiro256PlusPlus, low: f64, high: f64) -> f64 {
    low * (high / low).powf(rng.random::<f64>())
}

fn anywhere(canvas: &Texture, rng: &mut Xoshiro256PlusPlus) -> (f64, f64) {
    (rng.random::<f64>() * canvas.width as f64, rng.random::<f64>() * canvas.height as f64)
}

/// Twigs and branches against the sky: straight pieces 0.7 to 8 pixels thick, probability as thickness^-2, ten to thirty times
/// as long, in all directions; most of them dark (10 to 60 DN), one in four lit (60 to 240 DN), on a sky of 150 DN.
pub(super) fn foliage(canvas: &mut Texture, rng: &mut Xoshiro256PlusPlus) {
    let (thinnest, thickest) = (0.7_f64, 8.0_f64);
    canvas.values.fill(150.0);
    // The mean piece covers about 110 pixels: two layers, through which some sky is seen.
    for _ in 0..canvas.values.len() * 2 / 110 {
        let share = rng.random::<f64>();
        let thickness = 1.0 / (1.0 / thinnest + share * (1.0 / thickest - 1.0 / thinnest));
        let half_length = 0.5 * thickness * rng.random_range(10.0..30.0);
        let angle = rng.random::<f64>() * PI;
        let lit = rng.random_range(0..4) == 0;
        let value = if lit { log_uniform(rng, 60.0, 240.0) } else { log_uniform(rng, 10.0, 60.0) } as f32;
        let (along_x, along_y) = (angle.cos(), angle.sin());
        let reach = (half_length * along_x.abs() + thickness, half_length * along_y.abs() + thickness);
        let middle = anywhere(canvas, rng);
        stamp(canvas, middle, reach, |pixel, x, y| {
            let along = (x * along_x + y * along_y).clamp(-half_length, half_length);
            let distance = (x - along * along_x).hypot(y - along * along_y);
            // A piece thinner than a pixel never covers the whole of it.
            hide(pixel, cover(0.5 * thickness - distance) * thickness.min(1.0) as f32, value);
        });
    }
}

/// Fronts of houses that hide each other, 40 to 160 pixels wide and high and 25 to 220 DN bright, each with rows of windows 3 to
/// 12 pixels wide that are darker or brighter than the wall.
pub(super) fn buildings(canvas: &mut Texture, rng: &mut Xoshiro256PlusPlus) {
    canvas.values.fill(190.0);
    // The mean front covers about 7500 pixels: five layers leave little of the sky.
    for _ in 0..(canvas.values.len() * 5).div_ceil(7500) {
        let (x, y) = anywhere(canvas, rng);
        let (width, height) = (log_uniform(rng, 40.0, 160.0).round(), log_uniform(rng, 40.0, 160.0).round());
        rectangle(canvas, (x, y), (width, height), log_uniform(rng, 25.0, 220.0) as f32);
        let window = (rng.random_range(3.0_f64..12.0), rng.random_range(4.0_f64..14.0));
        let (step_x, step_y) = (window.0 * 1.9, window.1 * 1.8);
        let glass = log_uniform(rng, 8.0, 240.0);
        let (columns, rows) = ((width / step_x) as i32, (height / step_y) as i32);
        for place in 0..columns * rows {
            // No two panes mirror the same piece of sky.
            let value = (glass * rng.random_range(0.7..1.4)).min(255.0) as f32;
            let right = (f64::from(place % columns) - 0.5 * f64::from(columns - 1)) * step_x;
            let down = (f64::from(place / columns) - 0.5 * f64::from(rows - 1)) * step_y;
            rectangle(canvas, (x + right, y + down), window, value);
        }
    }
}

/// A rectangle of `size` about `middle`.
fn rectangle(canvas: &mut Texture, middle: (f64, f64), (width, height): (f64, f64), value: f32) {
    stamp(canvas, middle, (0.5 * width, 0.5 * height), |pixel, x, y| {
        hide(pixel, cover(0.5 * width - x.abs()) * cover(0.5 * height - y.abs()), value);
    });
}

/// A wall on which little is to be seen: shading by a third from side to side, and stains with a radius of 6 to 30 pixels, one
/// for every 600 pixels, that are 15 to 45 % darker or brighter: edges of one or two thresholds.
pub(super) fn low_texture(canvas: &mut Texture, rng: &mut Xoshiro256PlusPlus) {
    let (width, height) = (canvas.width, canvas.height);
    for (index, pixel) in canvas.values.iter_mut().enumerate() {
        let (x, y) = ((index % width) as f64 / width as f64, (index / width) as f64 / height as f64);
        *pixel = (100.0 * (0.2 * (x * TAU).sin() + 0.15 * (y * TAU).cos()).exp()) as f32;
    }
    for _ in 0..(width * height).div_ceil(600) {
        let radius = log_uniform(rng, 6.0, 30.0);
        let contrast = rng.random_range(0.15..0.45) * if rng.random() { 1.0 } else { -1.0 };
        let middle = anywhere(canvas, rng);
        stamp(canvas, middle, (radius, radius), |pixel, x, y| {
            *pixel *= 1.0 + contrast as f32 * cover(radius - x.hypot(y));
        });
    }
}
