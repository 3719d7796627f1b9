//! Painting on a canvas that repeats at its margins.

use crate::fourier::Texture;

/// Calls `paint` for every pixel within `reach` (right and left, up and down) of `middle`, wrapped round the margins, with
/// the offset of the pixel's middle from there.
pub(crate) fn stamp(
    canvas: &mut Texture,
    (x, y): (f64, f64),
    reach: (f64, f64),
    mut paint: impl FnMut(&mut f32, f64, f64),
) {
    let (width, height) = (canvas.width as i64, canvas.height as i64);
    let (reach_x, reach_y) = (reach.0.ceil() as i64 + 1, reach.1.ceil() as i64 + 1);
    for row in y as i64 - reach_y..=y as i64 + reach_y {
        for column in x as i64 - reach_x..=x as i64 + reach_x {
            let index = row.rem_euclid(height) * width + column.rem_euclid(width);
            if let Some(pixel) = usize::try_from(index).ok().and_then(|index| canvas.values.get_mut(index)) {
                paint(pixel, column as f64 + 0.5 - x, row as f64 + 0.5 - y);
            }
        }
    }
}

/// Share of a pixel that lies inside of a rim `inside` pixels away from its middle (negative: the middle is outside).
pub(crate) fn cover(inside: f64) -> f32 {
    (inside + 0.5).clamp(0.0, 1.0) as f32
}

/// Hides `share` of what `pixel` showed behind `value`.
pub(crate) fn hide(pixel: &mut f32, share: f32, value: f32) {
    *pixel += share * (value - *pixel);
}
