//! The bin that a counter is counting into.

use crate::units::CameraMicros;

/// Events of the newest bin, not yet handed out.
#[derive(Debug, Clone)]
pub(super) struct OpenBin {
    width_us: i64,
    start_us: i64,
    events: u64,
}

impl OpenBin {
    /// Bins of `width_us` microseconds, at least 1, that begin at multiples of it.
    pub(super) fn new(width_us: u32) -> Self {
        Self { width_us: i64::from(width_us.max(1)), start_us: 0, events: 0 }
    }

    /// First microsecond of the bin, and the first after it.
    pub(super) fn range(&self) -> (i64, i64) {
        (self.start_us, self.start_us.saturating_add(self.width_us))
    }

    pub(super) fn add(&mut self, events: u64) {
        self.events += events;
    }

    /// Goes to the bin that holds `time_us`; what was counted in another is handed to `out`.
    pub(super) fn move_to(&mut self, time_us: i64, out: &mut impl FnMut(CameraMicros, u64)) {
        let (start, end) = self.range();
        if time_us < start || time_us >= end {
            self.flush(out);
            self.start_us = time_us - time_us.rem_euclid(self.width_us);
        }
    }

    /// Hands what was counted to `out`.
    pub(super) fn flush(&mut self, out: &mut impl FnMut(CameraMicros, u64)) {
        if self.events > 0 {
            out(CameraMicros(self.start_us), self.events);
            self.events = 0;
        }
    }
}
