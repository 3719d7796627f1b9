//! Operators on the statistics of grey levels.

use super::WINDOW;
use crate::GreyImage;

/// HELM: mean over the pixels of the ratio between a pixel and the mean of the window around it, whichever way it is not below 1; a black
/// pixel counts as 1. F. S. Helmli, S. Scherer, "Adaptive shape from focus with an error estimation in light microscopy", Int. Symp. on
/// Image and Signal Processing and Analysis (2001) 188-193.
pub(super) fn helmli_mean(image: &GreyImage) -> f64 {
    let means = image.box_mean::<WINDOW>();
    let ratio = |(&value, &mean): (&f64, &f64)| {
        if value <= 0.0 { 1.0 } else { (value / mean).max(mean / value) }
    };
    let ratios = image.values().iter().zip(means.values()).map(ratio);
    ratios.sum::<f64>() / image.values().len() as f64
}

/// GLLV: variance over the pixels of the variance within the window around each. J. L. Pech-Pacheco, G. Cristobal, J. Chamorro-Martinez,
/// J. Fernandez-Valdivia, "Diatom autofocusing in brightfield microscopy: a comparative study", ICPR (2000) 3:314-317.
pub(super) fn local_variance(image: &GreyImage) -> f64 {
    let means = image.box_mean::<WINDOW>();
    let squares = GreyImage::new(image.width(), image.values().iter().map(|value| value * value).collect());
    let mut variances = squares.box_mean::<WINDOW>();
    for (variance, mean) in variances.values_mut().iter_mut().zip(means.values()) {
        *variance -= mean * mean;
    }
    let mean = variances.mean();
    variances.mean_of(|variance| (variance - mean).powi(2))
}

/// ACMO: mean distance of the grey levels (0 to 255) from their mean, the first absolute central moment of the histogram. M. V.
/// Shirvaikar, "An optimal measure for camera focus and exposure", Southeastern Symposium on System Theory (2004) 472-475.
pub(super) fn absolute_central_moment(image: &GreyImage) -> f64 {
    let level = |value: f64| (255.0 * value).round();
    let mean = image.mean_of(level);
    image.mean_of(|value| (level(value) - mean).abs())
}
