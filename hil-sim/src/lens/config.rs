//! How good or bad the simulated lens is.

use std::time::Duration;

use evfocus_core::{LensPosition, LensRange, LensSpeed};

use crate::ConfigError;
use crate::names::named;

/// A motorised lens and its vices. The default is the paper's range and a good motor: no vices, whole counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LensConfig {
    /// Positions that the lens accepts. Default 220 to 3750.
    pub range: LensRange,
    /// Where the way of the shaft ends before that of the positions does: the motor slips there and counts on. Default nowhere.
    pub ends: Option<LensRange>,
    /// Where the lens stands at first; in the range and between the ends. Default 220.
    pub start: LensPosition,
    /// Fastest travel, counts per second. Default 1765: the range in 2 s.
    pub max_speed: LensSpeed,
    /// Acceleration and braking, counts per second squared. Default 20 000: full speed in 90 ms.
    pub acceleration: f64,
    /// Dead travel between motor and glass, counts: upwards the glass is where the motor says, downwards this much above.
    pub backlash: f64,
    /// How far the motor runs past a target before it comes back, counts.
    pub overshoot: f64,
    /// Ripple of the speed: it goes between the asked one and (1 - 2 x this) of it; 0 to 0.45.
    pub speed_ripple: f64,
    /// Period of the ripple. Default 100 ms.
    pub speed_ripple_period: Duration,
    /// Share of each period during which the lens sticks, to catch up in the rest; 0 to 0.95.
    pub stick_slip: f64,
    /// Period of the sticking. Default 40 ms.
    pub stick_slip_period: Duration,
    /// How the speed changes along each motion, as a share of the speed asked: above zero it rises linearly with time from
    /// (1 - this) of the speed asked to all of it, below zero it falls from all of it to (1 + this); -0.8 to 0.8.
    pub speed_drift: f64,
    /// Noise of a reported position, counts RMS.
    pub read_noise: f64,
    /// Step of a reported position, counts; 0 for a continuous one. Default 1.
    pub read_resolution: f64,
    /// Age of a reported position on top of the round trip.
    pub read_lag: Duration,
    /// From the question for the position to its answer; the caller waits for it on the rig's clock. Default 0.
    pub round_trip: Duration,
    /// Whether the lens refuses to travel before it was homed. Default no.
    pub needs_homing: bool,
}

/// The usual lenses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum LensKind {
    /// No vices: [`LensConfig::default`].
    #[default]
    Good,
    /// A bit of everything: [`LensConfig::worn`].
    Worn,
    /// A motor whose speed doubles along each motion.
    Accelerating,
    /// A motor whose speed ripples by 20 % about its mean.
    Rippling,
    /// A motor that stands still for half of the time, in periods of 40 ms.
    Sticking,
}

named!(LensKind, "lens", {
    Good => "good",
    Worn => "worn",
    Accelerating => "accelerating",
    Rippling => "rippling",
    Sticking => "sticking",
});

impl From<LensKind> for LensConfig {
    fn from(kind: LensKind) -> Self {
        match kind {
            LensKind::Good => Self::default(),
            LensKind::Worn => Self::worn(),
            LensKind::Accelerating => Self { speed_drift: 0.5, ..Self::default() },
            LensKind::Rippling => Self { speed_ripple: 1.0 / 6.0, ..Self::default() },
            LensKind::Sticking => Self { stick_slip: 0.5, ..Self::default() },
        }
    }
}

impl LensConfig {
    /// A worn lens: backlash 15, overshoot 6, ripple 0.15, read-out noise 1.5 counts, 3 ms old.
    pub fn worn() -> Self {
        Self {
            backlash: 15.0,
            overshoot: 6.0,
            speed_ripple: 0.15,
            read_noise: 1.5,
            read_lag: Duration::from_millis(3),
            ..Self::default()
        }
    }

    pub(crate) fn validate(&self) -> Result<(), ConfigError> {
        let positive = f64::MIN_POSITIVE;
        let way = self.ends.unwrap_or(self.range);
        let lowest = self.range.min().0.max(way.min().0);
        let highest = self.range.max().0.min(way.max().0);
        ConfigError::check("lens.start", self.start.0, lowest, highest)?;
        ConfigError::check("lens.acceleration", self.acceleration, 1.0, 1e9)?;
        ConfigError::check("lens.backlash", self.backlash, 0.0, self.range.length())?;
        ConfigError::check("lens.overshoot", self.overshoot, 0.0, self.range.length())?;
        ConfigError::check("lens.speed_ripple", self.speed_ripple, 0.0, 0.45)?;
        ConfigError::check(
            "lens.speed_ripple_period",
            self.speed_ripple_period.as_secs_f64(),
            positive,
            1e3,
        )?;
        ConfigError::check("lens.stick_slip", self.stick_slip, 0.0, 0.95)?;
        ConfigError::check("lens.stick_slip_period", self.stick_slip_period.as_secs_f64(), positive, 1e3)?;
        ConfigError::check("lens.speed_drift", self.speed_drift, -0.8, 0.8)?;
        ConfigError::check("lens.read_noise", self.read_noise, 0.0, self.range.length())?;
        ConfigError::check("lens.read_resolution", self.read_resolution, 0.0, self.range.length())
    }
}

impl Default for LensConfig {
    fn default() -> Self {
        let (min, max) = (LensPosition(220.0), LensPosition(3750.0));
        #[expect(clippy::expect_used, reason = "constants that are a valid range and a valid speed")]
        let (range, max_speed) =
            (LensRange::new(min, max).expect("ordered"), LensSpeed::new(1765.0).expect("positive"));
        Self {
            range,
            ends: None,
            start: min,
            max_speed,
            acceleration: 20_000.0,
            backlash: 0.0,
            overshoot: 0.0,
            speed_ripple: 0.0,
            speed_ripple_period: Duration::from_millis(100),
            stick_slip: 0.0,
            stick_slip_period: Duration::from_millis(40),
            speed_drift: 0.0,
            read_noise: 0.0,
            read_resolution: 1.0,
            read_lag: Duration::ZERO,
            round_trip: Duration::ZERO,
            needs_homing: false,
        }
    }
}
