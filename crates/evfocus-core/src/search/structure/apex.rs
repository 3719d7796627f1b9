//! The apex of the energy along the sweep.

use alloc::vec;
use alloc::vec::Vec;

use super::StructureKernel;

/// Width of the first smoothing (Gaussian, standard deviation), bins: narrower than any peak seen.
const FIRST_SMOOTHING: f64 = 6.0;
/// Width of the second smoothing in parts of the peak's width.
const SECOND_SMOOTHING: f64 = 1.0 / 8.0;
/// The base of the peak lies below all but this part of the curve.
const BASE_SHARE: usize = 10;
/// The parabola goes through what lies above this part of the peak's height.
const TOP: f64 = 0.85;

/// Where a curve is highest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Apex {
    /// The vertex, in bins from the start of the sweep.
    pub at: f64,
    /// Full width at half height, bins.
    pub width: f64,
    /// How high the peak is in units of what chance makes over its width.
    pub significance: f64,
}

/// Finds the apex; its room is allocated once.
#[derive(Debug, Clone)]
pub struct ApexFinder {
    curve: Vec<f64>,
    smooth: Vec<f64>,
    sorted: Vec<f64>,
    weights: Vec<f64>,
}

/// A peak of the smoothed curve.
#[derive(Debug, Clone, Copy)]
struct Peak {
    index: usize,
    base: f64,
    height: f64,
}

impl Default for ApexFinder {
    fn default() -> Self {
        Self::new()
    }
}

impl ApexFinder {
    /// Room for a curve of [`StructureKernel::BINS`] points.
    pub fn new() -> Self {
        let room = || vec![0.0; StructureKernel::BINS];
        Self { curve: room(), smooth: room(), sorted: room(), weights: room() }
    }

    /// The apex of the curve that grows by `growth` in each bin.
    pub fn find(&mut self, growth: &[i64]) -> Apex {
        let mut sum = 0;
        for (point, grown) in self.curve.iter_mut().zip(growth) {
            sum += grown;
            *point = sum as f64;
        }
        self.smooth(FIRST_SMOOTHING);
        let peak = self.peak();
        let (from, to) = self.stretch_above(peak, 0.5);
        let width = (to - from + 1) as f64;
        let chance = chance_step(growth) * libm::sqrt(width);
        let significance = if chance > 0.0 { peak.height / chance } else { 0.0 };
        self.smooth((width * SECOND_SMOOTHING).max(1.0));
        let top = self.peak();
        let (from, to) = self.stretch_above(top, TOP);
        let vertex =
            self.curve.get(from..=to).and_then(vertex).map_or(top.index as f64, |at| from as f64 + at);
        // A point of the curve holds what happened up to the end of its bin.
        Apex { at: vertex + 1.0, width, significance }
    }

    /// Smoothes the curve with a Gaussian of `sigma` bins; its ends are held.
    fn smooth(&mut self, sigma: f64) {
        for (distance, weight) in self.weights.iter_mut().enumerate() {
            let deviations = distance as f64 / sigma;
            *weight = libm::exp(-deviations * deviations / 2.0);
        }
        let reach = (libm::ceil(4.0 * sigma) as usize).min(self.weights.len() - 1);
        let last = self.curve.len() - 1;
        for (index, smooth) in self.smooth.iter_mut().enumerate() {
            let (mut sum, mut total) = (0.0, 0.0);
            for (distance, &weight) in self.weights.iter().enumerate().take(reach + 1) {
                let sides = [index.saturating_sub(distance), (index + distance).min(last)];
                for &side in sides.iter().take(if distance == 0 { 1 } else { 2 }) {
                    sum += weight * self.curve.get(side).copied().unwrap_or(0.0);
                    total += weight;
                }
            }
            *smooth = sum / total;
        }
    }

    fn peak(&mut self) -> Peak {
        self.sorted.copy_from_slice(&self.smooth);
        self.sorted.sort_unstable_by(f64::total_cmp);
        let base = self.sorted.get(self.sorted.len() / BASE_SHARE).copied().unwrap_or(0.0);
        let highest = self.smooth.iter().copied().enumerate().max_by(|(_, a), (_, b)| a.total_cmp(b));
        let (index, top) = highest.unwrap_or((0, 0.0));
        Peak { index, base, height: top - base }
    }

    /// The first and the last point of the stretch around the peak that lies above `share` of its height.
    fn stretch_above(&self, peak: Peak, share: f64) -> (usize, usize) {
        let level = peak.base + share * peak.height;
        let (before, after) = self.smooth.split_at(peak.index);
        let below = before.iter().rev().take_while(|&&point| point > level).count();
        let above = after.iter().skip(1).take_while(|&&point| point > level).count();
        (peak.index - below, peak.index + above)
    }
}

/// The vertex of the least-squares parabola through `points`, counted from the first; `None` if it does not open downwards or if its
/// vertex lies outside: then the points are no top.
fn vertex(points: &[f64]) -> Option<f64> {
    let middle = (points.len() - 1) as f64 / 2.0;
    let (mut x2, mut x4, mut y, mut xy, mut x2y) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (index, point) in points.iter().enumerate() {
        let x = index as f64 - middle;
        x2 += x * x;
        x4 += x * x * x * x;
        y += point;
        xy += x * point;
        x2y += x * x * point;
    }
    let number = points.len() as f64;
    let slope = xy / x2;
    let curvature = (number * x2y - x2 * y) / (number * x4 - x2 * x2);
    let vertex = -slope / (2.0 * curvature);
    (curvature < 0.0 && libm::fabs(vertex) <= middle).then_some(middle + vertex)
}

/// What chance adds to the curve in a bin, from the differences of neighbouring bins: they have twice the variance, and the
/// slow change of the growth drops out.
fn chance_step(growth: &[i64]) -> f64 {
    let mut squares = 0.0;
    for (one, next) in growth.iter().zip(growth.iter().skip(1)) {
        let difference = (next - one) as f64;
        squares += difference * difference;
    }
    libm::sqrt(squares / (2.0 * growth.len().saturating_sub(1).max(1) as f64))
}
