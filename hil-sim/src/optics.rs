//! From lens position to blur: the thin lens, and a stack of pictures blurred beforehand.

use std::f64::consts::TAU;

use crate::ConfigError;
use crate::fourier::{Fourier, Texture, frequency};
use crate::names::named;

/// Shape of the blur.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum PointSpread {
    /// A disc of even brightness: geometric optics.
    Disc,
    /// A Gaussian with half the disc's radius as its sigma, which has the disc's variance.
    Gaussian,
}

named!(PointSpread, "point spread", { Disc => "disc", Gaussian => "gaussian" });

/// The optics (sensor-and-optics, section 2).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OpticsConfig {
    /// Growth of the blur circle's diameter, pixels per lens count from focus. 0.015 to 0.07; default 0.0175, and 3.8 times
    /// that in the IMX636 presets.
    pub blur_px_per_count: f64,
    /// The growth above focus as a multiple of that below. Default 1; spherical aberration makes 1.15.
    pub slope_ratio: f64,
    /// How much further up the lens range the right margin of the picture is in focus than the left one, counts: a tilted
    /// sensor. In between it goes in proportion, and the picture's middle keeps the scene's focus. Default 0.
    pub tilt_counts: f64,
    /// Growth of the picture over the whole lens range, as a share; -0.04 to 0.04. Default 0.
    pub breathing: f64,
    /// Sigma of aberrations and diffraction in focus, pixels; the pixel's square aperture adds to it. Default 0.45.
    pub floor_sigma_px: f64,
    /// Shape of the blur. Default a disc.
    pub point_spread: PointSpread,
}

impl OpticsConfig {
    /// Radius of the blur circle, pixels, `counts` above (or, negative, below) focus.
    pub(crate) fn radius(&self, counts: f64) -> f64 {
        let slope = if counts > 0.0 { self.slope_ratio } else { 1.0 };
        0.5 * self.blur_px_per_count * slope * counts.abs()
    }

    /// Radius of the largest blur circle of anything that is sharp at `focus`, for positions from `low` to `high`.
    pub(crate) fn largest_radius(&self, focus: f64, (low, high): (f64, f64)) -> f64 {
        let margin = 0.5 * self.tilt_counts.abs();
        self.radius(low - focus - margin).max(self.radius(high - focus + margin))
    }

    pub(crate) fn validate(&self) -> Result<(), ConfigError> {
        ConfigError::check("optics.blur_px_per_count", self.blur_px_per_count, 0.0, 1.0)?;
        ConfigError::check("optics.slope_ratio", self.slope_ratio, 0.1, 10.0)?;
        ConfigError::check("optics.tilt_counts", self.tilt_counts, -1e4, 1e4)?;
        ConfigError::check("optics.breathing", self.breathing, -0.2, 0.2)?;
        ConfigError::check("optics.floor_sigma_px", self.floor_sigma_px, 0.05, 20.0)
    }
}

impl Default for OpticsConfig {
    fn default() -> Self {
        Self {
            blur_px_per_count: 0.0175,
            slope_ratio: 1.0,
            tilt_counts: 0.0,
            breathing: 0.0,
            floor_sigma_px: 0.45,
            point_spread: PointSpread::Disc,
        }
    }
}

/// From one level of the stack to the next the variance of the blur grows by this factor: at 1.3 the picture changes so
/// nearly in proportion to the variance that the blend of two levels cannot be told from the real thing.
const VARIANCE_STEP: f64 = 1.3;

/// A scene blurred by every degree that the lens can produce.
#[derive(Debug, Clone)]
pub(crate) struct BlurStack {
    pub(crate) levels: Vec<Texture>,
    /// Square of the blur radius of each level, pixels squared.
    squares: Vec<f64>,
}

/// Two neighbouring levels and how to blend them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Blend {
    /// The sharper level; the next one is the other.
    pub(crate) level: usize,
    /// Share of the other, 0 to 1.
    pub(crate) share: f32,
}

impl BlurStack {
    pub(crate) fn new(scene: &Texture, optics: &OpticsConfig, largest_radius: f64) -> Self {
        let floor = optics.floor_sigma_px * optics.floor_sigma_px + 1.0 / 12.0;
        // A disc of radius r has the variance r^2 / 4 along each axis.
        let mut squares = vec![0.0];
        let mut variance = floor;
        while squares.len() < 2 || squares.last().is_some_and(|&last| last < largest_radius * largest_radius)
        {
            variance *= VARIANCE_STEP;
            squares.push(4.0 * (variance - floor));
        }
        let fourier = Fourier::new(scene.width, scene.height);
        let spectrum = fourier.spectrum(scene);
        let axis = |count: usize| -> Vec<(f64, f32)> {
            let point = |index| {
                let frequency = frequency(index, count);
                (frequency * frequency, floor_transfer(optics.floor_sigma_px, frequency) as f32)
            };
            (0..count).map(point).collect()
        };
        let (columns, rows) = (axis(scene.width), axis(scene.height));
        let disc = Jinc::up_to(TAU * squares.last().map_or(0.0, |square| square.sqrt()) * 0.5_f64.sqrt());
        let blur = |square: f64, frequency_squared: f64| match optics.point_spread {
            PointSpread::Disc => disc.at(TAU * (square * frequency_squared).sqrt()),
            PointSpread::Gaussian => gaussian_transfer(square / 4.0, frequency_squared) as f32,
        };
        let mut levels = Vec::with_capacity(squares.len() + 1);
        for pair in squares.chunks(2) {
            levels.extend(fourier.filtered(&spectrum, |x, y| {
                let ((u, floor_x), (v, floor_y)) = (columns[x], rows[y]);
                // The last level of an odd number is its own companion; the surplus is cut off below.
                [0, pair.len() - 1].map(|level| floor_x * floor_y * blur(pair[level], u + v))
            }));
        }
        levels.truncate(squares.len());
        Self { levels, squares }
    }

    /// The blend for a blur of `radius` pixels. In proportion to the radius' square, that is to the variance: only then does
    /// the picture stand still at focus, as it must for the event rate to dip there.
    pub(crate) fn blend(&self, radius: f64) -> Blend {
        let square = radius * radius;
        let above = self.squares.partition_point(|&level| level <= square).clamp(1, self.squares.len() - 1);
        let (low, high) = (self.squares[above - 1], self.squares[above]);
        Blend { level: above - 1, share: ((square - low) / (high - low)).clamp(0.0, 1.0) as f32 }
    }

    /// Puts `pixels` (row by row) of the picture blurred by `blend` into `out`.
    pub(crate) fn mix(&self, pixels: std::ops::Range<usize>, blend: Blend, out: &mut [f32]) {
        let [sharp, soft] =
            [blend.level, blend.level + 1].map(|level| &self.levels[level].values[pixels.clone()]);
        mix(sharp, soft, blend.share, out);
    }
}

/// `out = first + share (second - first)`.
pub(crate) fn mix(first: &[f32], second: &[f32], share: f32, out: &mut [f32]) {
    for ((out, first), second) in out.iter_mut().zip(first).zip(second) {
        *out = first + share * (second - first);
    }
}

/// What aberrations and the pixel's square aperture leave of a sinusoid along one axis: the sum over the sampled picture's
/// aliases, which is the transfer function of the kernel *on the pixel grid*, positive everywhere. Cut off at half a cycle
/// per pixel instead, the kernel would ring, and sharp edges with it.
fn floor_transfer(sigma: f64, frequency: f64) -> f64 {
    let aliases = (-2..=2).map(|alias| frequency + f64::from(alias));
    aliases.map(|f| gaussian_transfer(sigma * sigma, f * f) * sinc(f)).sum()
}

/// What a Gaussian of `variance` pixels squared leaves of a sinusoid.
fn gaussian_transfer(variance: f64, frequency_squared: f64) -> f64 {
    (-0.5 * TAU * TAU * variance * frequency_squared).exp()
}

/// sin(pi x) / (pi x).
fn sinc(x: f64) -> f64 {
    let argument = std::f64::consts::PI * x;
    if argument.abs() < 1e-6 { 1.0 } else { argument.sin() / argument }
}

/// 2 J1(x) / x, what a disc leaves of a sinusoid, from a table: the function itself would take most of the time in which
/// a rig is built.
#[derive(Debug)]
struct Jinc(Vec<f32>);

impl Jinc {
    /// Entries per unit: interpolation between them errs by 4e-6.
    const DENSITY: f64 = 100.0;

    fn up_to(largest: f64) -> Self {
        let value = |index: usize| {
            let x = index as f64 / Self::DENSITY;
            if index == 0 { 1.0 } else { (2.0 * libm::j1(x) / x) as f32 }
        };
        Self((0..(largest * Self::DENSITY) as usize + 3).map(value).collect())
    }

    fn at(&self, x: f64) -> f32 {
        let scaled = x * Self::DENSITY;
        let index = (scaled as usize).min(self.0.len() - 2);
        self.0[index] + (scaled - index as f64) as f32 * (self.0[index + 1] - self.0[index])
    }
}
