//! The highest event rate at a fixed accumulation interval, the paper's Algorithm 1.

use core::time::Duration;

use super::{Estimate, SearchError};
use crate::sweep::Sweep;

/// Step between two windows, microseconds. The paper leaves it open; a lens moves by two counts in this time.
const STEP_US: f64 = 1_000.0;

/// `er-fixed`: windows of `interval` centred on every millisecond from the first event to the last; the fullest wins, the first of
/// equals. A window that reaches beyond the sweep holds only what happened within.
pub(super) fn search(sweep: &Sweep<'_>, interval: Duration) -> Result<Estimate, SearchError> {
    let (start, end) = (sweep.start.0 as f64, sweep.end.0 as f64);
    let interval_us = interval.as_nanos() as f64 / 1e3;
    if interval_us <= 0.0 || interval_us > end - start {
        return Err(SearchError::IntervalTooLong { interval_us, sweep_us: end - start });
    }
    let (mut fullest, mut best_us, mut iterations) = (0.0, start, 0);
    let mut centre = start;
    while centre <= end {
        let from = (centre - interval_us / 2.0).max(start);
        let to = (centre + interval_us / 2.0).min(end);
        let count = sweep.events_until(to)? - sweep.events_before(from)?;
        if count > fullest {
            (fullest, best_us) = (count, centre);
        }
        iterations += 1;
        centre = start + f64::from(iterations) * STEP_US;
    }
    Ok(Estimate { position: sweep.position_at(best_us)?, t_us: best_us, iterations, interval_us })
}
