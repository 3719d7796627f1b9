//! The unsteadiness of the motor, as a distortion of time: the way stays as planned, the schedule does not.

use super::config::LensConfig;

/// What is wrong with the motor's schedule.
#[derive(Debug, Clone, Copy)]
pub(super) struct Warp {
    ripple: f64,
    ripple_period: f64,
    stick: f64,
    stick_period: f64,
    drift: f64,
}

impl Warp {
    pub(super) fn new(config: &LensConfig) -> Self {
        Self {
            ripple: config.speed_ripple,
            ripple_period: config.speed_ripple_period.as_secs_f64(),
            stick: config.stick_slip,
            stick_period: config.stick_slip_period.as_secs_f64(),
            drift: config.speed_drift,
        }
    }

    /// The time in the planned profile, `seconds` after the motion began; never ahead of it in the mean. `duration` is that
    /// of the profile.
    pub(super) fn profile_time(&self, seconds: f64, duration: f64) -> f64 {
        let mut time = seconds;
        if self.stick > 0.0 {
            let period = (time / self.stick_period).floor() * self.stick_period;
            let slipping = (time - period - self.stick * self.stick_period).max(0.0);
            time = period + slipping / (1.0 - self.stick);
        }
        if self.ripple > 0.0 {
            // The speed goes between 1 and 1 - 2 ripple of the plan: slower than asked, never faster.
            let omega = std::f64::consts::TAU / self.ripple_period;
            time -= self.ripple * (time - (omega * time).sin() / omega);
        }
        if self.drift.abs() > 0.0 && duration > 0.0 {
            // The share of the planned speed goes linearly with time, between 1 - |drift| and 1.
            let end = self.drifted(duration);
            let within = time.min(end);
            let bend = 0.5 * within * within / end;
            let missing = if self.drift > 0.0 { within - bend } else { bend };
            time -= self.drift.abs() * missing;
        }
        time
    }

    /// How long a motion of `duration` takes with the drift, seconds.
    fn drifted(&self, duration: f64) -> f64 {
        duration / (1.0 - 0.5 * self.drift.abs())
    }

    /// A time by which a profile of `duration` has come to its end for certain: sticking stretches a motion by one of its
    /// periods at most, ripple and drift by the mean slow-down.
    pub(super) fn latest(&self, duration: f64) -> f64 {
        (self.drifted(duration) + self.ripple_period) / (1.0 - self.ripple) + self.stick_period
    }
}
