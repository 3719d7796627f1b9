//! What was measured of a lens.

use serde::{Deserialize, Serialize};

use crate::LensRange;

/// The value of [`Calibration::format`] that this version writes and reads.
pub const CALIBRATION_FORMAT: u64 = 1;

/// What `Calibrate` has measured of a lens; the file in the state directory holds the same.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// The version of this format, [`CALIBRATION_FORMAT`].
    pub format: u64,
    /// The lens, model and serial: for another one it does not count.
    pub lens: String,
    /// When it was measured, in seconds since 1970 (UTC).
    pub measured_unix_s: f64,
    /// Where the lens came to rest at either end, in counts.
    pub range: LensRange,
    /// Its speed at full speed, in counts per second; the slower of the two ways.
    pub speed_counts_per_s: f64,
    /// Positions per second while it moved.
    pub read_back_hz: f64,
    /// From the question for a position to its answer, the median, in microseconds.
    pub read_back_us: f64,
    /// Noise of the positions at rest, root mean square, in counts.
    pub read_noise: f64,
    /// From an order to the first motion that the positions show, in microseconds; known to half the time between two positions.
    pub command_latency_us: f64,
    /// From the order to stop until the lens stood, at full speed, in microseconds.
    pub stop_us: f64,
    /// How far it went on meanwhile, in counts.
    pub stop_counts: f64,
    /// Play between what the lens says and the glass, in counts; nothing if the camera could not tell.
    pub backlash: Option<f64>,
    /// One standard deviation of it, in counts.
    pub backlash_error_bar: Option<f64>,
    /// How late pixels and positions together are, in microseconds; measured with the play.
    pub lag_us: Option<f64>,
    /// What was odd, and what could not be measured, one sentence each.
    pub notes: Vec<String>,
}
