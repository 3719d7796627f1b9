//! Operators on the picture in another basis.

use nalgebra::DMatrix;

use crate::GreyImage;

/// Highest order of the Chebyshev moments that count as low.
const LOW_ORDER: usize = 2;
/// Eigenvalues that are added up.
const EIGENVALUES: usize = 3;

/// CHEB: energy of the picture beyond its discrete Chebyshev moments of order up to 2 (both axes together), by the energy within them.
/// The picture is scaled to unit energy and its mean taken off. P. T. Yap, P. Raveendran, "Image focus measure based on Chebyshev
/// moments", IEE Proc. Vision, Image and Signal Processing 151 (2004) 128-136. 0 for an even picture.
pub(super) fn chebyshev_moments(image: &GreyImage) -> f64 {
    let Some(picture) = normalized(image) else { return 0.0 };
    let columns = orthonormal_polynomials(image.width());
    let rows = orthonormal_polynomials(image.height());
    let moments = &columns * &picture * rows.transpose();
    let mut low = 0.0;
    for (x, y) in (0..=LOW_ORDER).flat_map(|x| (0..=LOW_ORDER - x).map(move |y| (x, y))) {
        low += moments[(x, y)].powi(2);
    }
    let all = picture.norm_squared();
    if low > 0.0 { (all - low).abs() / low } else { 0.0 }
}

/// EIGV: the three largest eigenvalues of the covariance of the picture's lines, the picture scaled to unit energy and its mean taken
/// off. C. Y. Wee, R. Paramesran, "Measure of image sharpness using eigenvalues", Information Sciences 177 (2007) 2533-2552.
/// 0 for an even picture.
pub(super) fn eigenvalues(image: &GreyImage) -> f64 {
    let Some(picture) = normalized(image) else { return 0.0 };
    // Both products have the same eigenvalues, but for zeros: take the smaller one.
    let covariance = if picture.nrows() > picture.ncols() {
        picture.tr_mul(&picture)
    } else {
        &picture * picture.transpose()
    };
    let mut eigenvalues: Vec<f64> = covariance.symmetric_eigenvalues().iter().copied().collect();
    eigenvalues.sort_by(|a, b| b.total_cmp(a));
    eigenvalues.iter().take(EIGENVALUES).sum::<f64>() / (image.values().len() as f64 - 1.0)
}

/// DCTM: mean energy of what a 4 x 4 filter leaves that has the signs of a middle basis function of the cosine transform. S. Y. Lee,
/// Y. Kumar, J. M. Cho, S. W. Lee, S. W. Kim, "Enhanced autofocus algorithm using robust focus measure and fuzzy reasoning", IEEE Trans.
/// Circuits and Systems for Video Technology 18 (2008) 1237-1246.
///
/// The survey's public code averages the response with its sign, which leaves nothing but the margins of the picture, since the weights
/// add up to zero; if the paper used that, its figures for DCTM say little of the operator.
pub(super) fn cosine(image: &GreyImage) -> f64 {
    // Of the even number of weights, the second in each direction belongs to the pixel.
    let mask = [
        [0.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 1.0, -1.0, -1.0],
        [0.0, 1.0, 1.0, -1.0, -1.0],
        [0.0, -1.0, -1.0, 1.0, 1.0],
        [0.0, -1.0, -1.0, 1.0, 1.0],
    ];
    image.correlate(&mask).mean_of(|value| value * value)
}

/// The picture with a column of the matrix for each row of it, scaled so that its squares add up to 1, less its mean. `None` if nothing
/// but rounding is left.
fn normalized(image: &GreyImage) -> Option<DMatrix<f64>> {
    let mean = image.mean();
    let energy = image.mean_of(|value| value * value);
    let deviation = image.mean_of(|value| (value - mean).powi(2));
    if deviation <= 1e-12 * energy {
        return None;
    }
    let scale = 1.0 / (energy * image.values().len() as f64).sqrt();
    let values = image.values().iter().map(|value| (value - mean) * scale);
    Some(DMatrix::from_iterator(image.width(), image.height(), values))
}

/// Rows of polynomials of degree 0, 1, 2 on `count` points, orthogonal and of length 1: the discrete Chebyshev polynomials.
fn orthonormal_polynomials(count: usize) -> DMatrix<f64> {
    let middle = (count as f64 - 1.0) / 2.0;
    let mut polynomials: Vec<Vec<f64>> = Vec::with_capacity(LOW_ORDER + 1);
    for degree in 0..=LOW_ORDER {
        let power = |at: usize| (at as f64 - middle).powi(degree as i32);
        let mut polynomial: Vec<f64> = (0..count).map(power).collect();
        for lower in &polynomials {
            let share: f64 = lower.iter().zip(&polynomial).map(|(a, b)| a * b).sum();
            for (value, lower) in polynomial.iter_mut().zip(lower) {
                *value -= share * lower;
            }
        }
        let length = polynomial.iter().map(|value| value * value).sum::<f64>().sqrt();
        for value in &mut polynomial {
            *value /= length;
        }
        polynomials.push(polynomial);
    }
    DMatrix::from_fn(LOW_ORDER + 1, count, |degree, at| polynomials[degree][at])
}
