//! Operators on second derivatives.

use std::f64::consts::FRAC_1_SQRT_2;

use crate::GreyImage;
use crate::grey_image::transposed;

const SECOND: [[f64; 3]; 1] = [[-1.0, 2.0, -1.0]];

/// SML: mean of the modified Laplacian |d2I/dx2| + |d2I/dy2|, without a threshold, over the whole picture. S. K. Nayar, Y. Nakagawa,
/// "Shape from focus", IEEE Trans. Pattern Analysis and Machine Intelligence 16 (1994) 824-831.
pub(super) fn modified(image: &GreyImage) -> f64 {
    let filters = [image.correlate(&SECOND), image.correlate(&transposed(&SECOND))];
    filters.iter().map(|response| response.mean_of(f64::abs)).sum()
}

/// LAP3: the modified Laplacian and the same along both diagonals, whose pixels are farther apart by the root of two. A. Thelen, S. Frey,
/// S. Hirsch, P. Hering, "Improvements in shape-from-focus for holographic reconstructions with regard to focus operators,
/// neighborhood-size, and height value interpolation", IEEE Trans. Image Processing 18 (2009) 151-157.
///
/// The paper cites Y. An et al., "Shape from focus through Laplacian using 3D window" (2008) under this name: that is SML summed over
/// neighbouring pictures of the stack, which for a whole picture is SML once more.
pub(super) fn diagonal(image: &GreyImage) -> f64 {
    let [two, one] = [2.0, -1.0].map(|weight| weight * FRAC_1_SQRT_2);
    let falling = [[one, 0.0, 0.0], [0.0, two, 0.0], [0.0, 0.0, one]];
    let rising = [[0.0, 0.0, one], [0.0, two, 0.0], [one, 0.0, 0.0]];
    let diagonals = [image.correlate(&falling), image.correlate(&rising)];
    modified(image) + diagonals.iter().map(|response| response.mean_of(f64::abs)).sum::<f64>()
}
