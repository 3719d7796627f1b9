//! Motor positions against time as stretches of constant acceleration, known in closed form for any time.

/// A stretch of constant acceleration in which the motor does not turn round.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Phase {
    /// Counts at its start.
    pub(super) position: f64,
    /// Counts per second at its start.
    pub(super) velocity: f64,
    /// Counts per second squared.
    pub(super) acceleration: f64,
    /// Seconds.
    pub(super) duration: f64,
}

impl Phase {
    pub(super) fn position_after(&self, seconds: f64) -> f64 {
        self.position + seconds * (self.velocity + 0.5 * self.acceleration * seconds)
    }

    pub(super) fn velocity_after(&self, seconds: f64) -> f64 {
        self.velocity + self.acceleration * seconds
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
        let phase = Phase { position, velocity, acceleration, duration };
        phases.push(phase);
        phase.end()
    } else {
        position
    }
}
