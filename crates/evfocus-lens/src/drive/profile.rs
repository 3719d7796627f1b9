//! A reference that moves to its target with bounded speed and acceleration.

/// Where the reference is, and where it goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Profile {
    /// Counts.
    pub(super) position: f64,
    /// Counts per second.
    pub(super) velocity: f64,
    /// Counts.
    pub(super) target: f64,
    /// Counts per second.
    pub(super) speed: f64,
}

impl Profile {
    /// Lets `elapsed` seconds pass.
    pub(super) fn advance(&mut self, elapsed: f64, acceleration: f64) {
        let distance = self.target - self.position;
        // From this speed it can stop at the target, one step later.
        let braking = (2.0 * acceleration * distance.abs()).sqrt();
        let wanted = braking.min(self.speed).copysign(distance);
        let change = acceleration * elapsed;
        self.velocity += (wanted - self.velocity).clamp(-change, change);
        let step = self.velocity * elapsed;
        if step * distance > 0.0 && step.abs() >= distance.abs() {
            (self.position, self.velocity) = (self.target, 0.0);
        } else {
            self.position += step;
        }
    }

    /// Keeps the reference within `lead` of the lens.
    pub(super) fn stay_near(&mut self, position: f64, lead: f64) {
        self.position = self.position.clamp(position - lead, position + lead);
    }

    pub(super) fn has_arrived(&self) -> bool {
        (self.target - self.position).abs() < 0.5
    }
}
