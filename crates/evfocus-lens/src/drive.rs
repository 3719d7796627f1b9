//! Position and speed of a DC motor with a potentiometer, closed in the host: what readings come in decides what drive goes out.
//!
//! A reference runs from where the lens is to its target, at the speed asked and no faster, and the drive follows it: its
//! speed beforehand, plus a correction for how far the lens is off. The integral of the speed is right by construction, and
//! the noise of a potentiometer is never differentiated. A drive that does not move the lens, or moves it the other way, is a
//! fault, and cut.
//!
//! Pure: time is an argument.

mod profile;

use evfocus_core::{HostMicros, LensPosition, LensRange, LensSpeed};

use profile::Profile;

/// Correction, counts per second for each count off.
const GAIN: f64 = 10.0;
/// Readings whose mean counts.
const READINGS: usize = 4;
/// The reference never leads by more than the way of this time, seconds: a motor that is slower than asked sets the pace.
const LONGEST_LEAD: f64 = 0.15;
/// After the reference has arrived the lens has this long to come within the tolerance, seconds.
const SETTLING: f64 = 1.0;
/// It has settled when it has stayed there undriven for this long, seconds.
const SETTLED: f64 = 0.03;
/// It is driven until it is this near to its target, as a share of the tolerance, so that noise does not carry it out again.
const AIM: f64 = 0.5;
/// A motor may swallow this much of its fastest way before it moves, seconds: inertia, and play before the potentiometer.
const SWALLOWED: f64 = 0.1;

/// A motor, its potentiometer and its limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriveConfig {
    /// The positions that the lens may be sent to, counts; inside of the ends of its way.
    pub range: LensRange,
    /// Speed at full drive, counts per second.
    pub max_speed: LensSpeed,
    /// How fast the reference gathers and loses speed, counts per second squared; less than the motor can.
    pub acceleration: f64,
    /// Share of the full drive below which the motor does not turn, 0 to 0.9.
    pub dead_band: f64,
    /// How near to its target the lens is left alone, counts; not below the noise of the readings.
    pub tolerance: f64,
    /// Position at a reading of zero, counts.
    pub at_zero: f64,
    /// Position at a full reading, counts; below `at_zero` for a potentiometer that turns the other way.
    pub at_full: f64,
    /// Whether the positive drive lowers the position.
    pub reversed: bool,
}

impl DriveConfig {
    /// The position of a reading, as a share of the full one.
    pub(crate) fn position(&self, share: f64) -> LensPosition {
        LensPosition(self.at_zero + share * (self.at_full - self.at_zero))
    }
}

/// The motor is driven and the lens does not do what it should.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum DriveFault {
    /// It stands still.
    Stalled,
    /// It goes the other way.
    WrongWay,
}

impl DriveFault {
    pub(crate) fn explain(self, position: LensPosition) -> String {
        match self {
            Self::Stalled => format!(
                "stands still at {position} while the motor is driven; the motor is cut off. Is it at an end of its way, has it \
                 power, does the potentiometer turn?"
            ),
            Self::WrongWay => format!(
                "moves the other way, now at {position}; the motor is cut off. Swap its wires, or set reversed = true"
            ),
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum State {
    Rest,
    /// On the way to a target.
    Following {
        profile: Profile,
        progress: Progress,
    },
    /// At the target, as far as the reference is concerned: when it came there, and since when the lens is near, seconds.
    Settling {
        target: f64,
        progress: Progress,
        since: HostMicros,
        near_since: Option<HostMicros>,
    },
    /// Not driven any more, until it stands.
    Coasting {
        last: f64,
        since: HostMicros,
    },
}

/// What was ordered in one direction, and what came of it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Progress {
    direction: f64,
    /// Counts that the motor was told to go.
    told: f64,
    /// Where it was first, and where it was least far on.
    start: f64,
    least: f64,
}

impl Progress {
    fn new(direction: f64, position: f64) -> Self {
        Self { direction, told: 0.0, start: position, least: position }
    }

    /// `order` counts were ordered, signed, and the lens is at `position`.
    fn watch(&mut self, order: f64, position: f64, config: &DriveConfig) -> Result<(), DriveFault> {
        if order * self.direction < 0.0 {
            *self = Self::new(-self.direction, position);
        }
        let noticeable = 2.0 * config.tolerance;
        self.told += order.abs();
        if (position - self.least) * self.direction < 0.0 {
            self.least = position;
        } else if (position - self.least) * self.direction > noticeable {
            *self = Self::new(self.direction, position);
        }
        if self.told < SWALLOWED * config.max_speed.counts_per_second() + 10.0 * noticeable {
            Ok(())
        } else if (self.start - self.least) * self.direction > 2.0 * noticeable {
            Err(DriveFault::WrongWay)
        } else {
            Err(DriveFault::Stalled)
        }
    }
}

/// Follows the reference.
#[derive(Debug)]
pub(crate) struct Drive {
    config: DriveConfig,
    /// How near to its target the lens is driven, counts.
    aim: f64,
    state: State,
    readings: [f64; READINGS],
    count: usize,
    last: Option<HostMicros>,
}

impl Drive {
    pub(crate) fn new(config: DriveConfig) -> Self {
        let aim = AIM * config.tolerance;
        Self { config, aim, state: State::Rest, readings: [0.0; READINGS], count: 0, last: None }
    }

    /// The readings have steps of so many counts. A lens that is driven nearer than half of one hunts.
    pub(crate) fn set_resolution(&mut self, step: f64) {
        self.aim = (AIM * self.config.tolerance).max(step.abs() / 2.0).min(self.config.tolerance);
    }

    pub(crate) fn config(&self) -> &DriveConfig {
        &self.config
    }

    /// Sets out for `target`; a motion under way is replaced and its speed kept.
    pub(crate) fn aim(&mut self, target: LensPosition, speed: LensSpeed) {
        let position = self.mean();
        let speed = speed.counts_per_second().min(self.config.max_speed.counts_per_second());
        let (from, velocity) = match self.state {
            State::Following { profile, .. } => (profile.position, profile.velocity),
            State::Rest | State::Settling { .. } | State::Coasting { .. } => (position, 0.0),
        };
        let profile = Profile { position: from, velocity, target: target.0, speed };
        let progress = Progress::new((target.0 - position).signum(), position);
        self.state = State::Following { profile, progress };
    }

    /// The drive is cut; the motor coasts.
    pub(crate) fn cut(&mut self, now: HostMicros) {
        self.state = State::Coasting { last: self.mean(), since: now };
    }

    pub(crate) fn is_moving(&self) -> bool {
        self.state != State::Rest
    }

    fn mean(&self) -> f64 {
        let known = self.count.clamp(1, READINGS);
        self.readings.iter().take(known).sum::<f64>() / known as f64
    }

    /// Takes the position read at `now`, and says how to drive: -1 to 1.
    ///
    /// # Errors
    /// [`DriveFault`]; the state is as after [`cut`](Self::cut), and so must the motor be.
    pub(crate) fn follow(&mut self, now: HostMicros, position: LensPosition) -> Result<f64, DriveFault> {
        if let Some(place) = self.readings.get_mut(self.count % READINGS) {
            *place = position.0;
        }
        // Wraps at a multiple of the window, to stay above its length.
        self.count = if self.count >= 1 << 20 { READINGS } else { self.count + 1 };
        let elapsed = self.last.replace(now).map_or(0.0, |last| now.since(last).as_secs_f64()).min(0.1);
        let position = self.mean();
        let outcome = self.advance(now, elapsed, position);
        if outcome.is_err() {
            self.cut(now);
        }
        outcome
    }

    fn advance(&mut self, now: HostMicros, elapsed: f64, position: f64) -> Result<f64, DriveFault> {
        let config = self.config;
        match self.state {
            State::Rest => Ok(0.0),
            State::Coasting { last, since } => {
                if (position - last).abs() > config.tolerance {
                    self.state = State::Coasting { last: position, since: now };
                } else if now.since(since).as_secs_f64() >= SETTLED {
                    self.state = State::Rest;
                }
                Ok(0.0)
            }
            State::Following { mut profile, mut progress } => {
                profile.advance(elapsed, config.acceleration);
                profile.stay_near(position, LONGEST_LEAD * profile.speed + 4.0 * config.tolerance);
                let speed = profile.velocity + GAIN * (profile.position - position);
                progress.watch(speed * elapsed, position, &config)?;
                self.state = if profile.has_arrived() {
                    State::Settling { target: profile.target, progress, since: now, near_since: None }
                } else {
                    State::Following { profile, progress }
                };
                Ok(self.drive(speed))
            }
            State::Settling { target, mut progress, since, near_since } => {
                let error = target - position;
                let near = if near_since.is_some() { config.tolerance } else { self.aim };
                if error.abs() <= near {
                    let near_since = near_since.unwrap_or(now);
                    let has_settled = now.since(near_since).as_secs_f64() >= SETTLED;
                    // It may have run on; then it is driven again.
                    let near_since = Some(near_since).filter(|_| !has_settled);
                    let is_there = has_settled && error.abs() <= self.aim;
                    let settling = State::Settling { target, progress, since, near_since };
                    self.state = if is_there { State::Rest } else { settling };
                    return Ok(0.0);
                }
                let speed = GAIN * error;
                progress.watch(speed * elapsed, position, &config)?;
                let gives_up = now.since(since).as_secs_f64() >= SETTLING;
                self.state = if gives_up {
                    State::Coasting { last: position, since: now }
                } else {
                    State::Settling { target, progress, since, near_since: None }
                };
                Ok(if gives_up { 0.0 } else { self.drive(speed) })
            }
        }
    }

    /// The drive that gives `speed`, beyond the dead band.
    fn drive(&self, speed: f64) -> f64 {
        let share = (speed / self.config.max_speed.counts_per_second()).clamp(-1.0, 1.0);
        if share.abs() < 1e-6 {
            return 0.0;
        }
        let drive = share.signum() * (self.config.dead_band + (1.0 - self.config.dead_band) * share.abs());
        if self.config.reversed { -drive } else { drive }
    }
}

#[cfg(test)]
mod tests;
