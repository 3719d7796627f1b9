//! What parts of the picture say in a report.

use serde::{Deserialize, Serialize};

use crate::State;

/// Where each part of the picture is sharp by all sweeps together, the delay of the pixels taken off; row by row from the top
/// left, all lists with `columns` times `rows` entries. Nothing for a part without a peak above chance.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct FocusMap {
    /// Parts beside each other.
    pub columns: u64,
    /// Parts above each other.
    pub rows: u64,
    /// Where the part was sharpest, in counts.
    pub position: Vec<Option<f64>>,
    /// One standard deviation of that, in counts.
    pub error_bar: Vec<Option<f64>>,
    /// The probability, 0 to 1, that it is right to within the depth of focus, or 1 % of the range if that is more.
    pub confidence: Vec<Option<f64>>,
    /// How high the part's peak is in units of what chance makes.
    pub significance: Vec<Option<f64>>,
}

/// What a window of the request says by all sweeps together, as if it had been the one preferred.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WindowAnswer {
    /// Its first column of pixels.
    pub x: u64,
    /// Its first row.
    pub y: u64,
    /// Columns.
    pub width: u64,
    /// Rows.
    pub height: u64,
    /// [`State::Focused`] or [`State::Failed`].
    pub state: State,
    /// The named reason of a failure, in kebab case.
    pub reason: Option<String>,
    /// The failure in a sentence.
    pub message: Option<String>,
    /// Where it is sharp, in counts.
    pub position: Option<f64>,
    /// One standard deviation of the position, in counts.
    pub error_bar: Option<f64>,
    /// The probability, 0 to 1, that it is right to within the depth of focus, or 1 % of the range if that is more.
    pub confidence: Option<f64>,
    /// What is odd, as in the result of the run.
    pub flags: Vec<String>,
}
