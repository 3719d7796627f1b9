//! How the picture moves on the sensor: hand shake, vibration of the rig, and a scene that drifts.

use rand::RngExt;
use rand_xoshiro::Xoshiro256PlusPlus;

/// The motion of the picture. The default stands still.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MotionConfig {
    /// Hand shake, pixels RMS along each axis: random-phase sinusoids of 0.8 to 18 Hz with amplitudes as 1/f. 1.5 to 3 is a
    /// hand, 7 is violent (sensor-and-optics, section 2).
    pub shake_px_rms: f64,
    /// Roll that goes with the shake, radians RMS; 0.003 is a hand. Applied as a shear of the rows, which is a rotation's
    /// horizontal part.
    pub roll_rad_rms: f64,
    /// Vibration of a fixed rig, pixels RMS along each axis: 12 to 70 Hz. 0.05 to 0.1 comes from motor and fan.
    pub vibration_px_rms: f64,
    /// Steady motion of the scene, pixels per second to the right and down. The scene repeats at its margins.
    pub velocity_px_per_s: (f64, f64),
}

impl MotionConfig {
    /// A hand that holds the camera: 2 px RMS of shake, 3 mrad RMS of roll.
    pub fn hand_held() -> Self {
        Self { shake_px_rms: 2.0, roll_rad_rms: 0.003, ..Self::default() }
    }

    /// A rig on a table, with a motor and a fan: 0.07 px RMS of vibration.
    pub fn fixed_rig() -> Self {
        Self { vibration_px_rms: 0.07, ..Self::default() }
    }

    /// A scene that moves to the right at `px_per_s`.
    pub fn moving(px_per_s: f64) -> Self {
        Self { velocity_px_per_s: (px_per_s, 0.0), ..Self::default() }
    }
}

/// Where the picture is at one instant.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Pose {
    /// Displacement of the picture to the right, pixels.
    pub(crate) right: f64,
    /// Displacement of the picture down, pixels.
    pub(crate) down: f64,
    /// Roll, radians.
    pub(crate) roll: f64,
}

/// A sum of sinusoids of random phase.
#[derive(Debug, Clone)]
struct Wobble(Vec<Sinusoid>);

#[derive(Debug, Clone, Copy)]
struct Sinusoid {
    amplitude: f64,
    radians_per_s: f64,
    phase: f64,
}

impl Wobble {
    /// `count` sinusoids, one in each of as many equal parts of the logarithmic band `hertz`, amplitude as frequency to the
    /// power of `slope`, scaled to `rms`.
    fn new(rng: &mut Xoshiro256PlusPlus, count: u32, hertz: (f64, f64), slope: f64, rms: f64) -> Self {
        // The draws are made even when the amplitude is zero, so that switching one motion on leaves the others as they are.
        let mut parts: Vec<Sinusoid> = (0..count)
            .map(|part| {
                let share = (f64::from(part) + rng.random::<f64>()) / f64::from(count);
                let frequency = hertz.0 * (hertz.1 / hertz.0).powf(share);
                Sinusoid {
                    amplitude: frequency.powf(slope),
                    radians_per_s: std::f64::consts::TAU * frequency,
                    phase: rng.random::<f64>() * std::f64::consts::TAU,
                }
            })
            .collect();
        let power: f64 = parts.iter().map(|part| part.amplitude * part.amplitude / 2.0).sum();
        for part in &mut parts {
            part.amplitude *= rms / power.sqrt();
        }
        parts.retain(|part| part.amplitude > 0.0);
        Self(parts)
    }

    fn at(&self, seconds: f64) -> f64 {
        self.0.iter().map(|part| part.amplitude * (part.radians_per_s * seconds + part.phase).sin()).sum()
    }
}

/// The motion of one rig.
#[derive(Debug, Clone)]
pub(crate) struct Motion {
    shake: [Wobble; 2],
    vibration: [Wobble; 2],
    roll: Wobble,
    velocity: (f64, f64),
    still: bool,
}

impl Motion {
    pub(crate) fn new(config: &MotionConfig, rng: &mut Xoshiro256PlusPlus) -> Self {
        let mut shake = || Wobble::new(rng, 12, (0.8, 18.0), -1.0, config.shake_px_rms);
        let shake = [shake(), shake()];
        let mut vibration = || Wobble::new(rng, 6, (12.0, 70.0), 0.0, config.vibration_px_rms);
        let vibration = [vibration(), vibration()];
        let roll = Wobble::new(rng, 12, (0.8, 18.0), -1.0, config.roll_rad_rms);
        Self {
            shake,
            vibration,
            roll,
            velocity: config.velocity_px_per_s,
            still: *config == MotionConfig::default(),
        }
    }

    /// The pose `seconds` after the rig was made.
    pub(crate) fn pose(&self, seconds: f64) -> Pose {
        if self.still {
            return Pose::default();
        }
        Pose {
            right: self.shake[0].at(seconds) + self.vibration[0].at(seconds) + self.velocity.0 * seconds,
            down: self.shake[1].at(seconds) + self.vibration[1].at(seconds) + self.velocity.1 * seconds,
            roll: self.roll.at(seconds),
        }
    }
}
