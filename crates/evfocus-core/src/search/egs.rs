//! Event-based golden search, the paper's Algorithm 2 with the offsets that its print lacks.
//!
//! Printed: `T2 = phi T` and `T1 = (1 - phi) T`. Meant: `T2 = T1 + phi T` and `T1 = T1 + (1 - phi) T`. The print is harmless only
//! while T1 is zero; `tests/algorithm_2.rs` runs both side by side.

use super::{Estimate, SearchError, all_events_kept};
use crate::measure::PixelCounts;
use crate::sweep::Sweep;

/// phi of Algorithm 2, (sqrt(5) - 1) / 2: what remains of the range after each comparison.
pub const GOLDEN_RATIO: f64 = 0.618_033_988_749_894_9;

/// mu of Algorithm 2: the search ends when the range is this short, microseconds.
pub const STOP_INTERVAL_US: f64 = 1_000.0;

/// 64 comparisons shorten a range by a factor of 2e13; a search that needs more is broken.
pub const MAX_ITERATIONS: u32 = 64;

/// Two windows are told apart by the events that only one of them holds. If fewer than this many are left, even all of them on one
/// side is no news (probability 2 / 2^5 = 6 % by chance).
const FEWEST_DECISIVE_EVENTS: f64 = 6.0;

/// The scores of two windows of equal length, or that they cannot be told apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Comparison {
    /// The first window scores at least as high as the second.
    First,
    /// The second window scores higher.
    Second,
    /// There are too few events to tell.
    Undecided,
}

/// Algorithm 2 on any focus measure: `compare(first, second)` says which of two overlapping windows, each (from, to), is the
/// sharper one. Returns the range that is left and the number of comparisons.
///
/// # Errors
/// Whatever `compare` fails with.
pub fn golden_search<E>(
    range: (f64, f64),
    mut compare: impl FnMut((f64, f64), (f64, f64)) -> Result<Comparison, E>,
) -> Result<((f64, f64), u32), E> {
    let (mut t1, mut t2) = range;
    let mut iterations = 0;
    while t2 - t1 > STOP_INTERVAL_US && iterations < MAX_ITERATIONS {
        let interval = GOLDEN_RATIO * (t2 - t1);
        let (first, second) = ((t1, t1 + interval), (t2 - interval, t2));
        iterations += 1;
        match compare(first, second)? {
            Comparison::First => t2 = first.1,
            Comparison::Second => t1 = second.0,
            Comparison::Undecided => break,
        }
    }
    Ok(((t1, t2), iterations))
}

/// `egs`: golden search on the event rate, a few differences of partial sums a comparison. Equal windows make rates and counts
/// the same question.
pub(super) fn search(sweep: &Sweep<'_>) -> Result<Estimate, SearchError> {
    let (range, iterations) = golden_search(bounds(sweep), |first, second| {
        // What both windows hold cancels: compare what only one holds.
        let only_first = sweep.events_before(second.0)? - sweep.events_before(first.0)?;
        let only_second = sweep.events_until(second.1)? - sweep.events_until(first.1)?;
        Ok::<_, SearchError>(if only_first + only_second < FEWEST_DECISIVE_EVENTS {
            Comparison::Undecided
        } else if only_first >= only_second {
            Comparison::First
        } else {
            Comparison::Second
        })
    })?;
    answer(sweep, range, iterations)
}

/// `er-squared`: golden search on the sum of squared per-pixel event rates.
pub(super) fn search_squared(sweep: &Sweep<'_>, pixels: &mut PixelCounts) -> Result<Estimate, SearchError> {
    all_events_kept(sweep)?;
    let (range, iterations) = golden_search(bounds(sweep), |first, second| {
        let events = sweep.store.first_at_or_after(second.1) - sweep.store.first_at_or_after(first.0);
        let score_first = pixels.event_rate_squared(sweep.store, first.0, first.1);
        let score_second = pixels.event_rate_squared(sweep.store, second.0, second.1);
        Ok::<_, SearchError>(if (events as f64) < FEWEST_DECISIVE_EVENTS {
            Comparison::Undecided
        } else if score_first >= score_second {
            Comparison::First
        } else {
            Comparison::Second
        })
    })?;
    answer(sweep, range, iterations)
}

/// The range of all events, from the first one to the last one.
fn bounds(sweep: &Sweep<'_>) -> (f64, f64) {
    (sweep.start.0 as f64, sweep.end.0 as f64)
}

fn answer(sweep: &Sweep<'_>, range: (f64, f64), iterations: u32) -> Result<Estimate, SearchError> {
    let t_us = f64::midpoint(range.0, range.1);
    Ok(Estimate {
        position: sweep.position_at(t_us)?,
        t_us,
        iterations,
        interval_us: GOLDEN_RATIO * (range.1 - range.0),
    })
}
