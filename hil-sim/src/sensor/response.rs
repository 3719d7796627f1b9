//! From the light on a pixel to the signal that is compared with the thresholds.

use super::STEP_MICROS;
use super::config::SensorConfig;
use crate::ConfigError;

/// How the pixel takes the logarithm of the intensity. Intensities are in DN, 0 to 255.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Logarithm {
    /// ln I, and linear with the same slope below so many DN: v2e's, there below 20. The default.
    LinearBelow(f64),
    /// ln (I + so many DN), as dark current or stray light makes it: IEBCS (1 lux), ESIM (0.001 of white).
    Offset(f64),
}

impl Logarithm {
    pub(super) fn validate(self) -> Result<(), ConfigError> {
        match self {
            Self::LinearBelow(level) => {
                ConfigError::check("sensor.logarithm.linear_below", level, 0.1, 255.0)
            }
            Self::Offset(offset) => ConfigError::check("sensor.logarithm.offset", offset, 0.1, 1e5),
        }
    }
}

/// Logarithm and bandwidth in the form that the pixels compute with.
#[derive(Debug, Clone, Copy)]
pub(super) struct Response {
    offset: f32,
    linear_below: f32,
    /// DN to which the bandwidth falls.
    dark: f32,
    /// 2 pi cut-off x step / (255 + dark): times (DN + dark) it is the step in time constants.
    rate: f32,
    /// Share of its way to the photoreceptor's level that the source follower goes in a step.
    follow: f32,
}

impl Response {
    pub(super) fn new(config: &SensorConfig) -> Self {
        let (offset, linear_below) = match config.logarithm {
            Logarithm::LinearBelow(level) => (0.0, level),
            // No sum is below the offset: the linear part is never used.
            Logarithm::Offset(offset) => (offset, offset),
        };
        let radians = std::f64::consts::TAU * STEP_MICROS as f64 * 1e-6;
        let constants = radians * config.source_follower_hz.unwrap_or(0.0);
        Self {
            offset: offset as f32,
            linear_below: linear_below as f32,
            dark: config.cutoff_dark_dn as f32,
            rate: (radians * config.cutoff_hz / (255.0 + config.cutoff_dark_dn)) as f32,
            follow: (constants / (1.0 + constants)) as f32,
        }
    }

    /// The logarithm of an intensity, as the pixel takes it.
    pub(super) fn logarithm(self, intensity: f32) -> f32 {
        let sum = intensity + self.offset;
        let bright = if sum > self.linear_below { sum } else { self.linear_below };
        natural_logarithm(bright) + (sum - bright) / self.linear_below
    }

    /// The photoreceptor's level a step later. The implicit step is stable whatever the cut-off, and its delay of a ramp is
    /// exactly the time constant.
    pub(super) fn receive(self, level: f32, light: f32) -> f32 {
        let step = self.rate * (light + self.dark);
        level + step / (1.0 + step) * (self.logarithm(light) - level)
    }

    /// The source follower's level a step later.
    pub(super) fn follow(self, level: f32, receptor: f32) -> f32 {
        level + self.follow * (receptor - level)
    }
}

/// ln x to 5e-6, for positive normal numbers, in a form that the compiler turns into vector code. Continuous: the
/// polynomial is exact at the powers of two, else they would show as edges.
fn natural_logarithm(x: f32) -> f32 {
    let bits = x.to_bits();
    let exponent = (bits >> 23) as i32 - 127;
    let f = f32::from_bits((bits & 0x007F_FFFF) | 0x3F80_0000) - 1.0;
    // ln(1 + f) = f (ln 2 + (1 - f) q(f)), q by interpolation at five Chebyshev points.
    let q = 0.306_824_42 + f * (-0.191_703_37 + f * (0.127_608_97 + f * (-0.067_375_18 + f * 0.017_807_826)));
    std::f32::consts::LN_2 * (exponent as f32 + f) + f * (1.0 - f) * q
}
