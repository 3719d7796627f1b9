//! The time of a DAVIS346's stream, from its time, wrap and reset words (libcaer's `timestamps.h`).

use crate::decode::{RESTART_LEAP_US, TimeRule};

/// Microseconds until the 15 bits of a time word wrap.
pub(super) const TIME_PERIOD_US: i64 = 1 << 15;

/// The newest time, and what was wrong on the way to it.
#[derive(Debug, Clone)]
pub(super) struct DavisTime {
    rule: TimeRule,
    /// `None` until a word has told the time.
    now: Option<i64>,
    wraps_us: i64,
    /// Wraps by other than one: the camera counted them while nobody read from it, or a wrap word was lost.
    pub(super) jumps: u64,
    /// Resets in mid-stream; the one at the start of a stream is how it begins.
    pub(super) restarts: u64,
}

impl DavisTime {
    pub(super) fn new(rule: TimeRule) -> Self {
        Self { rule, now: None, wraps_us: 0, jumps: 0, restarts: 0 }
    }

    /// Microseconds; `None` until a word has told the time.
    #[inline]
    pub(super) fn now(&self) -> Option<i64> {
        self.now
    }

    /// What a time word is added to.
    pub(super) fn wraps_us(&self) -> i64 {
        self.wraps_us
    }

    /// As [`low`](Self::low), for a time that is known not to fall.
    pub(super) fn advance_to(&mut self, now: i64) {
        self.now = Some(now);
    }

    #[inline]
    pub(super) fn low(&mut self, low: u16) {
        let falls = self.now.is_some_and(|now| self.wraps_us.saturating_add(i64::from(low)) < now);
        if falls && self.rule == TimeRule::Ascending {
            // The camera's time words only ever rise between two wraps, so a wrap word is missing.
            self.wraps_us = self.wraps_us.saturating_add(TIME_PERIOD_US);
            self.jumps += 1;
        }
        self.now = Some(self.wraps_us.saturating_add(i64::from(low)));
    }

    pub(super) fn wrap(&mut self, times: u16) {
        self.wraps_us = self.wraps_us.saturating_add(i64::from(times) * TIME_PERIOD_US);
        self.jumps += u64::from(times != 1);
        let held = self.now.filter(|_| self.rule == TimeRule::Ascending).unwrap_or(i64::MIN);
        self.now = Some(self.wraps_us.max(held));
    }

    pub(super) fn reset(&mut self) {
        let running = self.now.filter(|&now| now > 0);
        self.restarts += u64::from(running.is_some());
        self.wraps_us = match (self.rule, running) {
            (TimeRule::Ascending, Some(now)) => now.saturating_add(RESTART_LEAP_US),
            (TimeRule::Ascending, None) | (TimeRule::AsSent, _) => 0,
        };
        self.now = Some(self.wraps_us);
    }
}
