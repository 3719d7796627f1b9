//! The focus curve: event rate against lens position.

use alloc::vec::Vec;

use crate::measure::event_rate;
use crate::sweep::Sweep;
use crate::units::{EventRate, LensPosition};

/// One point of the curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CurvePoint {
    /// Middle of the point's interval, camera time in microseconds.
    pub t_us: f64,
    /// Lens position then.
    pub position: LensPosition,
    /// Event rate over the interval.
    pub rate: EventRate,
}

/// Points in the order of time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FocusCurve {
    points: Vec<CurvePoint>,
}

impl FocusCurve {
    /// Points of a curve over a whole sweep: 20 lens counts each on the paper's rig, and about the width of a terminal.
    pub const POINTS: usize = 176;

    /// A curve with room for [`POINTS`](Self::POINTS).
    pub fn new() -> Self {
        Self { points: Vec::with_capacity(Self::POINTS) }
    }

    /// Replaces the points by the event rates of `sweep` in [`POINTS`](Self::POINTS) intervals of equal length. Intervals for which
    /// the counts or the lens position are not known are left out.
    pub fn fill(&mut self, sweep: &Sweep<'_>) {
        self.points.clear();
        let step = sweep.length_us() / Self::POINTS as f64;
        if step <= 0.0 {
            return;
        }
        for index in 0..Self::POINTS {
            let from = sweep.start.0 as f64 + index as f64 * step;
            let middle = from + step / 2.0;
            if let (Ok(rate), Ok(position)) =
                (event_rate(sweep.counter, from, from + step), sweep.position_at(middle))
            {
                self.points.push(CurvePoint { t_us: middle, position, rate });
            }
        }
    }

    /// Forgets the points and keeps the memory.
    pub fn clear(&mut self) {
        self.points.clear();
    }

    /// The points, in the order of time.
    pub fn points(&self) -> &[CurvePoint] {
        &self.points
    }
}
