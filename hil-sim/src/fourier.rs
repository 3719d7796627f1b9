//! Convolution of pictures on a torus, by two-dimensional Fourier transforms.

use std::sync::Arc;

use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};

/// A picture that repeats in both directions.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Texture {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Row by row, DN.
    pub(crate) values: Vec<f32>,
}

impl Texture {
    pub(crate) fn filled(width: usize, height: usize, value: f32) -> Self {
        Self { width, height, values: vec![value; width * height] }
    }
}

/// The transforms for one picture size.
pub(crate) struct Fourier {
    width: usize,
    height: usize,
    rows: [Arc<dyn Fft<f32>>; 2],
    columns: [Arc<dyn Fft<f32>>; 2],
}

impl Fourier {
    pub(crate) fn new(width: usize, height: usize) -> Self {
        let mut planner = FftPlanner::new();
        Self {
            width,
            height,
            rows: [planner.plan_fft_forward(width), planner.plan_fft_inverse(width)],
            columns: [planner.plan_fft_forward(height), planner.plan_fft_inverse(height)],
        }
    }

    /// The spectrum of `texture`, stored column by column.
    pub(crate) fn spectrum(&self, texture: &Texture) -> Vec<Complex<f32>> {
        let mut values: Vec<_> = texture.values.iter().map(|&value| Complex::new(value, 0.0)).collect();
        self.rows[0].process(&mut values);
        let mut values = transposed(&values, self.width);
        self.columns[0].process(&mut values);
        values
    }

    /// The pictures that two real and even transfer functions make of a spectrum; both at the price of one, as the real and
    /// the imaginary part. `transfer` is given the indices of the frequencies along x and y; see [`frequency`].
    pub(crate) fn filtered(
        &self,
        spectrum: &[Complex<f32>],
        transfer: impl Fn(usize, usize) -> [f32; 2],
    ) -> [Texture; 2] {
        let mut values = Vec::with_capacity(spectrum.len());
        for (x, column_values) in spectrum.chunks_exact(self.height).enumerate() {
            values.extend(column_values.iter().enumerate().map(|(y, value)| {
                let [first, second] = transfer(x, y);
                value * Complex::new(first, second)
            }));
        }
        self.columns[1].process(&mut values);
        let mut values = transposed(&values, self.height);
        self.rows[1].process(&mut values);
        let scale = 1.0 / (self.width * self.height) as f32;
        // Rounding may leave a black pixel a little below zero.
        let part = |part: fn(&Complex<f32>) -> f32| Texture {
            width: self.width,
            height: self.height,
            values: values.iter().map(|value| (part(value) * scale).max(0.0)).collect(),
        };
        [part(|value| value.re), part(|value| value.im)]
    }
}

/// Frequency with index `index` of `count`, cycles per pixel, -0.5 to 0.5.
pub(crate) fn frequency(index: usize, count: usize) -> f64 {
    let signed = if index * 2 > count { index as f64 - count as f64 } else { index as f64 };
    signed / count as f64
}

/// Rows of length `width` become columns.
fn transposed(values: &[Complex<f32>], width: usize) -> Vec<Complex<f32>> {
    let height = values.len() / width;
    let mut turned = Vec::with_capacity(values.len());
    for column in 0..width {
        turned.extend((0..height).map(|row| values[row * width + column]));
    }
    turned
}

/// The smallest even size of at least `least` that has no prime factor above 5, for which the transforms are fast.
pub(crate) fn fast_size(least: usize) -> usize {
    let is_fast = |half: &usize| {
        let mut rest = *half;
        for factor in [2, 3, 5] {
            while rest.is_multiple_of(factor) {
                rest /= factor;
            }
        }
        rest == 1
    };
    let half = least.div_ceil(2).max(1);
    // A power of two lies within every such range.
    2 * (half..=2 * half).find(is_fast).unwrap_or(half)
}
