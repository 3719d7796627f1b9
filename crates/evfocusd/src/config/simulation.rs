//! `[simulation]`: the rig that stands in for hardware.

use std::str::FromStr;
use std::time::Duration;

use evfocus_core::LensPosition;
use evfocus_hal::LensInfo;
use hil_sim::{
    CameraModel, Fault, FaultKind, FaultTrigger, Flicker, LensConfig, Light, MotionConfig, RigConfig, Scene,
};
use serde::Deserialize;

use super::BadValue;

/// `[simulation]`
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SimulationSection {
    /// `davis346` or `imx636`.
    pub camera: String,
    /// `light` or `dark`.
    pub light: String,
    /// `text`, `siemens-star`, `dead-leaves`, `pink-noise`, `star-field`, `checker`, `blank-wall` or `two-depths`.
    pub scene: String,
    /// The lens position at which the scene is sharp, counts. The focus loop does not know it.
    pub focus_counts: f64,
    /// The same for the second plane of `two-depths`.
    pub second_focus_counts: f64,
    /// Hand shake, pixels RMS; 1.5 to 3 is a hand.
    pub shake_px_rms: f64,
    /// Vibration of a fixed rig, pixels RMS; 0.05 to 0.1 is usual.
    pub vibration_px_rms: f64,
    /// Motion of the scene to the right, pixels per second.
    pub velocity_px_per_s: f64,
    /// Frequency at which the light flickers, 100 or 120 Hz; 0: it does not.
    pub flicker_hz: f64,
    /// Depth of the flicker, 0 to 1.
    pub flicker_depth: f64,
    /// `good` or `worn` (backlash, overshoot, ripple, noise, lag).
    pub lens: String,
    /// Whether the lens must be homed before it moves.
    pub lens_needs_homing: bool,
    /// Number of hot pixels.
    pub hot_pixels: u32,
    /// Every random choice follows from it.
    pub seed: u64,
    /// What goes wrong.
    pub faults: Vec<FaultSection>,
}

impl Default for SimulationSection {
    fn default() -> Self {
        let rig = RigConfig::default();
        Self {
            camera: "davis346".to_owned(),
            light: "light".to_owned(),
            scene: rig.scene.to_string(),
            focus_counts: rig.focus.0,
            second_focus_counts: rig.second_focus.0,
            shake_px_rms: 0.0,
            vibration_px_rms: 0.0,
            velocity_px_per_s: 0.0,
            flicker_hz: 0.0,
            flicker_depth: 0.1,
            lens: "good".to_owned(),
            lens_needs_homing: false,
            hot_pixels: 0,
            seed: rig.seed,
            faults: Vec::new(),
        }
    }
}

/// `[[simulation.faults]]`: one thing that goes wrong.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaultSection {
    /// `camera-unplugged`, `camera-time-reset`, `event-loss`, `lens-unplugged`, `lens-stalled`, `lens-silent` or
    /// `lens-position-late`.
    pub kind: String,
    /// When, milliseconds after the start.
    pub after_ms: Option<f64>,
    /// When, as the position that the lens comes by, counts.
    pub at_counts: Option<f64>,
    /// Share of the events that `event-loss` loses, 0 to 1.
    pub share: Option<f64>,
    /// How long `event-loss` lasts, or how late `lens-position-late` is, milliseconds.
    pub duration_ms: Option<f64>,
}

fn named<T: FromStr<Err = hil_sim::NameError>>(key: &str, name: &str) -> Result<T, BadValue> {
    name.parse().map_err(|error: hil_sim::NameError| {
        BadValue::new(key, name, format!("choose one of: {}", error.choices))
    })
}

impl SimulationSection {
    /// The rig that the section describes, with the range and the speed of the `emulated` lens if there is one.
    pub(super) fn rig(&self, emulated: Option<&LensInfo>) -> Result<RigConfig, BadValue> {
        let camera: CameraModel = named("simulation.camera", &self.camera)?;
        let light: Light = named("simulation.light", &self.light)?;
        let mut rig = RigConfig::preset(camera, light);
        rig.scene = named::<Scene>("simulation.scene", &self.scene)?;
        rig.focus = LensPosition(self.focus_counts);
        rig.second_focus = LensPosition(self.second_focus_counts);
        rig.lens = match self.lens.as_str() {
            "good" => LensConfig::default(),
            "worn" => LensConfig::worn(),
            other => return Err(BadValue::new("simulation.lens", other, "choose one of: good, worn")),
        };
        if let Some(lens) = emulated {
            (rig.lens.range, rig.lens.max_speed) = (lens.range, lens.max_speed);
            rig.lens.start = lens.range.min();
        }
        rig.motion = MotionConfig {
            shake_px_rms: self.shake_px_rms,
            // A hand that shakes by 2 px rolls by 3 mrad.
            roll_rad_rms: 0.0015 * self.shake_px_rms,
            vibration_px_rms: self.vibration_px_rms,
            velocity_px_per_s: (self.velocity_px_per_s, 0.0),
        };
        BadValue::check("simulation.flicker_hz", self.flicker_hz, 0.0, 500.0)?;
        BadValue::check("simulation.flicker_depth", self.flicker_depth, 0.0, 1.0)?;
        rig.lens.needs_homing = self.lens_needs_homing;
        if self.flicker_hz > 0.0 {
            rig.flicker = Some(Flicker { hertz: self.flicker_hz, depth: self.flicker_depth });
        }
        rig.sensor.hot_pixels = self.hot_pixels;
        rig.seed = self.seed;
        rig.faults = self.faults.iter().map(FaultSection::fault).collect::<Result<_, _>>()?;
        rig.validate().map_err(|error| {
            let (value, min, max) = (error.value, error.min, error.max);
            BadValue::new(key_of(error.field), value, format!("it must be from {min} to {max}"))
        })?;
        Ok(rig)
    }
}

/// The key in the file behind a field of the simulator's configuration.
fn key_of(field: &str) -> String {
    let key = match field {
        "focus" => "focus_counts",
        "second_focus" => "second_focus_counts",
        // The roll follows from the shake.
        "motion.shake_px_rms" | "motion.roll_rad_rms" => "shake_px_rms",
        "motion.vibration_px_rms" => "vibration_px_rms",
        "motion.velocity_px_per_s.0" => "velocity_px_per_s",
        "faults.share" => "faults.share",
        "faults.position" => "faults.at_counts",
        other => other,
    };
    format!("simulation.{key}")
}

impl FaultSection {
    fn fault(&self) -> Result<Fault, BadValue> {
        let key = "simulation.faults";
        let duration = || -> Result<Duration, BadValue> {
            let value =
                self.duration_ms.ok_or_else(|| BadValue::new(key, &self.kind, "it needs duration_ms"))?;
            BadValue::duration("simulation.faults.duration_ms", value, 1e-3, 0.0, 1e6)
        };
        if self.share.is_some() && self.kind != "event-loss" {
            return Err(BadValue::new("simulation.faults.share", &self.kind, "only event-loss has a share"));
        }
        let kind = match self.kind.as_str() {
            "camera-unplugged" => FaultKind::CameraUnplugged,
            "camera-time-reset" => FaultKind::CameraTimeReset,
            "event-loss" => FaultKind::EventLoss {
                share: self.share.ok_or_else(|| BadValue::new(key, &self.kind, "it needs share"))?,
                duration: duration()?,
            },
            "lens-unplugged" => FaultKind::LensUnplugged,
            "lens-stalled" => FaultKind::LensStalled,
            "lens-silent" => FaultKind::LensSilent,
            "lens-position-late" => FaultKind::LensPositionLate { by: duration()? },
            other => {
                let remedy = "choose one of: camera-unplugged, camera-time-reset, event-loss, lens-unplugged, lens-stalled, \
                              lens-silent, lens-position-late";
                return Err(BadValue::new("simulation.faults.kind", other, remedy));
            }
        };
        let trigger = match (self.after_ms, self.at_counts) {
            (Some(after), None) => {
                FaultTrigger::After(BadValue::duration("simulation.faults.after_ms", after, 1e-3, 0.0, 1e9)?)
            }
            (None, Some(position)) => FaultTrigger::AtPosition(LensPosition(position)),
            (None, None) | (Some(_), Some(_)) => {
                return Err(BadValue::new(key, &self.kind, "it needs either after_ms or at_counts"));
            }
        };
        Ok(Fault { kind, trigger })
    }
}
