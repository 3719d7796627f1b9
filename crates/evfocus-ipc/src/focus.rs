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
    /// The search: `auto`, `structure`, `egs`, ...; an unknown one is answered with the known ones.
    pub method: Option<String>,
    /// The positions to sweep, in counts.
    pub range: Option<LensRange>,
    /// How thorough: `fast`, one sweep that ends beyond the peak, if that is sure enough; `normal`, and back over the peak;
    /// `accurate`, the whole range both ways.
    #[serde(default)]
    pub speed: Option<String>,
    /// The speed of the sweep in counts per second.
    pub speed_counts_per_s: Option<f64>,
    /// The accumulation interval of the fixed-interval measures, in microseconds.
    pub interval_us: Option<u64>,
    /// Which ways to sweep, whatever the speed: `forward`, or `both` for there and back, which cancels the lag.
    pub directions: Option<String>,
    /// The windows of the picture to focus on, at most 8; the whole picture if there are none.
    #[serde(default)]
    pub windows: Vec<FocusWindow>,
    /// Which of several windows or depths counts: `strongest`, `nearest`, or the number of a window, counted from 0.
    #[serde(default)]
    pub prefer: Option<String>,
}

/// A rectangle of the picture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FocusWindow {
    /// Its left edge.
    pub x: f64,
    /// Its upper edge.
    pub y: f64,
    /// From the left edge to the right one.
    pub width: f64,
    /// From the upper edge to the lower one.
    pub height: f64,
    /// Of all four; pixels if left out.
    #[serde(default)]
    pub unit: Option<WindowUnit>,
}

/// The unit of a window's numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WindowUnit {
    /// Pixels; whole numbers.
    Pixels,
    /// Parts of the picture's width and height, 0 to 1.
    Fraction,
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
