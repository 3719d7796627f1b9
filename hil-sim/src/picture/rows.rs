//! Rows of a picture that repeats, moved and stretched by fractions of a pixel.

/// The whole and the fractional part of a coordinate on a torus.
pub(super) fn split(coordinate: f64, size: usize) -> (usize, f32) {
    let wrapped = coordinate.rem_euclid(size as f64);
    let whole = (wrapped as usize).min(size - 1);
    (whole, (wrapped - whole as f64) as f32)
}

/// Repeats the first `width` values of `line` up to index `end`.
pub(super) fn extend(line: &mut [f32], width: usize, end: usize) {
    let mut have = width;
    let end = end.min(line.len());
    while have < end {
        let count = width.min(end - have);
        line.copy_within(..count, have);
        have += count;
    }
}

/// `out[i]` between `line[i]` and `line[i + 1]`.
pub(super) fn shifted(line: &[f32], share: f32, out: &mut [f32], add: bool) {
    let keep = if add { 1.0 } else { 0.0 };
    for ((out, first), second) in out.iter_mut().zip(line).zip(&line[1..]) {
        *out = keep * *out + first + share * (second - first);
    }
}

/// `out[i]` at `start + i step` on `line`.
pub(super) fn stretched(line: &[f32], start: f32, step: f32, out: &mut [f32], add: bool) {
    let keep = if add { 1.0 } else { 0.0 };
    for (index, out) in out.iter_mut().enumerate() {
        let at = start + index as f32 * step;
        let whole = (at as usize).min(line.len() - 2);
        let share = at - whole as f32;
        *out = keep * *out + line[whole] + share * (line[whole + 1] - line[whole]);
    }
}
