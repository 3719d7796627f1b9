//! The operator on wavelet coefficients.

use crate::GreyImage;

/// Taps of Daubechies' wavelet with six vanishing moments.
pub(super) const LENGTH: usize = 12;

/// Its low-pass filter. I. Daubechies, "Ten lectures on wavelets" (1992), table 6.1, N = 6, last tap first.
const LOW: [f64; LENGTH] = [
    -0.001_077_301_085_308_479_6,
    0.004_777_257_510_945_511,
    0.000_553_842_201_161_496_1,
    -0.031_582_039_317_486_03,
    0.027_522_865_530_305_727,
    0.097_501_605_587_323_04,
    -0.129_766_867_567_261_94,
    -0.226_264_693_965_439_83,
    0.315_250_351_709_197_63,
    0.751_133_908_021_095_4,
    0.494_623_890_398_453_06,
    0.111_540_743_350_109_47,
];

/// WAVS: mean size of the coefficients of the three detail bands of the finest level, added up. G. Yang, B. J. Nelson, "Wavelet-based
/// autofocusing and unsupervised segmentation of microscopic images", IEEE/RSJ IROS (2003) 2143-2148. Daubechies' wavelet of six vanishing
/// moments, as the survey has it; the picture goes on as its mirror image beyond the margins.
pub(super) fn coefficients(image: &GreyImage) -> f64 {
    let mut high = LOW;
    high.reverse();
    for tap in high.iter_mut().step_by(2) {
        *tap = -*tap;
    }
    let (low_x, high_x) = (half(image, &LOW), half(image, &high));
    let bands = [half(&turned(&low_x), &high), half(&turned(&high_x), &LOW), half(&turned(&high_x), &high)];
    bands.iter().map(|band| band.mean_of(f64::abs)).sum()
}

/// Every other value of each row, filtered.
fn half(image: &GreyImage, filter: &[f64; LENGTH]) -> GreyImage {
    let width = image.width();
    let out_width = (width + LENGTH - 1) / 2;
    let mut out = Vec::with_capacity(out_width * image.height());
    let mut mirrored = Vec::with_capacity(width + 2 * LENGTH);
    for row in image.values().chunks_exact(width) {
        mirrored.clear();
        let margin = LENGTH as isize - 2;
        mirrored.extend((-margin..=width as isize + margin).map(|at| row[mirror(at, width)]));
        for place in 0..out_width {
            let newest = 2 * place + LENGTH - 1;
            let taps = filter.iter().zip(mirrored[newest + 1 - LENGTH..=newest].iter().rev());
            out.push(taps.map(|(tap, value)| tap * value).sum());
        }
    }
    GreyImage::new(out_width, out)
}

/// Where `at` lies in a row of `width` values that goes on as its mirror image on both sides, the outermost value twice.
fn mirror(at: isize, width: usize) -> usize {
    let around = at.rem_euclid(2 * width as isize) as usize;
    around.min(2 * width - 1 - around)
}

/// The picture with rows and columns exchanged.
fn turned(image: &GreyImage) -> GreyImage {
    let (width, height) = (image.width(), image.height());
    let columns = (0..width).flat_map(|x| (0..height).map(move |y| image.values()[y * width + x]));
    GreyImage::new(height, columns.collect())
}
