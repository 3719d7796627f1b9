//! Which rig, which commands, and what goes wrong when: drawn from a seed.

use std::time::Duration;

use anyhow::{Context, Result};
use evfocus_core::controller::{Command, FocusRequest, Mode, Pace, Pause};
use evfocus_core::{Directions, Geometry, LensPosition, LensRange, LensSpeed, Method};
use evfocusd::Config;
use hil_sim::{
    CameraModel, Change, ChangeKind, Fault, FaultKind, FaultTrigger, LensConfig, LensKind, Light,
    MotionConfig, RigConfig, Scene,
};
use rand::seq::IndexedRandom;
use rand::{Rng, RngExt};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

use super::devices::Spell;
use super::mishap::Mishap;
use super::{LAST_FAULT, Trial, at};

/// Small enough for thousands of runs, large enough for focus.
pub(super) const GEOMETRY: Geometry = Geometry { width: 48, height: 36 };
/// The rig takes a second to start.
const FIRST_FAULT: Duration = Duration::from_millis(1100);
/// When the run is triggered.
const TRIGGER: Duration = Duration::from_millis(1500);
/// The longest that a process gets no time.
const LONGEST_FAST: f64 = 3.0;
/// Steps of the disk in a trial: some seven for each of three files, for each of the first few runs.
const DISK_STEPS: u32 = 40;

impl Trial {
    /// The trial that follows from `seed`.
    ///
    /// # Errors
    /// None that is not a fault of this file.
    pub fn draw(seed: u64) -> Result<Self> {
        let draw = &mut Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut config = Config::simulated()?;
        config.rig = rig(draw, seed);
        config.focus.fewest_events = Some(100);
        config.focus.events_kept = Some(400_000);
        config.focus.longest_sweep_s = Some(6.0);
        let request = FocusRequest { pace: Pace::ALL.choose(draw).copied(), ..FocusRequest::default() };
        let mut trial = Self::of(seed, config, request);
        if draw.random_bool(0.25) {
            trial.make_continuous(draw);
        }
        for _ in 0..draw.random_range(0..=3) {
            let mishap = Mishap::ALL.choose(draw).copied().context("there are mishaps")?;
            trial.add(mishap, draw);
        }
        trial.commands.push((at(TRIGGER), Command::Focus(trial.request)));
        trial.commands.sort_by_key(|(time, _)| *time);
        trial.starved.sort_by_key(|(time, _)| *time);
        Ok(trial)
    }

    /// Continuous mode is on, something happens to the scene, and clients pause and go on.
    fn make_continuous(&mut self, draw: &mut impl Rng) {
        self.is_continuous = true;
        let watch = &mut self.config.continuous;
        watch.patience = Duration::from_secs_f64(draw.random_range(0.2..1.0));
        watch.learning = Duration::from_secs_f64(draw.random_range(0.2..1.0));
        watch.rest = Duration::from_secs_f64(draw.random_range(0.2..2.0));
        self.config.rig.motion = MotionConfig::moving(draw.random_range(10.0..60.0));
        if draw.random_bool(0.7) {
            let after = moment(draw) + Duration::from_secs(4);
            let kind = ChangeKind::Focus { by: draw.random_range(-800.0..800.0) };
            self.config.rig.changes.push(Change { after, kind });
        }
        for _ in 0..draw.random_range(0..4) {
            self.commands.push((at(moment(draw)), Command::Pause(pause(draw))));
        }
    }

    fn add(&mut self, mishap: Mishap, draw: &mut impl Rng) {
        self.mishaps.insert(mishap);
        let mut of_rig = |kind, after| {
            let trigger = FaultTrigger::After(after);
            self.config.rig.faults.push(Fault { kind, trigger });
        };
        match mishap {
            Mishap::Camera(kind) => self.camera.push(spell(kind, draw)),
            Mishap::Lens(kind) => self.lens.push(spell(kind, draw)),
            Mishap::Disk(kind) => self.disk.push(spell(kind, draw)),
            Mishap::ClockReset => of_rig(FaultKind::CameraTimeReset, moment(draw)),
            Mishap::EventLoss => {
                let (share, duration) = (draw.random_range(0.01..1.0), moment(draw));
                of_rig(FaultKind::EventLoss { share, duration }, moment(draw));
            }
            Mishap::LensStalled => of_rig(FaultKind::LensStalled, moment(draw)),
            Mishap::LensLate => {
                let by = Duration::from_millis(draw.random_range(1..500));
                of_rig(FaultKind::LensPositionLate { by }, moment(draw));
            }
            Mishap::Clients => {
                let commands = draw.random_range(1..30);
                self.commands.extend((0..commands).map(|_| (at(moment(draw)), command(draw))));
            }
            Mishap::Starved => {
                let length = LONGEST_FAST * 10_f64.powf(draw.random_range(-2.5..0.0));
                self.starved.push((at(moment(draw)), Duration::from_secs_f64(length)));
            }
            Mishap::Killed => self.killed = Some(at(moment(draw))),
            Mishap::DiesWriting(death) => self.death = Some((draw.random_range(1..=DISK_STEPS), death)),
        }
    }
}

fn moment(draw: &mut impl Rng) -> Duration {
    draw.random_range(FIRST_FAULT..LAST_FAULT)
}

fn spell<Kind>(kind: Kind, draw: &mut impl Rng) -> Spell<Kind> {
    let from = moment(draw);
    // From a hiccup to an absence that outlasts every time-out.
    let length = Duration::from_secs_f64(10_f64.powf(draw.random_range(-2.0..0.8)));
    Spell { kind, from: at(from), until: at(from + length) }
}

fn rig(draw: &mut impl Rng, seed: u64) -> RigConfig {
    const SCENES: [Scene; 4] = [Scene::DeadLeaves, Scene::Text, Scene::Checker, Scene::BlankWall];
    const LENSES: [LensKind; 5] =
        [LensKind::Good, LensKind::Worn, LensKind::Accelerating, LensKind::Rippling, LensKind::Sticking];
    let mut rig = RigConfig::preset(CameraModel::Davis346, Light::Light);
    rig.sensor.geometry = GEOMETRY;
    rig.scene = SCENES.choose(draw).copied().unwrap_or(Scene::DeadLeaves);
    rig.lens = LensConfig::from(LENSES.choose(draw).copied().unwrap_or(LensKind::Good));
    rig.lens.needs_homing = draw.random_bool(0.2);
    if let Ok(speed) = LensSpeed::new(draw.random_range(1500.0..4000.0)) {
        rig.lens.max_speed = speed;
    }
    let (low, length) = (rig.lens.range.min().0, rig.lens.range.length());
    rig.focus = LensPosition((low + draw.random_range(0.1..0.9) * length).round());
    rig.lens.start = LensPosition((low + draw.random_range(0.0..1.0) * length).round());
    if draw.random_bool(0.3) {
        rig.motion = MotionConfig::fixed_rig();
    }
    rig.seed = seed;
    rig
}

/// What a client may come upon, sense or nonsense.
fn command(draw: &mut impl Rng) -> Command {
    match draw.random_range(0..13) {
        0..4 => Command::Focus(request(draw)),
        4 => Command::Abort,
        5 => Command::SetMode(Mode::Manual),
        6 | 7 => Command::SetMode(Mode::Auto),
        8 => Command::SetMode(Mode::Continuous),
        9 | 10 => Command::Pause(pause(draw)),
        _ => Command::MoveTo(LensPosition(match draw.random_range(0..6) {
            0 => f64::NAN,
            1 => f64::INFINITY,
            2 => -1e300,
            _ => draw.random_range(0.0..4000.0),
        })),
    }
}

fn pause(draw: &mut impl Rng) -> Pause {
    [Pause::Immediate, Pause::Deferred, Pause::Resume].choose(draw).copied().unwrap_or(Pause::Resume)
}

fn request(draw: &mut impl Rng) -> FocusRequest {
    let ends = [draw.random_range(0.0..4000.0), draw.random_range(0.0..4000.0)];
    FocusRequest {
        method: if draw.random_bool(0.3) { Method::ALL.choose(draw).copied() } else { None },
        interval: draw.random_bool(0.2).then(|| Duration::from_micros(draw.random_range(0..1_000_000))),
        range: draw
            .random_bool(0.3)
            .then(|| LensRange::new(LensPosition(ends[0]), LensPosition(ends[1])).ok())
            .flatten(),
        speed: draw.random_bool(0.2).then(|| LensSpeed::new(draw.random_range(1.0..5000.0)).ok()).flatten(),
        pace: Pace::ALL.choose(draw).copied(),
        directions: draw.random_bool(0.2).then_some(Directions::Forward),
        ..FocusRequest::default()
    }
}
