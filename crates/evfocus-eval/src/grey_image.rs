//! A grey picture.

use std::path::Path;

use anyhow::{Context, bail};

/// A grey picture: values from 0 (black) to 1 (white), row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct GreyImage {
    width: usize,
    values: Vec<f64>,
}

impl GreyImage {
    /// A picture whose rows have `width` values, at least one; what does not fill a row is left out.
    pub fn new(width: usize, mut values: Vec<f64>) -> Self {
        let width = width.max(1);
        values.truncate(values.len() / width * width);
        Self { width, values }
    }

    /// The same from values of 8 bits.
    pub fn from_bytes(width: usize, bytes: &[u8]) -> Self {
        Self::new(width, bytes.iter().map(|&byte| f64::from(byte) / 255.0).collect())
    }

    /// Reads a PNG, JPEG, PGM or TIFF file. Colours become their luma (Rec. 709), as the `image` library has it.
    ///
    /// # Errors
    /// A file that cannot be read, or that is no such picture.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let shown = path.display();
        let bytes = std::fs::read(path)
            .with_context(|| format!("{shown}: cannot read; name a PNG, JPEG, PGM or TIFF file"))?;
        if bytes.is_empty() {
            bail!("{shown}: the file is empty; name a PNG, JPEG, PGM or TIFF file");
        }
        let picture = image::load_from_memory(&bytes)
            .with_context(|| format!("{shown}: not a picture; name a PNG, JPEG, PGM or TIFF file"))?;
        let grey = picture.into_luma16();
        let values = grey.pixels().map(|pixel| f64::from(pixel.0[0]) / f64::from(u16::MAX)).collect();
        Ok(Self::new(grey.width() as usize, values))
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.values.len() / self.width
    }

    /// The values, row by row.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    pub(crate) fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// What `taps` make of the picture: at each pixel the sum of weight times the value that many columns to the right and rows
    /// down. Beyond the margins the outermost pixels repeat.
    #[must_use]
    pub fn correlate(&self, taps: &[Tap]) -> Self {
        let (width, height) = (self.width, self.height());
        let reach = taps.iter().map(|tap| tap.right.abs().max(tap.down.abs())).max().unwrap_or(0);
        let margin = reach.unsigned_abs();
        let stride = width + 2 * margin;
        let mut padded = Vec::with_capacity(stride * height);
        for row in self.values.chunks_exact(width) {
            padded.extend(std::iter::repeat_n(row[0], margin));
            padded.extend_from_slice(row);
            padded.extend(std::iter::repeat_n(row[width - 1], margin));
        }
        let mut out = vec![0.0; self.values.len()];
        for (y, out) in out.chunks_exact_mut(width).enumerate() {
            for tap in taps {
                let source = y.saturating_add_signed(tap.down).min(height - 1) * stride;
                let start = source + margin.saturating_add_signed(tap.right);
                for (out, value) in out.iter_mut().zip(&padded[start..start + width]) {
                    *out += tap.weight * value;
                }
            }
        }
        Self::new(width, out)
    }

    /// The mean of what `measure` makes of each value.
    pub(crate) fn mean_of(&self, measure: impl Fn(f64) -> f64) -> f64 {
        self.values.iter().map(|&value| measure(value)).sum::<f64>() / self.values.len().max(1) as f64
    }

    /// The mean of all values.
    pub(crate) fn mean(&self) -> f64 {
        self.mean_of(|value| value)
    }

    /// Mean over the square of `side` pixels around each pixel.
    pub(crate) fn box_mean(&self, side: usize) -> Self {
        let reach = (side / 2) as isize;
        let weight = 1.0 / side as f64;
        let along: Vec<Tap> = (-reach..=reach).map(|right| Tap { right, down: 0, weight }).collect();
        self.correlate(&along).correlate(&transposed(&along))
    }
}

/// One weight of a filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tap {
    /// Columns to the right of the pixel.
    pub right: isize,
    /// Rows below the pixel.
    pub down: isize,
    /// Its weight.
    pub weight: f64,
}

/// The filter with columns and rows exchanged.
pub(crate) fn transposed(taps: &[Tap]) -> Vec<Tap> {
    taps.iter().map(|tap| Tap { right: tap.down, down: tap.right, weight: tap.weight }).collect()
}

/// A filter from the rows of its weights, the middle of which (for even numbers the one before) belongs to the pixel.
pub(crate) fn kernel<const WIDTH: usize>(rows: &[[f64; WIDTH]]) -> Vec<Tap> {
    let (middle_x, middle_y) = (((WIDTH - 1) / 2) as isize, ((rows.len() - 1) / 2) as isize);
    let mut taps = Vec::new();
    for (y, row) in rows.iter().enumerate() {
        for (x, &weight) in row.iter().enumerate().filter(|(_, weight)| **weight != 0.0) {
            taps.push(Tap { right: x as isize - middle_x, down: y as isize - middle_y, weight });
        }
    }
    taps
}
