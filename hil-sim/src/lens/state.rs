//! What the lens is doing, what was scheduled to go wrong, and what the lens says of it.

use rand::RngExt;
use rand_distr::StandardNormal;
use rand_xoshiro::Xoshiro256PlusPlus;

use super::config::LensConfig;
use super::trajectory::{Command, LensInstant, Trajectory};
use crate::faults::{Fault, FaultKind, FaultTrigger};

/// A fault and, as soon as it is known, the time at which it strikes, seconds since the rig was made. The time of one that
/// waits for a position is a forecast until it has passed.
#[derive(Debug, Clone, Copy)]
struct Scheduled {
    fault: Fault,
    at: Option<f64>,
}

/// The lens and the rig's schedule of faults, which is kept here because faults may wait for a lens position.
#[derive(Debug)]
pub(crate) struct LensState {
    config: LensConfig,
    trajectory: Trajectory,
    faults: Vec<Scheduled>,
    homed: bool,
    rng: Xoshiro256PlusPlus,
}

impl LensState {
    pub(crate) fn new(config: LensConfig, faults: &[Fault], rng: Xoshiro256PlusPlus) -> Self {
        let schedule = |&fault: &Fault| {
            let at = match fault.trigger {
                FaultTrigger::After(delay) => Some(delay.as_secs_f64()),
                FaultTrigger::AtPosition(position) => (position == config.start).then_some(0.0),
            };
            Scheduled { fault, at }
        };
        Self {
            trajectory: Trajectory::new(&config),
            faults: faults.iter().map(schedule).collect(),
            homed: !config.needs_homing,
            config,
            rng,
        }
    }

    pub(crate) fn config(&self) -> &LensConfig {
        &self.config
    }

    pub(crate) fn homed(&self) -> bool {
        self.homed
    }

    /// The faults that have struck by `seconds`, with the time since when.
    pub(crate) fn struck(&self, seconds: f64) -> impl Iterator<Item = (FaultKind, f64)> + '_ {
        self.faults.iter().filter_map(move |scheduled| {
            let at = scheduled.at.filter(|&at| at <= seconds)?;
            Some((scheduled.fault.kind, at))
        })
    }

    pub(crate) fn unplugged(&self, seconds: f64) -> bool {
        self.struck(seconds).any(|(kind, _)| kind == FaultKind::LensUnplugged)
    }

    pub(crate) fn silent(&self, seconds: f64) -> bool {
        self.struck(seconds).any(|(kind, _)| kind == FaultKind::LensSilent)
    }

    /// Motor and glass at `seconds`, faults included.
    pub(crate) fn at(&self, seconds: f64) -> LensInstant {
        match self.frozen_since(seconds) {
            // The motor's controller counts on; only the motor does not follow.
            Some(since) => {
                LensInstant { moving: self.trajectory.at(seconds).moving, ..self.trajectory.at(since) }
            }
            None => self.trajectory.at(seconds),
        }
    }

    fn frozen_since(&self, seconds: f64) -> Option<f64> {
        self.struck(seconds)
            .filter(|(kind, _)| matches!(kind, FaultKind::LensStalled | FaultKind::LensUnplugged))
            .map(|(_, at)| at)
            .reduce(f64::min)
    }

    pub(crate) fn command(&mut self, seconds: f64, command: Command) {
        self.trajectory.command(seconds, command);
        for scheduled in &mut self.faults {
            let FaultTrigger::AtPosition(position) = scheduled.fault.trigger else { continue };
            if scheduled.at.is_none_or(|at| at > seconds) {
                scheduled.at = self.trajectory.passes(position.0);
            }
        }
    }

    /// Takes away the faults that have struck. A lens that was held goes on from where it was held.
    pub(crate) fn repair(&mut self, seconds: f64) {
        if let Some(since) = self.frozen_since(seconds) {
            self.trajectory.hold(since, seconds);
        }
        self.faults.retain(|scheduled| scheduled.at.is_none_or(|at| at > seconds));
    }

    /// Drives to the low end of the range, which is where the reference switch sits.
    pub(crate) fn home(&mut self, seconds: f64) {
        self.homed = true;
        if self.config.needs_homing {
            let target = self.config.range.min().0;
            self.command(
                seconds,
                Command::Travel { target, speed: self.config.max_speed.counts_per_second() },
            );
        }
    }

    /// What the lens answers to a question that belongs to `seconds`: position and whether it moves.
    pub(crate) fn report(&mut self, seconds: f64) -> (f64, bool) {
        (self.read(seconds, |instant| instant.motor), self.at(seconds).moving)
    }

    /// What a potentiometer on the shaft says at `seconds`.
    pub(crate) fn wiper(&mut self, seconds: f64) -> f64 {
        self.read(seconds, |instant| instant.shaft)
    }

    /// How far the motor has slipped by `seconds`, counts.
    pub(crate) fn slip(&self, seconds: f64) -> f64 {
        let instant = self.at(seconds);
        instant.motor - instant.shaft
    }

    fn read(&mut self, seconds: f64, value: fn(&LensInstant) -> f64) -> f64 {
        let late = self.struck(seconds).filter_map(|(kind, _)| match kind {
            FaultKind::LensPositionLate { by } => Some(by.as_secs_f64()),
            FaultKind::CameraUnplugged
            | FaultKind::CameraTimeReset
            | FaultKind::EventLoss { .. }
            | FaultKind::LensUnplugged
            | FaultKind::LensStalled
            | FaultKind::LensSilent => None,
        });
        let lag = late.fold(self.config.read_lag.as_secs_f64(), f64::max);
        let then = self.at(seconds - lag);
        let noise: f64 = self.rng.sample(StandardNormal);
        let position = value(&then) + self.config.read_noise * noise;
        let step = self.config.read_resolution;
        if step > 0.0 { (position / step).round() * step } else { position }
    }
}
