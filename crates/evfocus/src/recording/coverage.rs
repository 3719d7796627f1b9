//! Whether positions and events belong to the same stretch of time.

use std::path::Path;

use anyhow::bail;
use evfocus_core::{CameraMicros, LensTrace, SweepLimits};
use evfocus_record::Summary;

use super::legs::SweepLeg;
use super::shown;

/// The positions may begin after the first event and end before the last one by this much: loggers start late.
const TOLERANCE_US: i64 = 10_000;
/// If the lens goes on for a larger share of its way after the last event, the recording was cut off.
const LARGEST_MISSING_SHARE: f64 = 0.25;
/// The same for a recording that ends in mid-word: it was cut off for certain.
const LARGEST_CUT_SHARE: f64 = 0.02;
/// If a larger share of the events goes back in time, the recording is not sorted.
const LARGEST_REVERSED_SHARE: f64 = 0.01;

/// Times of the first and the last event.
pub(super) fn span(summary: &Summary) -> Option<(CameraMicros, CameraMicros)> {
    Some((CameraMicros(summary.first_t_us?), CameraMicros(summary.last_t_us?)))
}

/// Positions must be known whenever there are events.
pub(super) fn check_positions(
    trace: &LensTrace<CameraMicros>,
    (first, last): (CameraMicros, CameraMicros),
    positions: &Path,
    recording: &Path,
) -> anyhow::Result<()> {
    let (Some((from, _)), Some((to, _))) = (trace.first(), trace.last()) else { return Ok(()) };
    let (late, early) = (from.micros_since(first), last.micros_since(to));
    if late <= TOLERANCE_US && early <= TOLERANCE_US {
        return Ok(());
    }
    let mut wrong = Vec::new();
    if from > last || to < first {
        wrong.push(String::from("the two do not overlap at all"));
    } else {
        if late > TOLERANCE_US {
            wrong.push(format!("they begin {} after the first event", seconds(late)));
        }
        if early > TOLERANCE_US {
            wrong.push(format!("they end {} before the last event", seconds(early)));
        }
    }
    bail!(
        "{}: the positions do not cover the recording: {}; the positions go from {} to {} us, the events of {} from {} to \
         {} us; log the lens for the whole recording, in microseconds of the camera's clock, or cut the recording",
        shown(positions),
        wrong.join(" and "),
        from.0,
        to.0,
        shown(recording),
        first.0,
        last.0
    );
}

/// The recording must cover the sweeps, and its events must be in order. Returns what is odd but tolerable.
pub(super) fn check_recording(
    sweeps: &[SweepLeg],
    summary: &Summary,
    (first, last): (CameraMicros, CameraMicros),
    recording: &Path,
) -> anyhow::Result<Vec<String>> {
    let damage = summary.damage;
    if damage.time_reversals as f64 > LARGEST_REVERSED_SHARE * summary.events as f64 {
        bail!(
            "{}: {} of the {} events are earlier than the event before them; sort the recording by time",
            shown(recording),
            damage.time_reversals,
            summary.events
        );
    }
    // A recording with hardly any events has a better explanation than having been cut off.
    if summary.events >= SweepLimits::default().fewest_events {
        let limit = if damage.trailing_bytes > 0 { LARGEST_CUT_SHARE } else { LARGEST_MISSING_SHARE };
        if let Some(sweep) = sweeps.last().filter(|sweep| sweep.share_after(last) > limit) {
            bail!(
                "{}: the recording ends at {} us, {} before the lens does; the last {:.0} % of the sweep are missing; was \
                 the file cut off? Copy it anew, or cut the positions where the recording ends",
                shown(recording),
                last.0,
                seconds(sweep.end.micros_since(last)),
                100.0 * sweep.share_after(last)
            );
        }
        if let Some(sweep) =
            sweeps.first().filter(|sweep| 1.0 - sweep.share_after(first) > LARGEST_MISSING_SHARE)
        {
            bail!(
                "{}: the recording begins at {} us, {} after the lens does; the first {:.0} % of the sweep are missing; \
                 record the whole sweep, or cut the positions where the recording begins",
                shown(recording),
                first.0,
                seconds(first.micros_since(sweep.start)),
                100.0 * (1.0 - sweep.share_after(first))
            );
        }
    }
    let found = damage.counters().into_iter().filter(|&(_, count)| count > 0);
    Ok(found
        .map(|(name, count)| format!("{}: {}: {count}", shown(recording), name.replace('_', " ")))
        .collect())
}

fn seconds(micros: i64) -> String {
    format!("{:.3} s", micros as f64 * 1e-6)
}
