//! Where motor and optics were at any time, from all the motions that were commanded.

use std::collections::VecDeque;

use super::config::LensConfig;
use super::profile::{Limits, Phase, Spring, brake, swing, travel};
use super::warp::Warp;

/// Motions that are kept: the sensor may lag behind the lens by this many commands.
const MOTIONS_KEPT: usize = 4096;

/// Motor and optics at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LensInstant {
    /// What the motor's controller counts.
    pub(crate) motor: f64,
    /// Where the shaft is, counts: where the motor says, unless it has slipped at an end of the way. A potentiometer on it sees this.
    pub(crate) shaft: f64,
    /// Where the glass is, counts: the shaft plus what of the backlash is taken up the other way.
    pub(crate) optics: f64,
    /// Counts per second of the motor, before ripple and sticking.
    pub(crate) velocity: f64,
    /// Whether the motor's controller thinks that a motion is under way.
    pub(crate) moving: bool,
}

impl LensInstant {
    fn resting_at(position: f64) -> Self {
        Self { motor: position, shaft: position, optics: position, velocity: 0.0, moving: false }
    }
}

/// One command and what the motor makes of it.
#[derive(Debug, Clone)]
struct Motion {
    /// Seconds since the rig was made.
    start: f64,
    /// Where the motor stands before the first phase and after the last, and the optics with it.
    from: LensInstant,
    /// Each phase with the profile time, and motor and optics, at its start.
    phases: Vec<(f64, LensInstant, Phase)>,
    rest: LensInstant,
    /// Seconds of profile time.
    duration: f64,
}

/// What a motor is told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Command {
    /// To `target` at up to `speed` counts per second.
    Travel {
        /// Counts.
        target: f64,
        /// Counts per second.
        speed: f64,
    },
    /// Stop.
    Brake,
    /// Let go on a spring; play and overshoot of a motor do not apply.
    Swing(Spring),
}

/// What lies between motor and glass.
#[derive(Debug, Clone, Copy)]
struct Gear {
    backlash: f64,
    /// The ends of the shaft's way.
    ends: (f64, f64),
}

impl Gear {
    /// From `before`, after the motor came to `motor` without turning round. Upwards the shaft pushes the glass along; downwards the gap
    /// must close first.
    fn turn(self, before: LensInstant, motor: f64) -> LensInstant {
        let shaft = (before.shaft + motor - before.motor).clamp(self.ends.0, self.ends.1);
        LensInstant { motor, shaft, optics: before.optics.clamp(shaft, shaft + self.backlash), ..before }
    }
}

/// All motions of a lens.
#[derive(Debug, Clone)]
pub(crate) struct Trajectory {
    motions: VecDeque<Motion>,
    acceleration: f64,
    gear: Gear,
    overshoot: f64,
    bounds: (f64, f64),
    warp: Warp,
}

impl Trajectory {
    pub(crate) fn new(config: &LensConfig) -> Self {
        let rest = LensInstant::resting_at(config.start.0);
        let ends =
            config.ends.map_or((f64::NEG_INFINITY, f64::INFINITY), |ends| (ends.min().0, ends.max().0));
        let motions =
            VecDeque::from([Motion { start: 0.0, from: rest, phases: Vec::new(), rest, duration: 0.0 }]);
        Self {
            motions,
            acceleration: config.acceleration,
            gear: Gear { backlash: config.backlash, ends },
            overshoot: config.overshoot,
            bounds: (config.range.min().0, config.range.max().0),
            warp: Warp::new(config),
        }
    }

    /// Motor and optics `seconds` after the rig was made.
    pub(crate) fn at(&self, seconds: f64) -> LensInstant {
        let index = self.motions.partition_point(|motion| motion.start <= seconds);
        match self.motions.get(index.saturating_sub(1)) {
            Some(motion) => {
                motion.at(self.warp.profile_time(seconds - motion.start, motion.duration), self.gear)
            }
            None => LensInstant::resting_at(self.bounds.0),
        }
    }

    /// Replaces the motion under way at `seconds`.
    pub(crate) fn command(&mut self, seconds: f64, command: Command) {
        let from = self.at(seconds);
        let mut phases = Vec::new();
        match command {
            Command::Brake => {
                brake(&mut phases, from.motor, from.velocity, self.acceleration);
            }
            Command::Swing(spring) => swing(&mut phases, from.motor, from.velocity, spring),
            Command::Travel { target, speed } => {
                let limits = Limits { speed, acceleration: self.acceleration };
                let beyond = (target + self.overshoot.copysign(target - from.motor))
                    .clamp(self.bounds.0, self.bounds.1);
                // A step shorter than the overshoot does not gather the speed that carries the motor too far.
                if self.overshoot > 0.0 && (target - from.motor).abs() > self.overshoot {
                    let turn = travel(&mut phases, from.motor, from.velocity, beyond, limits);
                    travel(&mut phases, turn, 0.0, target, limits);
                } else {
                    travel(&mut phases, from.motor, from.velocity, target, limits);
                }
            }
        }
        if self.motions.len() == MOTIONS_KEPT {
            self.motions.pop_front();
        }
        self.motions.push_back(Motion::new(seconds, from, phases, self.gear));
    }

    /// Lets the lens have stood still from `since` to `until`, and stand there from then on.
    pub(crate) fn hold(&mut self, since: f64, until: f64) {
        let rest = LensInstant { velocity: 0.0, moving: false, ..self.at(since) };
        self.motions.retain(|motion| motion.start < since);
        for start in [since, until] {
            self.motions.push_back(Motion { start, from: rest, phases: Vec::new(), rest, duration: 0.0 });
        }
    }

    /// When the newest motion first brings the motor to `position`, in seconds since the rig was made.
    pub(crate) fn passes(&self, position: f64) -> Option<f64> {
        let motion = self.motions.back()?;
        let profile_time = motion.phases.iter().find_map(|&(start, _, phase)| {
            let (low, high) = (phase.position.min(phase.end()), phase.position.max(phase.end()));
            (low <= position && position <= high).then(|| {
                let rising = phase.end() >= phase.position;
                let after = bisect(phase.duration, |t| (phase.position_after(t) >= position) == rising);
                start + after
            })
        })?;
        let latest = self.warp.latest(motion.duration);
        Some(motion.start + bisect(latest, |t| self.warp.profile_time(t, motion.duration) >= profile_time))
    }
}

/// The smallest time in 0 to `end` from which on `reached` holds, to well below a microsecond.
fn bisect(end: f64, reached: impl Fn(f64) -> bool) -> f64 {
    let (mut before, mut after) = (0.0, end);
    for _ in 0..48 {
        let middle = f64::midpoint(before, after);
        if reached(middle) { after = middle } else { before = middle }
    }
    after
}

impl Motion {
    fn new(start: f64, from: LensInstant, phases: Vec<Phase>, gear: Gear) -> Self {
        let mut duration = 0.0;
        let mut rest = LensInstant { velocity: 0.0, moving: false, ..from };
        let phases = phases
            .into_iter()
            .map(|phase| {
                let entry = (duration, rest, phase);
                duration += phase.duration;
                rest = gear.turn(rest, phase.end());
                entry
            })
            .collect();
        Self { start, from, phases, rest, duration }
    }

    fn at(&self, profile_time: f64, gear: Gear) -> LensInstant {
        if profile_time >= self.duration {
            return self.rest;
        }
        let index = self.phases.partition_point(|&(start, ..)| start <= profile_time);
        let Some(&(start, before, phase)) = self.phases.get(index.saturating_sub(1)) else {
            return self.from;
        };
        let velocity = phase.velocity_after(profile_time - start);
        LensInstant {
            velocity,
            moving: true,
            ..gear.turn(before, phase.position_after(profile_time - start))
        }
    }
}
