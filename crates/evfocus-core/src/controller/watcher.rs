//! Whether the picture has lost the sharpness that it had when the lens came into focus, and whether it is time to do something.

use core::time::Duration;

use crate::event::{Geometry, Window};
use crate::event_list::Events;
use crate::sharpness::SharpnessMeter;
use crate::units::HostMicros;

/// What continuous mode goes by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WatchConfig {
    /// The share of the reference sharpness below which focus is taken for lost, 0 to 1. Once it is, it takes half the way back to 1
    /// until it is not.
    pub refocus_below: f64,
    /// For how long it must be lost before a run starts.
    pub patience: Duration,
    /// Over how long the reference is learnt, at least, from the end of a run that found focus.
    pub learning: Duration,
    /// From the end of one run to the start of the next that nobody asked for. It doubles with each run that was of no use.
    pub rest: Duration,
    /// The longest that `rest` becomes.
    pub longest_rest: Duration,
}

impl Default for WatchConfig {
    fn default() -> Self {
        Self {
            refocus_below: 0.75,
            patience: Duration::from_secs(1),
            learning: Duration::from_secs(2),
            rest: Duration::from_secs(2),
            longest_rest: Duration::from_secs(60),
        }
    }
}

/// Readings that a reference, or a loss, rests on at least.
const FEWEST_READINGS: u32 = 3;

/// What is known of sharpness since the last run that found focus.
#[derive(Debug)]
pub(super) struct Watcher {
    config: WatchConfig,
    meter: SharpnessMeter,
    geometry: Geometry,
    learning_since: HostMicros,
    /// Readings that the reference is the mean of, and their sum.
    learnt: (u32, f64),
    reference: Option<f64>,
    share: Option<f64>,
    low_since: Option<HostMicros>,
    low_readings: u32,
    rest: Duration,
    not_before: HostMicros,
}

impl Watcher {
    pub(super) fn new(config: WatchConfig, geometry: Geometry, now: HostMicros) -> Self {
        Self {
            config,
            meter: SharpnessMeter::new(geometry),
            geometry,
            learning_since: now,
            learnt: (0, 0.0),
            reference: None,
            share: None,
            low_since: None,
            low_readings: 0,
            rest: config.rest,
            not_before: now,
        }
    }

    pub(super) fn configure(&mut self, config: WatchConfig) {
        self.config = config;
        self.rest = config.rest;
    }

    pub(super) fn patience(&self) -> Duration {
        self.config.patience
    }

    /// The newest reading as a share of the reference.
    pub(super) fn share(&self) -> Option<f64> {
        self.share
    }

    /// The picture is sharp now, in `window` or all over: learns how that looks.
    pub(super) fn learn(&mut self, window: Option<Window>, now: HostMicros) {
        self.meter.look_at(window.unwrap_or(Window::whole(self.geometry)));
        self.learning_since = now;
        self.learnt = (0, 0.0);
        self.reference = None;
        self.share = None;
        self.low_since = None;
        self.low_readings = 0;
    }

    /// Events may be missing from here on, or begin anew: nothing of what comes belongs to what came.
    pub(super) fn interrupt(&mut self) {
        self.meter.restart();
        self.low_since = None;
        self.low_readings = 0;
    }

    /// Takes events at a lens that stands where the picture was sharp.
    pub(super) fn take(&mut self, events: Events<'_>, now: HostMicros) {
        let Some(reading) = self.meter.take(events) else { return };
        let Some(reference) = self.reference else {
            let (readings, sum) = (self.learnt.0 + 1, self.learnt.1 + reading);
            self.learnt = (readings, sum);
            if readings >= FEWEST_READINGS && now.since(self.learning_since) >= self.config.learning {
                self.reference = Some(sum / f64::from(readings));
            }
            return;
        };
        let share = reading / reference;
        self.share = Some(share);
        if share < self.config.refocus_below {
            self.low_since.get_or_insert(now);
            self.low_readings += 1;
        } else if share > f64::midpoint(self.config.refocus_below, 1.0) {
            self.low_since = None;
            self.low_readings = 0;
        }
    }

    /// Whether sharpness has been lost for long enough.
    pub(super) fn is_lost(&self, now: HostMicros) -> bool {
        self.low_readings >= FEWEST_READINGS
            && self.low_since.is_some_and(|since| now.since(since) >= self.config.patience)
    }

    /// Whether a run may start.
    pub(super) fn may_run(&self, now: HostMicros) -> bool {
        now >= self.not_before
    }

    /// The next run need not wait.
    pub(super) fn hurry(&mut self, now: HostMicros) {
        self.rest = self.config.rest;
        self.not_before = now;
    }

    /// What runs came to without a device says nothing any more.
    pub(super) fn device_is_back(&mut self, now: HostMicros) {
        self.run_ended(true, now);
    }

    /// A run ended; `useful` if it made the picture sharper.
    pub(super) fn run_ended(&mut self, useful: bool, now: HostMicros) {
        self.rest = if useful { self.config.rest } else { (2 * self.rest).min(self.config.longest_rest) };
        self.not_before = now + self.rest;
    }
}
