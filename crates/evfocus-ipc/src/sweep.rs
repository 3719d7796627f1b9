//! One sweep of a report.

use serde::{Deserialize, Serialize};

use crate::State;

/// One sweep of the lens, and what was read off it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sweep {
    /// Which way.
    pub direction: Direction,
    /// Where it began, in counts.
    pub from: f64,
    /// Where it ended, in counts.
    pub to: f64,
    /// Camera time at its start, in microseconds.
    pub start_us: i64,
    /// Camera time at its end, in microseconds.
    pub end_us: i64,
    /// The event rate along it.
    pub curve: Curve,
    /// What each estimator said, whether or not it decided; those that read every event with the delay of the pixels still in it.
    pub estimators: Vec<Estimate>,
    /// Whether its counts are fit to find focus with.
    pub quality: Quality,
    /// What the fine structure of the whole picture says; nothing if it was not asked or found no peak.
    #[serde(default)]
    pub structure: Option<Structure>,
}

/// What the fine structure of a picture says of one sweep. Positions have the delay of the pixels still in them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Structure {
    /// Where the picture was sharpest, in counts.
    pub position: f64,
    /// Full width of the peak at half its height, in counts.
    pub width: f64,
    /// How high the peak is in units of what chance makes.
    pub significance: f64,
    /// One standard deviation of the position, in counts, the delay of the pixels apart.
    pub scatter: f64,
    /// Noise of the pixels, in events per second each.
    pub noise_hz: f64,
    /// Where a good part of the picture was sharpest, if elsewhere; in counts.
    pub second_depth: Option<f64>,
    /// Passes over the events.
    pub passes: u64,
}

/// What the counts of a sweep look like.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Quality {
    /// Share of the 5 ms windows whose rate is near the greatest, 0 to 1; above 0.3 without scatter the read-out or the link is the limit.
    pub share_at_ceiling: f64,
    /// Variance over mean of the counts in 0.2 ms bins of the busiest half: 1 for chance, below 0.1 a read-out limit.
    pub regularity: f64,
    /// Variance over mean of the counts in fiftieths of the sweep: below 2 the rate does not depend on the lens.
    pub dispersion: f64,
    /// The mains frequency at which the light flickers most, in Hz: 100 or 120; 0 if unknown.
    pub flicker_hz: u64,
    /// How much of the rate flickers, 0 to 2; above 0.3 it is a warning.
    pub flicker_depth: f64,
}

/// The focus curve; all lists have the same length.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Curve {
    /// Lens positions in counts.
    pub position: Vec<f64>,
    /// Events per second.
    pub rate: Vec<f64>,
    /// Camera times in microseconds.
    pub t_us: Vec<i64>,
}

/// The direction of a sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// The first sweep.
    Forward,
    /// The second sweep, the way back.
    Backward,
}

/// What one estimator found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Its name, as in a request.
    pub method: String,
    /// [`State::Focused`] or [`State::Failed`].
    pub state: State,
    /// Why it found nothing, in words.
    pub reason: Option<String>,
    /// The position found, in counts.
    pub position: Option<f64>,
    /// Camera time of that position in the sweep, in microseconds.
    pub t_us: Option<i64>,
    /// Steps of the search.
    pub iterations: u64,
    /// Events that the answer rests on.
    pub events: u64,
}
