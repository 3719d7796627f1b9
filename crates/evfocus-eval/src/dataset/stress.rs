//! Sweeps with one thing wrong, or more difficult, at a time.

use std::time::Duration;

use evfocus_core::LensPosition;
use hil_sim::{FanConfig, Flicker, LensConfig, PatchNoise, RateCap, Scene};

use super::simulated::{Recipe, SEED, shaken_by, speed_of};
use super::{Condition, Dataset, Entry, Label, Source, Unit};
use crate::simulated_sweep::Ways;

/// Makes an ordinary sweep a difficult one.
type Change = fn(&mut Recipe);

/// What is done to an ordinary sweep. A line each; the simulator knows what they mean.
const STRESSES: [(&str, Change); 28] = [
    ("none", |_| {}),
    ("flicker, 100 Hz", |it| it.sweep.rig.flicker = Some(Flicker { hertz: 100.0, depth: 0.08 })),
    ("two depths", |it| it.sweep.rig.scene = Scene::TwoDepths),
    ("low contrast", |it| thresholds(it, 0.45, 0.45)),
    ("stars", |it| it.sweep.rig.scene = Scene::StarField),
    ("reversed motor", |it| it.sweep.ways = Ways::Down),
    ("rippling motor", |it| it.sweep.rig.lens.speed_ripple = 0.3),
    ("sticking motor", |it| it.sweep.rig.lens.stick_slip = 0.6),
    ("fast sweep, 0.7 s", |it| it.sweep.speed = speed_of(&it.sweep.rig, 0.7)),
    ("backlash, 40 counts", |it| it.sweep.rig.lens.backlash = 40.0),
    ("late positions, 15 ms", |it| it.sweep.rig.lens.read_lag = Duration::from_millis(15)),
    ("peak near the start", |it| focus_at(it, 0.07)),
    ("peak near the end", |it| focus_at(it, 0.93)),
    ("very dark", very_dark),
    ("violent shake", |it| it.sweep.rig.motion = shaken_by(7.0)),
    ("scene that moves", |it| it.sweep.rig.motion.velocity_px_per_s = (60.0, 0.0)),
    ("breathing", |it| it.sweep.rig.optics.breathing = 0.04),
    ("aberration", |it| it.sweep.rig.optics.slope_ratio = 1.15),
    ("saturated read-out", |it| it.sweep.rig.sensor.readout_events_per_s = 200_000.0),
    ("hot pixels", |it| it.sweep.rig.sensor.hot_pixels = 300),
    ("unequal thresholds", |it| thresholds(it, 0.15, 0.3)),
    ("both directions", |it| it.sweep.ways = Ways::UpAndDown),
    ("both directions, worn lens", |it| {
        it.sweep.ways = Ways::UpAndDown;
        it.sweep.rig.lens = LensConfig::worn();
    }),
    ("low texture", |it| it.sweep.rig.scene = Scene::LowTexture),
    ("accelerating motor", |it| it.sweep.rig.lens.speed_drift = 0.5),
    ("fan in the picture", |it| it.sweep.rig.fan = Some(FanConfig::default())),
    ("rate cap", |it| it.sweep.rig.sensor.rate_cap = Some(RateCap::at_rate(200_000.0))),
    ("noise in patches", |it| {
        it.sweep.rig.sensor.patch_noise = Some(PatchNoise { events_hz: 1.0, patch_px: 4 });
    }),
];

/// Conditions in which each stress is tried, and where focus is then, as a share of the range.
const TRIED: [(Condition, f64); 4] = [
    (Condition::LightStatic, 0.37),
    (Condition::LightDynamic, 0.62),
    (Condition::DarkStatic, 0.56),
    (Condition::DarkDynamic, 0.41),
];

fn thresholds(recipe: &mut Recipe, on: f64, off: f64) {
    (recipe.sweep.rig.sensor.on_threshold, recipe.sweep.rig.sensor.off_threshold) = (on, off);
}

fn very_dark(recipe: &mut Recipe) {
    let sensor = &mut recipe.sweep.rig.sensor;
    sensor.cutoff_hz *= 0.3;
    sensor.shot_noise_black_hz *= 2.0;
    sensor.shot_noise_white_hz *= 2.0;
    recipe.frames.gain *= 0.3;
}

fn focus_at(recipe: &mut Recipe, share: f64) {
    let range = recipe.sweep.rig.lens.range;
    recipe.sweep.rig.focus = LensPosition((range.min().0 + share * range.length()).round());
}

/// The stress suite: every stress in every condition, before dead leaves.
pub fn stress_suite() -> Dataset {
    let mut entries = Vec::with_capacity(STRESSES.len() * TRIED.len());
    for (stress_index, (stress, change)) in STRESSES.into_iter().enumerate() {
        for (index, (condition, share)) in TRIED.into_iter().enumerate() {
            let seed = SEED + 10_000 + 10 * stress_index as u64 + index as u64;
            let mut recipe = Recipe::new(Scene::DeadLeaves, condition, 0.0, seed);
            focus_at(&mut recipe, share);
            recipe.sweep.rig.second_focus = LensPosition(recipe.sweep.rig.focus.0 + 900.0);
            change(&mut recipe);
            let name = format!("{stress}, {}", condition.title());
            let label = Label {
                name,
                condition: Some(condition),
                stress: Some(stress.to_owned()),
                unit: Unit::Counts,
            };
            entries.push(Entry { label, source: Source::Simulated(Box::new(recipe)) });
        }
    }
    let about =
        String::from("simulated, with one thing wrong or more difficult at a time; each in four conditions");
    Dataset::untaught("stress", about, entries)
}
