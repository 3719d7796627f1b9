//! Where the glass is, from what it was told: an oscillator that follows each set-point.

use std::collections::VecDeque;
use std::time::Duration;

use evfocus_core::HostMicros;

/// Set-points on their way to the coil; more are never sent within one delay.
const MOST_WAITING: usize = 64;

/// How a lens follows its set-points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ResponseConfig {
    /// Natural frequency, cycles per second.
    pub natural_hz: f64,
    /// Damping as a share of the critical one; above 0, below 1.
    pub damping: f64,
    /// From the end of a command to the change of current.
    pub delay: Duration,
}

impl Default for ResponseConfig {
    /// A polymer lens of 10 to 16 mm: 150 Hz, hardly damped, 0.5 ms.
    fn default() -> Self {
        Self { natural_hz: 150.0, damping: 0.2, delay: Duration::from_micros(500) }
    }
}

/// The oscillator's state.
#[derive(Debug)]
pub(super) struct Response {
    config: ResponseConfig,
    /// When position and velocity were as they are here.
    time: HostMicros,
    position: f64,
    velocity: f64,
    rest: f64,
    waiting: VecDeque<(HostMicros, f64)>,
}

impl Response {
    /// At rest.
    pub(super) fn new(config: ResponseConfig, time: HostMicros, position: f64) -> Self {
        Self { config, time, position, velocity: 0.0, rest: position, waiting: VecDeque::new() }
    }

    /// A set-point went out at `time`.
    pub(super) fn follow(&mut self, time: HostMicros, rest: f64) {
        if self.waiting.len() < MOST_WAITING {
            self.waiting.push_back((time + self.config.delay, rest));
        }
    }

    /// Position and velocity at `time`, which never goes back.
    pub(super) fn at(&mut self, time: HostMicros) -> (f64, f64) {
        while let Some(&(due, rest)) = self.waiting.front().filter(|(due, _)| *due <= time) {
            self.waiting.pop_front();
            self.advance(due);
            self.rest = rest;
        }
        self.advance(time);
        (self.position, self.velocity)
    }

    /// In closed form, so that steps of any length are exact.
    fn advance(&mut self, time: HostMicros) {
        let seconds = time.since(self.time).as_secs_f64();
        let natural = std::f64::consts::TAU * self.config.natural_hz;
        let (decay, omega) =
            (self.config.damping * natural, natural * (1.0 - self.config.damping.powi(2)).sqrt());
        let along = self.position - self.rest;
        let across = (self.velocity + decay * along) / omega;
        let (sin, cos) = (omega * seconds).sin_cos();
        let envelope = (-decay * seconds).exp();
        let offset = envelope * (along * cos + across * sin);
        self.velocity = envelope * omega * (across * cos - along * sin) - decay * offset;
        self.position = self.rest + offset;
        self.time = self.time.max(time);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_overshoots_and_settles_and_the_way_there_does_not_matter() {
        let config = ResponseConfig::default();
        let step = || {
            let mut response = Response::new(config, HostMicros(0), 0.0);
            response.follow(HostMicros(0), 100.0);
            response
        };
        let (mut fine, mut coarse) = (step(), step());
        let mut highest: f64 = 0.0;
        for micros in (0..100_000).step_by(50) {
            highest = highest.max(fine.at(HostMicros(micros)).0);
        }
        // exp(-pi zeta / sqrt(1 - zeta^2)) = 52.7 % for a damping of 0.2.
        assert!((highest - 152.7).abs() < 0.2, "{highest}");
        let (position, velocity) = coarse.at(HostMicros(99_950));
        assert!((position - fine.at(HostMicros(99_950)).0).abs() < 1e-9);
        assert!((position - 100.0).abs() < 1e-3 && velocity.abs() < 1.0, "{position} {velocity}");
    }

    #[test]
    fn nothing_happens_before_the_delay_is_over() {
        let mut response = Response::new(ResponseConfig::default(), HostMicros(0), 5.0);
        response.follow(HostMicros(1000), 50.0);
        assert!((response.at(HostMicros(1500)).0 - 5.0).abs() < 1e-12);
        assert!(response.at(HostMicros(2500)).0 > 6.0);
    }
}
