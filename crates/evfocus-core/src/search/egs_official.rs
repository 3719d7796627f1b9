//! What the code that the paper's authors published (`egs.m`) does, as described in their own terms, not a copy of it.
//!
//! It differs from the paper: the score is the count of all events by the interval; the constants are 0.618 and 0.381, so the
//! windows end at 0.618 and 0.999 of the range; the range is measured anew each round, from the first and last event of the subset
//! at hand; a window is scored only once an event after its end is seen; the next subset ends at that event; ties go to the first
//! window; the loop tests the range of the round before; the answer is the lens position at the centre of the better window.

use super::{Estimate, MAX_ITERATIONS, STOP_INTERVAL_US, SearchError, all_events_kept};
use crate::event_store::EventStore;
use crate::sweep::Sweep;

const WINDOW: f64 = 0.618;
const OFFSET: f64 = 0.381;

/// A window that has been scored.
struct Scored {
    count: usize,
    /// Time of the first event after the window, microseconds.
    after_us: f64,
    centre_us: f64,
}

/// Scores the window from `start_us` (not included) of `length_us` (end included), looking at events `from..to`. `None` if no
/// event after the end is seen.
fn score(store: &EventStore, (from, to): (usize, usize), start_us: f64, length_us: f64) -> Option<Scored> {
    let end_us = start_us + length_us;
    // Times are whole microseconds: "after t" is "at or after floor(t) + 1".
    let after = |micros: f64| store.first_at_or_after(libm::floor(micros) + 1.0);
    let (first, beyond) = (after(start_us).max(from), after(end_us));
    if beyond >= to {
        return None;
    }
    let after_us = store.get(beyond)?.t.0 as f64;
    Some(Scored { count: beyond.saturating_sub(first), after_us, centre_us: start_us + length_us / 2.0 })
}

/// `egs-official`.
pub(super) fn search(sweep: &Sweep<'_>) -> Result<Estimate, SearchError> {
    all_events_kept(sweep)?;
    let store = sweep.store;
    let (mut from, mut to) = (0, store.len());
    let mut centre_us = f64::midpoint(sweep.start.0 as f64, sweep.end.0 as f64);
    let mut interval_us = 0.0;
    let mut range_us = f64::INFINITY;
    let mut iterations = 0;
    while range_us > STOP_INTERVAL_US && iterations < MAX_ITERATIONS {
        let (Some(first), Some(last)) = (store.get(from), to.checked_sub(1).and_then(|last| store.get(last)))
        else {
            break;
        };
        let start_us = first.t.0 as f64;
        range_us = last.t.0 as f64 - start_us;
        let length_us = WINDOW * range_us;
        iterations += 1;
        let one = score(store, (from, to), start_us, length_us);
        let two = score(store, (from, to), start_us + OFFSET * range_us, length_us);
        let better = match (one, two) {
            (Some(one), Some(two)) => {
                if one.count >= two.count {
                    one
                } else {
                    two
                }
            }
            (Some(only), None) | (None, Some(only)) => only,
            (None, None) => break,
        };
        (centre_us, interval_us) = (better.centre_us, length_us);
        (from, to) = (
            store.first_at_or_after(better.after_us - length_us),
            store.first_at_or_after(libm::floor(better.after_us) + 1.0),
        );
    }
    // The position that the log held when the first event at or after the centre came.
    let t_us = store.get(store.first_at_or_after(centre_us)).map_or(centre_us, |event| event.t.0 as f64);
    let position = sweep.trace.position_held(t_us).ok_or(crate::LensTraceError::Empty)?;
    Ok(Estimate { position, t_us, iterations, interval_us })
}
