//! The time of an EVT 3.0 stream, from its TIME_HIGH and TIME_LOW words.

use super::{PAYLOAD_MASK, TIME_PERIOD_US};
use crate::decode::{RESTART_LEAP_US, TimeRule};

/// A coarse time that falls by at least half its period has wrapped; by less, it has gone back (OpenEB's rule).
const WRAP_THRESHOLD: i32 = 2048;

/// The newest time, and what was wrong on the way to it.
#[derive(Debug, Clone)]
pub(super) struct Evt3Time {
    rule: TimeRule,
    /// `None` before the first TIME_HIGH.
    now: Option<i64>,
    /// Added to the camera's 24 bits: the origin, and a period for each wrap.
    period_start: i64,
    high: u16,
    /// Steps of the coarse time that are neither 0 nor 1.
    pub(super) jumps: u64,
    /// Restarts of the camera's clock; with [`TimeRule::AsSent`] time just goes back.
    pub(super) restarts: u64,
}

impl Evt3Time {
    pub(super) fn new(rule: TimeRule, origin_us: i64) -> Self {
        Self { rule, now: None, period_start: origin_us, high: 0, jumps: 0, restarts: 0 }
    }

    /// Microseconds; `None` before the first TIME_HIGH.
    #[inline]
    pub(super) fn now(&self) -> Option<i64> {
        self.now
    }

    /// Payload of the newest TIME_HIGH, and the time at which its 4096 us begin.
    #[inline]
    pub(super) fn coarse(&self) -> (u16, i64) {
        (self.high, self.period_start.saturating_add(i64::from(self.high) << 12))
    }

    /// As [`low`](Self::low), for a time that is known not to fall.
    #[inline]
    pub(super) fn advance_to(&mut self, now: i64) {
        self.now = Some(now);
    }

    #[inline]
    pub(super) fn low(&mut self, low: u16) {
        let Some(now) = self.now else { return };
        let time = self.coarse().1.saturating_add(i64::from(low));
        self.now = Some(match self.rule {
            TimeRule::AsSent => time,
            TimeRule::Ascending => time.max(now),
        });
    }

    pub(super) fn high(&mut self, high: u16) {
        let Some(now) = self.now else {
            self.high = high;
            self.now = Some(self.coarse().1);
            return;
        };
        if high == self.high {
            // The camera repeats its coarse time every 16 us; the fine time stays.
            return;
        }
        let fall = i32::from(self.high) - i32::from(high);
        if high != (self.high + 1) & PAYLOAD_MASK {
            self.jumps += 1;
        }
        self.high = high;
        if fall >= WRAP_THRESHOLD {
            self.period_start = self.period_start.saturating_add(TIME_PERIOD_US);
        } else if fall > 0 && self.rule == TimeRule::Ascending {
            self.restarts += 1;
            self.period_start = now.saturating_add(RESTART_LEAP_US).saturating_sub(i64::from(high) << 12);
        }
        self.now = Some(self.coarse().1);
    }
}
