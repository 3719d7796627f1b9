//! The event-rate controller that sits between the pixels and the link of an IMX636.

use std::time::Duration;

use super::Spike;
use crate::ConfigError;

/// At most so many events in each period; what comes beyond is dropped.
///
/// The device does not say how many it dropped, so no more does the simulated camera: the events are missing from the stream,
/// are not part of a batch's `lost`, and only [`Rig::dropped_by_rate_cap`](crate::Rig::dropped_by_rate_cap) knows of them. The
/// first ones of a period pass here. A device that holds a period back before it decides may drop evenly within it; over
/// more than a period that is the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RateCap {
    /// Events that pass in each period. Default 4000.
    pub events: u32,
    /// The period. Default 200 us, which makes 20 million events a second. Both are what openeb's `gen41_erc.cpp` sets.
    pub period: Duration,
}

impl Default for RateCap {
    fn default() -> Self {
        Self { events: 4000, period: Duration::from_micros(200) }
    }
}

impl RateCap {
    /// The cap that lets `events_per_s` pass with the default period, in whole events a period: steps of 5000 a second.
    pub fn at_rate(events_per_s: f64) -> Self {
        let period = Self::default().period;
        Self { events: (events_per_s * period.as_secs_f64()).round().max(1.0) as u32, period }
    }

    /// Events per second.
    pub fn events_per_s(self) -> f64 {
        f64::from(self.events) / self.period.as_secs_f64()
    }

    pub(super) fn validate(self) -> Result<(), ConfigError> {
        ConfigError::check("sensor.rate_cap.events", f64::from(self.events), 1.0, 1e9)?;
        ConfigError::check("sensor.rate_cap.period", self.period.as_secs_f64(), 1e-6, 10.0)
    }
}

/// The controller at work.
#[derive(Debug)]
pub(super) struct Gate {
    most: u32,
    period_micros: i64,
    /// Number of the period that the last event fell into.
    period: i64,
    passed: u32,
}

impl Gate {
    pub(super) fn new(cap: RateCap) -> Self {
        Self { most: cap.events, period_micros: cap.period.as_micros() as i64, period: i64::MIN, passed: 0 }
    }

    /// Whether `spike` passes; they come in the order of time.
    pub(super) fn passes(&mut self, spike: &Spike) -> bool {
        let period = spike.micros.div_euclid(self.period_micros);
        if period != self.period {
            (self.period, self.passed) = (period, 0);
        }
        let passes = self.passed < self.most;
        self.passed += u32::from(passes);
        passes
    }
}
