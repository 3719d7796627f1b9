//! Sequences from the simulated rig, shaped like the paper's data set: seven scenes, each in light and dark, still and shaken.
//!
//! A sweep goes from 220 to 3750 in 2 s. Focus lies in another 28th of the middle three quarters of the range in each sequence; the blur
//! grows by 0.015 to 0.03 px a count; a hand shakes by 1.5 to 3 px RMS. All of it follows from [`SEED`].

use std::path::Path;
use std::time::Duration;

use evfocus_core::{Events, HostMicros, LensPosition, LensSpeed};
use evfocus_record::Evt3Writer;
use hil_sim::{CameraModel, Light, MotionConfig, Rig, RigConfig, Scene, SensorConfig};
use rand::RngExt;
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

use super::sweep_files::{Truth, read, write_beside};
use super::{Condition, Dataset, Entry, Label, Sequence, Source, Unit};
use crate::cache::Cache;
use crate::frames::{FrameCamera, FrameConfig};
use crate::simulated_sweep::{SweepObserver, SweepPlan, Ways};

/// What all random choices follow from.
pub const SEED: u64 = 2022;
/// Part of every key: to be raised when the simulator makes other events from the same configuration.
const GENERATION: u32 = 1;
/// Share of the range, at either end, in which there is no focus.
const MARGIN: f64 = 0.125;
/// A hand that shakes by 2 px rolls by 3 mrad.
const ROLL_RAD_PER_PX: f64 = 0.0015;

/// The scenes, with what tells two pictures of one kind apart.
const SCENES: [(&str, Scene, u64); 7] = [
    ("text", Scene::Text, 1),
    ("siemens_star", Scene::SiemensStar, 2),
    ("leaves", Scene::DeadLeaves, 3),
    ("pink_noise", Scene::PinkNoise, 4),
    ("checker", Scene::Checker, 5),
    ("leaves_again", Scene::DeadLeaves, 6),
    ("page", Scene::Text, 7),
];

/// How to make a sequence.
#[derive(Debug, Clone, PartialEq)]
pub struct Recipe {
    /// The rig and the sweep.
    pub sweep: SweepPlan,
    /// The frame camera.
    pub frames: FrameConfig,
}

impl Recipe {
    /// The paper's sweep before `scene`: the whole range in 2 s, between rests of 60 ms.
    pub fn new(scene: Scene, condition: Condition, focus: f64, seed: u64) -> Self {
        let light = condition.light();
        let mut draw = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut rig = RigConfig::preset(CameraModel::Davis346, light);
        rig.scene = scene;
        rig.focus = rig.lens.range.clamp(LensPosition(focus.round()));
        rig.seed = seed;
        rig.optics.blur_px_per_count = draw.random_range(0.015..0.03);
        let shake = draw.random_range(1.5..3.0);
        if condition.is_shaken() {
            rig.motion = shaken_by(shake);
        }
        let speed = rig.lens.max_speed;
        let sweep = SweepPlan { rig, speed, ways: Ways::Up, rest: Duration::from_millis(60) };
        Self { sweep, frames: FrameConfig::davis346(light) }
    }

    fn entry(self, name: String, condition: Condition) -> Entry {
        let label = Label { name, condition: Some(condition), stress: None, unit: Unit::Counts };
        Entry { label, source: Source::Simulated(Box::new(self)) }
    }

    /// What the result follows from, in words.
    pub(crate) fn key(&self) -> String {
        format!("{GENERATION} {self:?}")
    }

    /// The sequence, from the cache if it was made before.
    pub(crate) fn load(&self, cache: &Cache) -> anyhow::Result<Sequence> {
        let recording = |folder: &Path| folder.join("sweep.raw");
        let folder = cache.sweep_folder(&self.key(), |folder| self.write(&recording(folder)))?;
        read(&recording(&folder))
    }

    fn write(&self, recording: &Path) -> anyhow::Result<()> {
        let geometry = self.sweep.rig.sensor.geometry;
        let mut observer = Observer {
            recording: Evt3Writer::create(recording, geometry)?,
            camera: FrameCamera::new(self.frames, geometry, self.sweep.rig.seed)?,
        };
        let made = self.sweep.simulate(&mut observer)?;
        observer.recording.advance(made.end)?;
        observer.recording.finish()?;
        let positions = made.rig.truth().iter().map(|position| position.0).collect();
        let truth = Truth::of(positions, made.events);
        write_beside(recording, &made.trace, truth, &observer.camera.into_frames())
    }
}

/// A hand that shakes the camera by `pixels` RMS.
pub(super) fn shaken_by(pixels: f64) -> MotionConfig {
    MotionConfig { shake_px_rms: pixels, roll_rad_rms: ROLL_RAD_PER_PX * pixels, ..MotionConfig::default() }
}

/// The speed at which the sweep takes `seconds`, or the default one if that is none.
pub(super) fn speed_of(rig: &RigConfig, seconds: f64) -> LensSpeed {
    LensSpeed::new(rig.lens.range.length() / seconds).unwrap_or(rig.lens.max_speed)
}

struct Observer {
    recording: Evt3Writer,
    camera: FrameCamera,
}

impl SweepObserver for Observer {
    fn events(&mut self, events: Events<'_>) -> anyhow::Result<()> {
        Ok(self.recording.write(events.iter())?)
    }

    fn passed(&mut self, now: HostMicros, rig: &Rig) -> anyhow::Result<()> {
        self.camera.take_until(now, rig);
        Ok(())
    }
}

/// Changes a sensor for the light given.
type Sensor = fn(Light, usize) -> SensorConfig;

/// The 28 sequences.
pub fn dataset() -> Dataset {
    let about = String::from(
        "simulated, shaped like the paper's data set: 7 scenes, light and dark, static and dynamic",
    );
    shaped_like_the_papers("simulated", about, |light, _| SensorConfig::preset(CameraModel::Davis346, light))
}

/// The same with the pixel models of other simulators, of which each has every other sequence: what fits our pixels alone shows.
pub fn foreign() -> Dataset {
    let about = String::from(
        "the same scenes before pixels that work like those of v2e and IEBCS, two public simulators, in turns",
    );
    shaped_like_the_papers("foreign", about, |light, index| {
        if index % 2 == 0 { SensorConfig::v2e_like(light) } else { SensorConfig::iebcs_like(light) }
    })
}

fn shaped_like_the_papers(name: &str, about: String, sensor: Sensor) -> Dataset {
    let range = RigConfig::default().lens.range;
    let number = SCENES.len() * Condition::ALL.len();
    let mut entries = Vec::with_capacity(number);
    for (scene_index, (scene_name, scene, picture)) in SCENES.into_iter().enumerate() {
        for (index, condition) in Condition::ALL.into_iter().enumerate() {
            // 11 and 28 have no common factor: every 28th of the range once, neighbours far apart.
            let place = (11 * (scene_index * Condition::ALL.len() + index)) % number;
            let share = MARGIN + (1.0 - 2.0 * MARGIN) * (place as f64 + 0.5) / number as f64;
            let focus = range.min().0 + share * range.length();
            let mut recipe = Recipe::new(scene, condition, focus, SEED + 100 * picture + index as u64);
            recipe.sweep.rig.sensor = sensor(condition.light(), scene_index);
            entries.push(
                recipe.entry(format!("{scene_name}_{}", condition.title().replace(' ', "_")), condition),
            );
        }
    }
    // A rig has one kind of pixels: where they change from sequence to sequence nothing can be learnt.
    let is_one_rig = sensor(Light::Light, 0) == sensor(Light::Light, 1);
    let teachers = if is_one_rig { teachers(sensor) } else { Vec::new() };
    Dataset { teachers, ..Dataset::untaught(name, about, entries) }
}

/// Sweeps both ways before scenes that are not among those judged.
fn teachers(sensor: Sensor) -> Vec<Entry> {
    let mut teachers = Vec::new();
    for (index, scene) in [Scene::Foliage, Scene::Buildings].into_iter().enumerate() {
        for condition in Condition::ALL {
            let seed = SEED + 5_000 + 10 * index as u64 + condition as u64;
            let mut recipe = Recipe::new(scene, condition, 1800.0, seed);
            recipe.sweep.rig.sensor = sensor(condition.light(), 0);
            recipe.sweep.ways = Ways::UpAndDown;
            teachers.push(recipe.entry(format!("teacher_{scene}_{}", condition.title()), condition));
        }
    }
    teachers
}
