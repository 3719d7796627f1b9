//! Motor positions against time as stretches that are known in closed form for any time.

/// What drives the motor during a phase.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Course {
    /// Constant acceleration, counts per second squared; the motor does not turn round.
    Accelerated(f64),
    /// A spring that pulls to its rest: glass without a motor, as in a liquid lens.
    Sprung(Spring),
}

/// A damped spring, below critical damping.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Spring {
    /// Where it comes to rest, counts.
    pub(crate) rest: f64,
    /// Undamped, cycles per second.
    pub(crate) natural_hz: f64,
    /// Share of the critical damping; above 0, below 1.
    pub(crate) damping: f64,
}

impl Spring {
    /// Position and velocity `seconds` after it was let go at `position` with `velocity`.
    fn after(&self, position: f64, velocity: f64, seconds: f64) -> (f64, f64) {
        let natural = std::f64::consts::TAU * self.natural_hz;
        let (decay, omega) = (self.damping * natural, natural * (1.0 - self.damping * self.damping).sqrt());
        let along = position - self.rest;
        let across = (velocity + decay * along) / omega;
        let (sin, cos) = (omega * seconds).sin_cos();
        let envelope = (-decay * seconds).exp();
        let offset = envelope * (along * cos + across * sin);
        (self.rest + offset, envelope * omega * (across * cos - along * sin) - decay * offset)
    }

    /// By then what is left of a step is below a hundred-thousandth of it.
    fn settling(&self) -> f64 {
        12.0 / (self.damping * std::f64::consts::TAU * self.natural_hz)
    }
}

/// A stretch of the motor's way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Phase {
    /// Counts at its start.
    pub(super) position: f64,
    /// Counts per second at its start.
    pub(super) velocity: f64,
    pub(super) course: Course,
    /// Seconds.
    pub(super) duration: f64,
}

impl Phase {
    pub(super) fn position_after(&self, seconds: f64) -> f64 {
        match self.course {
            Course::Accelerated(acceleration) => {
                self.position + seconds * (self.velocity + 0.5 * acceleration * seconds)
            }
            Course::Sprung(spring) => spring.after(self.position, self.velocity, seconds).0,
        }
    }

    pub(super) fn velocity_after(&self, seconds: f64) -> f64 {
        match self.course {
            Course::Accelerated(acceleration) => self.velocity + acceleration * seconds,
            Course::Sprung(spring) => spring.after(self.position, self.velocity, seconds).1,
        }
    }

    pub(super) fn end(&self) -> f64 {
        self.position_after(self.duration)
    }
}

/// What the motor can do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Limits {
    /// Counts per second.
    pub(super) speed: f64,
    /// Counts per second squared.
    pub(super) acceleration: f64,
}

/// Brings the motor from `position` and `velocity` to rest.
pub(super) fn brake(phases: &mut Vec<Phase>, position: f64, velocity: f64, acceleration: f64) -> f64 {
    push(phases, position, velocity, -acceleration.copysign(velocity), velocity.abs() / acceleration)
}

/// Lets the glass swing to where `spring` rests.
pub(super) fn swing(phases: &mut Vec<Phase>, position: f64, velocity: f64, spring: Spring) {
    phases.push(Phase { position, velocity, course: Course::Sprung(spring), duration: spring.settling() });
}

/// A trapezoid of speed from `position` and `velocity` to rest at `target`. Returns where it ends: `target`, up to rounding.
pub(super) fn travel(
    phases: &mut Vec<Phase>,
    position: f64,
    velocity: f64,
    target: f64,
    limits: Limits,
) -> f64 {
    let Limits { speed, acceleration } = limits;
    let (mut position, mut velocity) = (position, velocity);
    let stop = position + velocity * velocity.abs() / (2.0 * acceleration);
    let direction = if target >= stop { 1.0 } else { -1.0 };
    if velocity * direction < 0.0 {
        // Going the wrong way, or too fast to stop before the target: the way back starts where the motor has stopped.
        position = brake(phases, position, velocity, acceleration);
        velocity = 0.0;
    }
    let entry = velocity.abs();
    if entry > speed {
        position =
            push(phases, position, velocity, -direction * acceleration, (entry - speed) / acceleration);
        velocity = direction * speed;
    }
    let distance = (target - position).abs();
    let entry = velocity.abs();
    let peak = (acceleration * distance + entry * entry / 2.0).sqrt().min(speed).max(entry);
    let ramps = (2.0 * peak * peak - entry * entry) / (2.0 * acceleration);
    position = push(phases, position, velocity, direction * acceleration, (peak - entry) / acceleration);
    position = push(phases, position, direction * peak, 0.0, (distance - ramps).max(0.0) / peak);
    push(phases, position, direction * peak, -direction * acceleration, peak / acceleration)
}

/// Appends a phase unless it is empty; returns the position at its end.
fn push(phases: &mut Vec<Phase>, position: f64, velocity: f64, acceleration: f64, duration: f64) -> f64 {
    // The NaN of a motor at rest that is told to stay where it is (0 / 0) is not above zero either.
    if duration > 0.0 {
        let phase = Phase { position, velocity, course: Course::Accelerated(acceleration), duration };
        phases.push(phase);
        phase.end()
    } else {
        position
    }
}
