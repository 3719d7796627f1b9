//! Options that describe a simulated rig.

use clap::Args;
use evfocus_core::LensPosition;
use hil_sim::{CameraModel, Flicker, LensConfig, Light, MotionConfig, RigConfig, Scene};

use super::{choices, position};
use crate::exit::UsageError;

/// Repeats a simulation whose seed was printed, without an option.
const SEED_VARIABLE: &str = "EVFOCUS_SIM_SEED";
/// A hand that shakes by 2 px rolls by 3 mrad.
const ROLL_RAD_PER_PX: f64 = 0.0015;
/// Beyond this no sweep could be told from noise, and the roll would leave what the simulation allows.
const GREATEST_SHAKE_PX: f64 = 60.0;

/// The simulated camera, lens and scene.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Simulated rig")]
pub struct RigArguments {
    /// What the camera looks at [default: text for demo, dead-leaves for simulate]
    #[arg(long, value_name = "NAME", value_parser = choices(Scene::ALL, Scene::name))]
    pub scene: Option<Scene>,
    /// How much light there is: light (more than 100 lux) or dark (about 1 lux)
    #[arg(long, value_name = "NAME", default_value = "light", value_parser = choices(Light::ALL, Light::name))]
    pub light: Light,
    /// The camera: davis346 (346 x 260 pixels) or imx636 (1280 x 720 pixels)
    #[arg(long, value_name = "NAME", default_value = "davis346", value_parser = choices(CameraModel::ALL, CameraModel::name))]
    pub camera: CameraModel,
    /// Hand shake, in pixels RMS; 2 is a hand, 7 is violent
    #[arg(long, value_name = "PX_RMS", default_value_t = 0.0, value_parser = shake, allow_negative_numbers = true)]
    pub shake: f64,
    /// Steady motion of the scene to the right, in pixels per second
    #[arg(long, value_name = "PX_PER_S", default_value_t = 0.0, allow_negative_numbers = true)]
    pub velocity: f64,
    /// Flicker of the light, in Hz: 100 or 120 for lamps at the mains
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    pub flicker: Option<f64>,
    /// How much of the light flickers, 0 to 1
    #[arg(
        long,
        value_name = "SHARE",
        default_value_t = 0.1,
        requires = "flicker",
        allow_negative_numbers = true
    )]
    pub flicker_depth: f64,
    /// The lens position at which the scene is sharp, in counts (220 to 3750); drawn from the seed if left out
    #[arg(long, value_name = "POSITION", value_parser = position, allow_negative_numbers = true)]
    pub focus: Option<f64>,
    /// A worn lens: backlash of 15 counts, overshoot, uneven speed, noisy and late positions
    #[arg(long)]
    pub worn_lens: bool,
    /// Every random choice follows from this number [default: $EVFOCUS_SIM_SEED, else 1]
    #[arg(long, value_name = "NUMBER")]
    seed: Option<u64>,
}

impl RigArguments {
    /// The seed given, that of the environment, or 1.
    pub fn seed(&self) -> anyhow::Result<u64> {
        match (self.seed, std::env::var(SEED_VARIABLE)) {
            (Some(seed), _) => Ok(seed),
            (None, Ok(text)) => text.trim().parse().map_err(|_| {
                UsageError(format!("{SEED_VARIABLE} is {text:?}; it must be a whole number")).into()
            }),
            (None, Err(_)) => Ok(1),
        }
    }

    /// The rig that the options describe, before `default_scene` if they name none.
    pub fn rig(&self, default_scene: Scene) -> anyhow::Result<RigConfig> {
        let seed = self.seed()?;
        let mut rig = RigConfig::preset(self.camera, self.light);
        rig.scene = self.scene.unwrap_or(default_scene);
        rig.motion = MotionConfig {
            shake_px_rms: self.shake,
            roll_rad_rms: ROLL_RAD_PER_PX * self.shake,
            velocity_px_per_s: (self.velocity, 0.0),
            ..MotionConfig::default()
        };
        rig.flicker = self.flicker.map(|hertz| Flicker { hertz, depth: self.flicker_depth });
        if self.worn_lens {
            rig.lens = LensConfig::worn();
        }
        let range = rig.lens.range;
        let drawn = range.min().0 + range.length() * (0.25 + 0.5 * share(seed));
        rig.focus = LensPosition(self.focus.unwrap_or(drawn.round()));
        let second = rig.focus.0 + 0.2 * range.length();
        rig.second_focus = range.clamp(LensPosition(second));
        rig.seed = seed;
        rig.validate().map_err(|error| UsageError(format!("no such rig: {error}")))?;
        Ok(rig)
    }
}

fn shake(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if (0.0..=GREATEST_SHAKE_PX).contains(&value) => Ok(value),
        _ => Err(format!("{text:?} is not a number of pixels RMS from 0 to {GREATEST_SHAKE_PX}")),
    }
}

/// A number from 0 to 1 that follows from `seed` (SplitMix64's output function): neighbouring seeds give unlike numbers.
fn share(seed: u64) -> f64 {
    let mut bits = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (bits ^ (bits >> 31)) as f64 / u64::MAX as f64
}
