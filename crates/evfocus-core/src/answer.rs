//! One answer from two directions, and whether to believe it.

use crate::report::Failure;
use crate::units::{LensPosition, LensRange};

/// What two sweeps say together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Combined {
    /// The mean of both: lag and backlash shift them in opposite directions and cancel.
    pub position: LensPosition,
    /// Half of forward less backward, counts: lag plus backlash, if both mean the same peak.
    pub half_difference: f64,
}

/// Takes the mean of the answers of the two directions.
///
/// # Errors
/// [`Failure::DirectionMismatch`] if their half-difference is more than `largest_mismatch_share` of `range`.
pub fn combine(
    forward: LensPosition,
    backward: LensPosition,
    range: LensRange,
    largest_mismatch_share: f64,
) -> Result<Combined, Failure> {
    let half_difference = forward.counts_from(backward) / 2.0;
    if libm::fabs(half_difference) > largest_mismatch_share * range.length() {
        return Err(Failure::DirectionMismatch { forward, backward });
    }
    Ok(Combined { position: LensPosition(f64::midpoint(forward.0, backward.0)), half_difference })
}

/// Whether `answer` is so near to an end of `range`, as a share of it, that focus is taken to lie beyond.
pub fn is_at_edge(answer: LensPosition, range: LensRange, edge_share: f64) -> bool {
    let to_edge = answer.distance(range.min()).min(answer.distance(range.max()));
    !range.contains(answer) || to_edge < edge_share * range.length()
}
