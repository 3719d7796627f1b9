//! Random scenes with the statistics of natural ones.

use rand::RngExt;
use rand_distr::StandardNormal;
use rand_xoshiro::Xoshiro256PlusPlus;

use super::brush::{cover, hide, stamp};
use crate::fourier::{Fourier, Texture, frequency};

/// Discs with radii of 3 to 40 pixels, probability as radius^-3, each hiding those before it; brightness evenly distributed
/// in its logarithm, 12 to 240 DN. With these numbers the event rates come out as in sensor-and-optics, section 3.
pub(super) fn dead_leaves(canvas: &mut Texture, rng: &mut Xoshiro256PlusPlus) {
    let (smallest, largest) = (3.0_f64, 40.0_f64);
    canvas.values.fill(60.0);
    // The mean disc covers about 150 pixels; eight layers leave nothing of the ground.
    let discs = canvas.values.len() * 8 / 150;
    for _ in 0..discs {
        let (inner, outer) = (smallest.powi(-2), largest.powi(-2));
        let radius = (inner + rng.random::<f64>() * (outer - inner)).powf(-0.5);
        let value = 12.0 * 20_f64.powf(rng.random::<f64>());
        let (x, y) = (rng.random::<f64>() * canvas.width as f64, rng.random::<f64>() * canvas.height as f64);
        stamp(canvas, (x, y), (radius, radius), |pixel, dx, dy| {
            hide(pixel, cover(radius - dx.hypot(dy)), value as f32);
        });
    }
}

/// A texture whose amplitude falls as 1/f; its logarithm has a standard deviation of 0.8 about ln 60.
pub(super) fn pink_noise(canvas: &mut Texture, rng: &mut Xoshiro256PlusPlus) {
    for value in &mut canvas.values {
        // Above zero, because filtered pictures are cut off there.
        *value = 1000.0 + rng.sample::<f32, _>(StandardNormal);
    }
    let fourier = Fourier::new(canvas.width, canvas.height);
    let longest = 1.0 / canvas.width.max(canvas.height) as f64;
    let (width, height) = (canvas.width, canvas.height);
    let [texture, _] = fourier.filtered(&fourier.spectrum(canvas), |x, y| {
        let rho = frequency(x, width).hypot(frequency(y, height));
        [if x + y == 0 { 1.0 } else { (longest / rho.max(longest)) as f32 }; 2]
    });
    let count = texture.values.len() as f32;
    let mean = texture.values.iter().sum::<f32>() / count;
    let variance = texture.values.iter().map(|value| (value - mean).powi(2)).sum::<f32>() / count;
    for (value, pink) in canvas.values.iter_mut().zip(&texture.values) {
        *value = (60.0 * (0.8 * (pink - mean) / variance.sqrt()).exp()).clamp(1.0, 255.0);
    }
}

/// One star for every 400 pixels on a sky of 2 DN. Few are bright: fluxes of 60 to 6000 DN with the slope of star counts.
pub(super) fn star_field(canvas: &mut Texture, rng: &mut Xoshiro256PlusPlus) {
    canvas.values.fill(2.0);
    let (width, height) = (canvas.width, canvas.height);
    for _ in 0..(width * height).div_ceil(400) {
        let flux = (60.0 * (1.0 - rng.random::<f64>()).powf(-1.0)).min(6000.0) as f32;
        let (x, y) = (rng.random::<f32>() * width as f32, rng.random::<f32>() * height as f32);
        let (column, row) = (x as usize, y as usize);
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let share = |whole: usize, exact: f32, step: usize| {
                let fraction = exact - whole as f32;
                if step == 0 { 1.0 - fraction } else { fraction }
            };
            let index = (row + dy) % height * width + (column + dx) % width;
            canvas.values[index] += flux * share(column, x, dx) * share(row, y, dy);
        }
    }
}
