//! The eleven focus operators that the paper compares with: how sharp is a grey picture?
//!
//! Names as in the paper, definitions as in S. Pertuz, D. Puig, M. A. Garcia, "Analysis of focus measure operators for
//! shape-from-focus", Pattern Recognition 46 (2013) 1415-1432, from which the paper has them; the original source is at each operator.
//! Values are means over the pixels where the definitions sum, so that pictures of unlike size compare.
//!
//! What the definitions leave open, chosen here: pictures go from 0 to 1; local windows have 15 x 15 pixels; beyond the margins the
//! outermost pixels repeat (the wavelet reflects instead).

mod gradient;
mod laplacian;
mod statistics;
mod transform;
mod wavelet;

use std::fmt;
use std::str::FromStr;

use crate::GreyImage;

/// Side of the local windows, pixels.
const WINDOW: usize = 15;

/// A focus operator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Operator {
    /// Energy beyond the Chebyshev moments of order 2 by the energy within them.
    Cheb,
    /// Helmli's mean: ratio of each pixel to the mean around it.
    Helm,
    /// Sum of the three largest eigenvalues of the picture's covariance.
    Eigv,
    /// Variance of the local variance.
    Gllv,
    /// Sum of the modified Laplacian.
    Sml,
    /// The modified Laplacian with diagonals.
    Lap3,
    /// Tenengrad: energy of the Sobel gradient.
    Grad,
    /// Sum of the wavelet coefficients of the finest level.
    Wavs,
    /// Absolute central moment of the grey levels.
    Acmo,
    /// Strongest response of a steerable edge filter.
    Sfil,
    /// Energy of a middle frequency of the cosine transform.
    Dctm,
}

impl Operator {
    /// Every operator, in the order of the paper's Table 1.
    pub const ALL: [Self; 11] = [
        Self::Cheb,
        Self::Helm,
        Self::Eigv,
        Self::Gllv,
        Self::Sml,
        Self::Lap3,
        Self::Grad,
        Self::Wavs,
        Self::Acmo,
        Self::Sfil,
        Self::Dctm,
    ];

    /// The name in the paper.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cheb => "CHEB",
            Self::Helm => "HELM",
            Self::Eigv => "EIGV",
            Self::Gllv => "GLLV",
            Self::Sml => "SML",
            Self::Lap3 => "LAP3",
            Self::Grad => "GRAD",
            Self::Wavs => "WAVS",
            Self::Acmo => "ACMO",
            Self::Sfil => "SFIL",
            Self::Dctm => "DCTM",
        }
    }

    /// What it is.
    pub fn title(self) -> &'static str {
        match self {
            Self::Cheb => "Chebyshev moments",
            Self::Helm => "Helmli's mean",
            Self::Eigv => "eigenvalues",
            Self::Gllv => "variance of the local variance",
            Self::Sml => "sum of the modified Laplacian",
            Self::Lap3 => "diagonal Laplacian",
            Self::Grad => "Tenengrad gradient",
            Self::Wavs => "sum of wavelet coefficients",
            Self::Acmo => "absolute central moment",
            Self::Sfil => "steerable filters",
            Self::Dctm => "modified cosine transform",
        }
    }

    /// The smallest width and height, pixels, of a picture that it makes sense for: that of its filter.
    pub fn smallest_side(self) -> usize {
        match self {
            Self::Acmo => 2,
            Self::Cheb | Self::Eigv | Self::Sml | Self::Lap3 | Self::Grad => 3,
            Self::Dctm => 4,
            Self::Wavs => wavelet::LENGTH,
            Self::Helm | Self::Gllv | Self::Sfil => WINDOW,
        }
    }

    /// Its value: the larger the sharper, in units of its own. Pictures below the smallest side get a number without meaning.
    pub fn value(self, image: &GreyImage) -> f64 {
        match self {
            Self::Cheb => transform::chebyshev_moments(image),
            Self::Helm => statistics::helmli_mean(image),
            Self::Eigv => transform::eigenvalues(image),
            Self::Gllv => statistics::local_variance(image),
            Self::Sml => laplacian::modified(image),
            Self::Lap3 => laplacian::diagonal(image),
            Self::Grad => gradient::tenengrad(image),
            Self::Wavs => wavelet::coefficients(image),
            Self::Acmo => statistics::absolute_central_moment(image),
            Self::Sfil => gradient::steerable(image),
            Self::Dctm => transform::cosine(image),
        }
    }
}

impl fmt::Display for Operator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// An operator name that is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct UnknownOperator;

impl fmt::Display for UnknownOperator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = Operator::ALL.map(Operator::name).join(", ");
        write!(f, "no such operator; use one of {names}")
    }
}

impl std::error::Error for UnknownOperator {}

impl FromStr for Operator {
    type Err = UnknownOperator;
    fn from_str(name: &str) -> Result<Self, UnknownOperator> {
        Self::ALL.into_iter().find(|operator| operator.name() == name).ok_or(UnknownOperator)
    }
}
