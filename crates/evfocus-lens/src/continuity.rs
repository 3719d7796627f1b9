//! A counted position cannot leap: where it does, the device has lost count.

use evfocus_core::{HostMicros, LensPosition, LensRange, LensSpeed};

/// Motors may be somewhat faster than they are said to be.
const SPEED_MARGIN: f64 = 4.0;
/// Share of the range that is no leap at any speed.
const RANGE_MARGIN: f64 = 0.02;

/// Compares each position with the one before.
#[derive(Debug)]
pub(crate) struct Continuity {
    fastest: f64,
    margin: f64,
    last: Option<(HostMicros, LensPosition)>,
}

impl Continuity {
    pub(crate) fn new(range: LensRange, max_speed: LensSpeed) -> Self {
        Self {
            fastest: SPEED_MARGIN * max_speed.counts_per_second(),
            margin: RANGE_MARGIN * range.length(),
            last: None,
        }
    }

    /// Takes the next position as it is, without comparing.
    pub(crate) fn forget(&mut self) {
        self.last = None;
    }

    /// # Errors
    /// The position before, if no motion leads from it to `position`; from then on `position` counts.
    pub(crate) fn check(&mut self, time: HostMicros, position: LensPosition) -> Result<(), String> {
        let before = self.last.replace((time, position));
        let Some((last_time, last)) = before else { return Ok(()) };
        let elapsed = time.since(last_time);
        if position.distance(last) <= self.fastest * elapsed.as_secs_f64() + self.margin {
            return Ok(());
        }
        Err(format!(
            "the position leapt from {last} to {position} in {elapsed:?}: the controller was reset or has lost count; \
             find the reference again, or set its position"
        ))
    }
}
