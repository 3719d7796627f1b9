//! The apex of the energy along the sweep.

use alloc::vec::Vec;

use super::bookings::Bookings;

/// Width of the first smoothing (Gaussian, standard deviation), bins: narrower than any peak seen.
const FIRST_SMOOTHING: f64 = 6.0;
/// Width of the second smoothing in parts of the peak's width.
const SECOND_SMOOTHING: f64 = 1.0 / 8.0;
/// A Gaussian is cut off this many standard deviations from its middle.
const REACH: f64 = 4.0;
/// The base of the peak lies below all but this part of the curve.
const BASE_SHARE: usize = 10;
/// The parabola goes through what lies above this part of the peak's height.
pub(super) const TOP: f64 = 0.85;

/// How far chance moves a vertex, as a part of the peak's width over its significance; and what it errs by in any case. Both from the
/// tiles of sweeps whose focus is known.
const CHANCE: f64 = 0.7;
const UNSEEN: f64 = 0.02;

/// Where a curve is highest.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Apex {
    /// The vertex, in bins from the start of the sweep.
    pub at: f64,
    /// Full width at half height, bins.
    pub width: f64,
    /// How high the peak is above its base, in the curve's units.
    pub height: f64,
    /// How high the peak is in units of what chance makes over its width.
    pub significance: f64,
    /// How high the curve ends, as a part of the peak's height.
    pub end_level: f64,
}

impl Apex {
    /// One standard deviation of the vertex by its significance alone, bins.
    pub(super) fn error_bar(self) -> f64 {
        let by_chance = CHANCE / self.significance.max(1.0);
        self.width * (UNSEEN + by_chance)
    }
}

/// Finds the apex; its room is allocated once.
#[derive(Debug, Clone)]
pub struct ApexFinder {
    /// The curve with its ends held on both sides, as far as a smoothing reaches.
    padded: Vec<f64>,
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
    /// Room for a curve of [`Bookings::BINS`] points.
    pub fn new() -> Self {
        let room = |curves: usize| Vec::with_capacity(curves * Bookings::BINS);
        Self { padded: room(3), smooth: room(1), sorted: room(1), weights: room(1) }
    }

    /// The apex of `curve`, of at most [`Bookings::BINS`] points; each holds what happened up to the end of its bin. The parabola
    /// goes through what lies above the part `top` of the peak's height. `None` for an empty curve.
    pub fn find(&mut self, curve: &[f64], top: f64) -> Option<Apex> {
        let curve = curve.get(..curve.len().min(Bookings::BINS)).filter(|curve| !curve.is_empty())?;
        self.smooth(curve, FIRST_SMOOTHING);
        let peak = self.peak();
        let (from, to) = self.stretch_above(peak, 0.5);
        let width = (to - from + 1) as f64;
        let chance = chance_step(curve) * libm::sqrt(width);
        let significance = if chance > 0.0 { peak.height / chance } else { 0.0 };
        self.smooth(curve, (width * SECOND_SMOOTHING).max(1.0));
        let highest = self.peak();
        let (from, to) = self.stretch_above(highest, top);
        let vertex =
            curve.get(from..=to).and_then(vertex).map_or(highest.index as f64, |at| from as f64 + at);
        let end = self.smooth.last().map_or(0.0, |last| last - highest.base);
        let end_level = if highest.height > 0.0 { end / highest.height } else { 1.0 };
        Some(Apex { at: vertex + 1.0, width, height: peak.height, significance, end_level })
    }

    /// Smoothes the curve with a Gaussian of `sigma` bins; its ends are held.
    fn smooth(&mut self, curve: &[f64], sigma: f64) {
        let reach = (libm::ceil(REACH * sigma) as usize).min(Bookings::BINS - 1);
        let (first, last) = (curve.first().copied().unwrap_or(0.0), curve.last().copied().unwrap_or(0.0));
        self.padded.clear();
        self.padded.extend(core::iter::repeat_n(first, reach));
        self.padded.extend_from_slice(curve);
        self.padded.extend(core::iter::repeat_n(last, reach));
        self.weights.clear();
        self.weights.extend((0..=reach).map(|distance| {
            let deviations = distance as f64 / sigma;
            libm::exp(-deviations * deviations / 2.0)
        }));
        let total = self.weights.iter().skip(1).sum::<f64>() * 2.0 + 1.0;
        self.smooth.clear();
        self.smooth.resize(curve.len(), 0.0);
        for (distance, &weight) in self.weights.iter().enumerate() {
            let weight = weight / total;
            let before = self.padded.get(reach - distance..).unwrap_or_default();
            let after = self.padded.get(reach + distance..).unwrap_or_default();
            // The middle counts once.
            let weight = if distance == 0 { weight / 2.0 } else { weight };
            for ((smooth, before), after) in self.smooth.iter_mut().zip(before).zip(after) {
                *smooth += weight * (before + after);
            }
        }
    }

    fn peak(&mut self) -> Peak {
        self.sorted.clear();
        self.sorted.extend_from_slice(&self.smooth);
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

/// What chance adds to the curve in a bin, from its second differences: neighbouring steps of the curve have twice the variance of
/// one, and the slow change of the growth drops out.
fn chance_step(curve: &[f64]) -> f64 {
    let (mut squares, mut number) = (0.0, 0);
    for points in curve.windows(3) {
        if let [before, here, after] = points {
            let difference = before - 2.0 * here + after;
            squares += difference * difference;
            number += 1;
        }
    }
    libm::sqrt(squares / f64::from(2 * number.max(1)))
}
