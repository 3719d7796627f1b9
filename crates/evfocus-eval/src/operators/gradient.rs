//! Operators on first derivatives.

use std::f64::consts::TAU;

use super::WINDOW;
use crate::GreyImage;
use crate::grey_image::transposed;

/// GRAD: Tenengrad, the mean of Gx^2 + Gy^2 with Sobel's filters, which is what the paper's citation means: J. M. Tenenbaum,
/// "Accommodation in computer vision", thesis, Stanford University (1971). The survey has it as GRA6.
pub(super) fn tenengrad(image: &GreyImage) -> f64 {
    let sobel = [[-1.0, 0.0, 1.0], [-2.0, 0.0, 2.0], [-1.0, 0.0, 1.0]];
    let filters = [image.correlate(&sobel), image.correlate(&transposed(&sobel))];
    filters.iter().map(|response| response.mean_of(|value| value * value)).sum()
}

/// SFIL: mean over the pixels of the strongest response of a Gaussian's derivative steered to eight directions. R. Minhas, A. A. Mohammed,
/// Q. M. J. Wu, M. A. Sid-Ahmed, "3D shape from focus and depth map computation using steerable filters", ICIAR (2009) 573-583.
/// Sigma is a third of half the window, 7 / 3 pixels; the Gaussian has the volume 1.
pub(super) fn steerable(image: &GreyImage) -> f64 {
    let reach = (WINDOW / 2) as isize;
    let variance = (reach as f64 / 3.0).powi(2);
    let profile = |at: isize| (-0.5 * (at * at) as f64 / variance).exp() / (TAU * variance).sqrt();
    let along = |weight: &dyn Fn(isize) -> f64| -> [[f64; WINDOW]; 1] {
        [std::array::from_fn(|index| weight(index as isize - reach))]
    };
    let smooth = along(&profile);
    let slope = along(&|at| at as f64 / variance * profile(at));
    let right = image.correlate(&slope).correlate(&transposed(&smooth));
    let down = image.correlate(&smooth).correlate(&transposed(&slope));
    let directions: Vec<(f64, f64)> =
        (0..8).map(|eighth| (f64::from(eighth) / 8.0 * TAU).sin_cos()).collect();
    let strongest = |(x, y): (&f64, &f64)| {
        directions.iter().map(|&(sin, cos)| cos * x + sin * y).fold(f64::NEG_INFINITY, f64::max)
    };
    let responses = right.values().iter().zip(down.values()).map(strongest);
    responses.sum::<f64>() / image.values().len() as f64
}
