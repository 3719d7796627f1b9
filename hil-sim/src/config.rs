//! What a rig is made of, and the check that it makes sense.

use std::time::Duration;

use evfocus_core::LensPosition;

use crate::changes::{Change, ChangeKind};
use crate::fan::FanConfig;
use crate::faults::{Fault, FaultKind, FaultTrigger};
use crate::lens::LensConfig;
use crate::motion::MotionConfig;
use crate::optics::OpticsConfig;
use crate::scene::Scene;
use crate::sensor::{CameraModel, Light, SensorConfig};

/// A simulated rig. The default is a DAVIS346 in daylight before a still dead-leaves scene, in focus at 1985.
#[derive(Debug, Clone, PartialEq)]
pub struct RigConfig {
    /// The sensor; [`SensorConfig::preset`] has the usual ones.
    pub sensor: SensorConfig,
    /// What the camera looks at.
    pub scene: Scene,
    /// The glass position at which the scene is sharp; in the lens's range.
    pub focus: LensPosition,
    /// The same for the other half of [`Scene::TwoDepths`]; other scenes ignore it.
    pub second_focus: LensPosition,
    /// From lens position to blur.
    pub optics: OpticsConfig,
    /// How the picture moves.
    pub motion: MotionConfig,
    /// A fan that turns in the picture; `None` for none.
    pub fan: Option<FanConfig>,
    /// The light's flicker; `None` for daylight.
    pub flicker: Option<Flicker>,
    /// The lens.
    pub lens: LensConfig,
    /// The camera's clock and its cable.
    pub link: LinkConfig,
    /// What goes wrong.
    pub faults: Vec<Fault>,
    /// What happens in front of the camera, in order of time.
    pub changes: Vec<Change>,
    /// Every random choice follows from it. Default 1.
    pub seed: u64,
}

impl RigConfig {
    /// The default rig with another camera and light; the blur slope goes with the sensor's pixel pitch.
    pub fn preset(model: CameraModel, light: Light) -> Self {
        let mut config = Self { sensor: SensorConfig::preset(model, light), ..Self::default() };
        config.optics.blur_px_per_count = OpticsConfig::default().blur_px_per_count * model.pitch_ratio();
        config
    }

    /// Checks every value.
    ///
    /// # Errors
    /// [`ConfigError`] for the first one out of its range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        self.sensor.validate()?;
        self.optics.validate()?;
        self.lens.validate()?;
        self.link.validate()?;
        let (low, high) = (self.lens.range.min().0, self.lens.range.max().0);
        ConfigError::check("focus", self.focus.0, low, high)?;
        ConfigError::check("second_focus", self.second_focus.0, low, high)?;
        ConfigError::check("motion.shake_px_rms", self.motion.shake_px_rms, 0.0, 1000.0)?;
        ConfigError::check("motion.roll_rad_rms", self.motion.roll_rad_rms, 0.0, 0.1)?;
        ConfigError::check("motion.vibration_px_rms", self.motion.vibration_px_rms, 0.0, 1000.0)?;
        ConfigError::check("motion.velocity_px_per_s.0", self.motion.velocity_px_per_s.0, -1e5, 1e5)?;
        ConfigError::check("motion.velocity_px_per_s.1", self.motion.velocity_px_per_s.1, -1e5, 1e5)?;
        self.fan.map_or(Ok(()), |fan| fan.validate())?;
        if let Some(flicker) = self.flicker {
            ConfigError::check("flicker.hertz", flicker.hertz, 0.1, 500.0)?;
            ConfigError::check("flicker.depth", flicker.depth, 0.0, 1.0)?;
        }
        for change in &self.changes {
            match change.kind {
                ChangeKind::Focus { by } => ConfigError::check("changes.by", by, -1e5, 1e5)?,
                ChangeKind::Pace { times } => ConfigError::check("changes.times", times, 0.0, 100.0)?,
                ChangeKind::Light { times } => ConfigError::check("changes.times", times, 1e-3, 1e3)?,
            }
        }
        for fault in &self.faults {
            if let FaultKind::EventLoss { share, .. } = fault.kind {
                ConfigError::check("faults.share", share, 0.0, 1.0)?;
            }
            if let FaultTrigger::AtPosition(position) = fault.trigger {
                ConfigError::check("faults.position", position.0, low, high)?;
            }
        }
        Ok(())
    }
}

impl Default for RigConfig {
    fn default() -> Self {
        Self {
            sensor: SensorConfig::default(),
            scene: Scene::DeadLeaves,
            focus: LensPosition(1985.0),
            second_focus: LensPosition(2785.0),
            optics: OpticsConfig::default(),
            motion: MotionConfig::default(),
            fan: None,
            flicker: None,
            lens: LensConfig::default(),
            link: LinkConfig::default(),
            faults: Vec::new(),
            changes: Vec::new(),
            seed: 1,
        }
    }
}

/// Light from the mains: 1 - depth + depth |sin|, with |sin| at twice the mains' frequency.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flicker {
    /// Frequency of the |sin|: 100 or 120 Hz.
    pub hertz: f64,
    /// Share of the light that goes dark, 0 to 1. Above about 0.2 over the whole field a DAVIS saturates.
    pub depth: f64,
}

impl Flicker {
    /// The light's share of its brightest, `seconds` after the rig was made.
    pub(crate) fn gain(self, seconds: f64) -> f64 {
        1.0 - self.depth + self.depth * (std::f64::consts::PI * self.hertz * seconds).sin().abs()
    }
}

/// The camera's clock against the host's, and the transfers that bring the events.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinkConfig {
    /// Camera time when the rig is made. Default 1.2 s.
    pub clock_offset: Duration,
    /// How much faster the camera's clock runs than the host's, parts per million. Default 20.
    pub clock_drift_ppm: f64,
    /// From the end of a transfer's millisecond to its arrival, at least. Default 100 us.
    pub delay: Duration,
    /// Mean of the exponentially distributed extra delay. Default 80 us.
    pub delay_jitter: Duration,
}

impl LinkConfig {
    fn validate(&self) -> Result<(), ConfigError> {
        ConfigError::check("link.clock_drift_ppm", self.clock_drift_ppm, -10_000.0, 10_000.0)?;
        ConfigError::check("link.delay", self.delay.as_secs_f64(), 0.0, 10.0)?;
        ConfigError::check("link.delay_jitter", self.delay_jitter.as_secs_f64(), 0.0, 10.0)
    }
}

impl Default for LinkConfig {
    fn default() -> Self {
        Self {
            clock_offset: Duration::from_millis(1200),
            clock_drift_ppm: 20.0,
            delay: Duration::from_micros(100),
            delay_jitter: Duration::from_micros(80),
        }
    }
}

/// A configuration value that makes no sense.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{field} is {value}; it must be within {min} and {max}")]
pub struct ConfigError {
    /// The value's path in [`RigConfig`].
    pub field: &'static str,
    /// The value given.
    pub value: f64,
    /// Lowest valid value.
    pub min: f64,
    /// Highest valid value.
    pub max: f64,
}

impl ConfigError {
    /// `Err` unless `value` is a number from `min` to `max`.
    pub(crate) fn check(field: &'static str, value: f64, min: f64, max: f64) -> Result<(), Self> {
        if value >= min && value <= max { Ok(()) } else { Err(Self { field, value, min, max }) }
    }
}
