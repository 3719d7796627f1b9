//! The rig's lens, as the firmware of a controller gets at it.

use std::sync::{Arc, Mutex};

use evfocus_core::{HostMicros, LensRange};

use crate::lens::{Command, LensState, Spring, lock};

/// A handle to the rig's motor and its position read-out.
#[derive(Debug, Clone)]
pub(crate) struct Motor {
    state: Arc<Mutex<LensState>>,
    epoch: HostMicros,
}

impl Motor {
    pub(crate) fn new(state: Arc<Mutex<LensState>>, epoch: HostMicros) -> Self {
        Self { state, epoch }
    }

    fn seconds(&self, time: HostMicros) -> f64 {
        time.micros_since(self.epoch) as f64 / 1e6
    }

    /// Sets out for `target`, or for the end of the way if that is nearer.
    pub(super) fn travel(&self, now: HostMicros, target: f64, speed: f64) {
        let mut state = lock(&self.state);
        let range = state.config().range;
        let fastest = state.config().max_speed.counts_per_second();
        let target = target.clamp(range.min().0, range.max().0);
        let command = Command::Travel { target, speed: speed.clamp(1e-3, fastest) };
        state.command(self.seconds(now), command);
    }

    pub(super) fn brake(&self, now: HostMicros) {
        lock(&self.state).command(self.seconds(now), Command::Brake);
    }

    /// Lets the glass swing to where `spring` rests, from `time` on; not before an earlier one.
    pub(super) fn swing(&self, time: HostMicros, spring: Spring) {
        lock(&self.state).command(self.seconds(time), Command::Swing(spring));
    }

    /// What the position read-out says at `time`, counts, and whether the motor is driven.
    pub(super) fn report(&self, time: HostMicros) -> (f64, bool) {
        let seconds = self.seconds(time);
        lock(&self.state).report(seconds)
    }

    /// What a potentiometer on the shaft says at `time`, counts.
    fn wiper(&self, time: HostMicros) -> f64 {
        let seconds = self.seconds(time);
        lock(&self.state).wiper(seconds)
    }

    /// How far the motor has slipped at the ends of its way by `time`, counts.
    pub(super) fn slip(&self, time: HostMicros) -> f64 {
        lock(&self.state).slip(self.seconds(time))
    }

    pub(super) fn range(&self) -> LensRange {
        lock(&self.state).config().range
    }

    /// Counts per second.
    pub(super) fn max_speed(&self) -> f64 {
        lock(&self.state).config().max_speed.counts_per_second()
    }

    /// Whether there is a switch to home on, and homing is needed.
    pub(super) fn needs_homing(&self) -> bool {
        lock(&self.state).config().needs_homing
    }

    pub(super) fn is_unplugged(&self, now: HostMicros) -> bool {
        lock(&self.state).unplugged(self.seconds(now))
    }

    pub(super) fn is_silent(&self, now: HostMicros) -> bool {
        lock(&self.state).silent(self.seconds(now))
    }
}

/// Share of the full drive below which the motor does not turn.
const DEAD_BAND: f64 = 0.12;

/// The rig's motor as a DC motor: driven by a voltage, ended by the ends of its way.
#[derive(Debug)]
pub(super) struct DcMotor {
    motor: Motor,
    drive: f64,
}

impl DcMotor {
    pub(super) fn new(motor: Motor) -> Self {
        Self { motor, drive: 0.0 }
    }

    pub(super) fn motor(&self) -> &Motor {
        &self.motor
    }

    /// Puts `drive`, -1 to 1, on the motor.
    pub(super) fn drive(&mut self, now: HostMicros, drive: f64) {
        if (drive - self.drive).abs() < 1e-9 {
            return;
        }
        self.drive = drive;
        let share = (drive.abs() - DEAD_BAND) / (1.0 - DEAD_BAND);
        let range = self.motor.range();
        if share > 0.0 {
            let end = if drive > 0.0 { range.max() } else { range.min() };
            self.motor.travel(now, end.0, share * self.motor.max_speed());
        } else {
            self.motor.brake(now);
        }
    }

    /// What the potentiometer says, counts.
    pub(super) fn position(&self, time: HostMicros) -> f64 {
        self.motor.wiper(time)
    }
}
