//! Test charts without chance.

use std::f64::consts::TAU;

use crate::fourier::Texture;

/// Subdivisions of a pixel along each axis where an edge crosses it.
const SUBPIXELS: usize = 4;

/// Printed black and white, DN: a factor of 15 in reflectance.
pub(super) const BLACK: f32 = 14.0;
pub(super) const WHITE: f32 = 210.0;

/// Sets each pixel to the mean of `value` over the pixel; `value` takes a point with the origin in the picture's middle.
fn paint(canvas: &mut Texture, value: impl Fn(f64, f64) -> f32) {
    let (width, height) = (canvas.width, canvas.height);
    let step = 1.0 / SUBPIXELS as f64;
    for (index, pixel) in canvas.values.iter_mut().enumerate() {
        let (x, y) =
            ((index % width) as f64 - width as f64 / 2.0, (index / width) as f64 - height as f64 / 2.0);
        let points = (0..SUBPIXELS * SUBPIXELS).map(|k| {
            value(x + ((k % SUBPIXELS) as f64 + 0.5) * step, y + ((k / SUBPIXELS) as f64 + 0.5) * step)
        });
        *pixel = points.sum::<f32>() / (SUBPIXELS * SUBPIXELS) as f32;
    }
}

/// 36 pairs of wedges in a disc on white.
pub(super) fn siemens_star(canvas: &mut Texture) {
    let radius = canvas.width.min(canvas.height) as f64 * 0.44;
    paint(canvas, |x, y| {
        let wedge = (y.atan2(x) / TAU * 72.0).rem_euclid(2.0);
        if x.hypot(y) < radius && wedge < 1.0 { BLACK } else { WHITE }
    });
}

/// Squares of 16 pixels, stretched a little so that a whole number of pairs fills the picture.
pub(super) fn checker(canvas: &mut Texture) {
    let count = |size: usize| ((size as f64 / 32.0).round() * 2.0).max(2.0);
    let (width, height) = (canvas.width as f64, canvas.height as f64);
    let (columns, rows) = (count(canvas.width), count(canvas.height));
    paint(canvas, |x, y| {
        let column = ((x / width + 0.5) * columns).floor();
        let row = ((y / height + 0.5) * rows).floor();
        if (column + row).rem_euclid(2.0) < 0.5 { BLACK } else { WHITE }
    });
}

/// Grey with shading of 5 % from side to side, as a lamp makes it.
pub(super) fn blank_wall(canvas: &mut Texture) {
    let (width, height) = (canvas.width as f64, canvas.height as f64);
    paint(canvas, |x, y| (128.0 + 3.0 * (x / width * TAU).sin() + 3.0 * (y / height * TAU).cos()) as f32);
}
