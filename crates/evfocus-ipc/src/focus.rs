//! Starting a focus run and following it.

use serde::{Deserialize, Serialize};

use crate::{Phase, Report};

/// Positions from `min` to `max`, in the lens's own counts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LensRange {
    /// The low end, in counts.
    pub min: f64,
    /// The high end, in counts; above `min`.
    pub max: f64,
}

/// How to focus. What is left out is taken from the daemon's configuration.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct FocusRequest {
    /// The search: `egs`, `egs-official`, `er-fixed`, `er-squared`, `structure`, ...; an unknown one is answered with the known ones.
    pub method: Option<String>,
    /// The positions to sweep, in counts.
    pub range: Option<LensRange>,
    /// The speed of the sweep in counts per second.
    pub speed_counts_per_s: Option<f64>,
    /// The accumulation interval of the fixed-interval measures, in microseconds.
    pub interval_us: Option<u64>,
    /// Which ways to sweep: `forward`, or `both` for there and back, which cancels lag and backlash.
    pub directions: Option<String>,
}

/// News of a run. The last one has `done` and the report.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// The run.
    pub run_id: u64,
    /// What it is at.
    pub phase: Phase,
    /// Where the lens is, in counts.
    pub lens_position: Option<f64>,
    /// Events per second.
    pub event_rate: f64,
    /// A new point of the focus curve.
    pub curve_point: Option<CurvePoint>,
    /// How many messages before this one were dropped because this follower read too slowly. The report has every point.
    pub missed: u64,
    /// The run is over, and this is the last message.
    pub done: bool,
    /// The report; with `done` only.
    pub report: Option<Report>,
}

/// One point of the focus curve.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CurvePoint {
    /// The lens position in counts, at the middle of the interval.
    pub position: f64,
    /// Events per second.
    pub rate: f64,
    /// Camera time of the middle of the interval, in microseconds.
    pub t_us: i64,
}
