//! A motion of the lens under way, and what becomes of it.

use core::time::Duration;

use super::ControllerConfig;
use crate::lens_trace::LensSample;
use crate::report::Failure;
use crate::units::{HostMicros, LensPosition, LensSpeed};

/// What a sample says of the motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Progress {
    UnderWay,
    Arrived,
    Failed(Failure),
    /// Longer than distance, speed and slack allow.
    Overdue,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Motion {
    pub(super) from: LensPosition,
    pub(super) target: LensPosition,
    tolerance: f64,
    /// When and where the position last changed by more than noise.
    last_change: (HostMicros, LensPosition),
    moved: bool,
    stall_timeout: Duration,
    deadline: HostMicros,
    /// When the lens was told to stop on its way: wherever it comes to rest then is where it was to go.
    stopped: Option<HostMicros>,
}

impl Motion {
    pub(super) fn new(
        from: LensPosition,
        target: LensPosition,
        speed: LensSpeed,
        now: HostMicros,
        config: &ControllerConfig,
    ) -> Self {
        // A lens that says it is light years away gets no time beyond the slack.
        let expected = from.distance(target) / speed.counts_per_second();
        let expected = Duration::try_from_secs_f64(expected).unwrap_or_default();
        Self {
            from,
            target,
            tolerance: config.position_tolerance,
            last_change: (now, from),
            moved: false,
            stall_timeout: config.stall_timeout,
            deadline: now + expected.saturating_mul(2) + config.motion_slack,
            stopped: None,
        }
    }

    /// The lens was told to stop where it is.
    pub(super) fn stop(self, now: HostMicros) -> Self {
        Self { stopped: Some(now), ..self }
    }

    pub(super) fn is_stopping(&self) -> bool {
        self.stopped.is_some()
    }

    /// Judges by the time of the sample, not by when it was looked at: a host that was busy elsewhere is no fault of the lens.
    pub(super) fn observe(&mut self, sample: &LensSample) -> Progress {
        let now = sample.time();
        if sample.position.distance(self.last_change.1) > self.tolerance / 2.0 {
            self.last_change = (now, sample.position);
            self.moved |= sample.position.distance(self.from) > self.tolerance;
        }
        if let Some(stopped) = self.stopped {
            return match (sample.requested > stopped && !sample.moving, now >= self.deadline) {
                (true, _) => Progress::Arrived,
                (false, true) => Progress::Overdue,
                (false, false) => Progress::UnderWay,
            };
        }
        let missing = sample.position.distance(self.target);
        if missing <= self.tolerance && !sample.moving {
            return Progress::Arrived;
        }
        if now.since(self.last_change.0) >= self.stall_timeout {
            let wanted = self.target.counts_from(self.from);
            let made = sample.position.counts_from(self.from);
            return Progress::Failed(if !self.moved {
                Failure::LensNotMoving
            } else if missing <= self.tolerance {
                // At the target, and yet it says that it moves: it hunts.
                Failure::LensOvershoot
            } else if wanted * made > wanted * wanted {
                Failure::LensOvershoot
            } else {
                Failure::LensStoppedShort
            });
        }
        if now >= self.deadline { Progress::Overdue } else { Progress::UnderWay }
    }

    pub(super) fn is_overdue(&self, now: HostMicros) -> bool {
        now >= self.deadline
    }
}
