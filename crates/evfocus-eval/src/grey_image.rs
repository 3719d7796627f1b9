//! A grey picture.

use std::path::Path;

use anyhow::{Context, bail};
use image::{ImageBuffer, Luma};
use imageproc::kernel::Kernel;

/// A picture as the library for filters has it.
type Luma64 = ImageBuffer<Luma<f64>, Vec<f64>>;

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

    /// The correlation with a filter of these rows of weights, whose middle belongs to the pixel. Beyond the margins the outermost pixels
    /// repeat.
    #[must_use]
    pub fn correlate<const WIDTH: usize, const HEIGHT: usize>(
        &self,
        filter: &[[f64; WIDTH]; HEIGHT],
    ) -> Self {
        const { assert!(WIDTH % 2 == 1 && HEIGHT % 2 == 1, "a filter needs a middle") }
        let (width, height) = (self.width as u32, self.height() as u32);
        let Some(image) = Luma64::from_raw(width, height, self.values.clone()) else { return self.clone() };
        let kernel = Kernel::new(filter.as_flattened(), WIDTH as u32, HEIGHT as u32);
        let filtered: Luma64 = imageproc::filter::filter(&image, kernel, |value: f64| value);
        Self::new(self.width, filtered.into_raw())
    }

    /// The mean of what `measure` makes of each value.
    pub(crate) fn mean_of(&self, measure: impl Fn(f64) -> f64) -> f64 {
        self.values.iter().map(|&value| measure(value)).sum::<f64>() / self.values.len().max(1) as f64
    }

    /// The mean of all values.
    pub(crate) fn mean(&self) -> f64 {
        self.mean_of(|value| value)
    }

    /// Mean over the square of `SIDE` pixels, an odd number, around each pixel.
    pub(crate) fn box_mean<const SIDE: usize>(&self) -> Self {
        let along = [[1.0 / SIDE as f64; SIDE]];
        self.correlate(&along).correlate(&transposed(&along))
    }
}

/// The filter with columns and rows exchanged.
pub(crate) fn transposed<const WIDTH: usize, const HEIGHT: usize>(
    filter: &[[f64; WIDTH]; HEIGHT],
) -> [[f64; HEIGHT]; WIDTH] {
    std::array::from_fn(|x| std::array::from_fn(|y| filter[y][x]))
}
