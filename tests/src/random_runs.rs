//! Whole focus runs over random rigs in virtual time, and the verdict on each.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use anyhow::{Context, Result};
use evfocus_core::controller::{Command, FocusRequest, FocusState, Mode, Pace};
use evfocus_core::{Geometry, LensPosition, LensSpeed, Outcome, RunReport};
use evfocusd::{Config, VirtualRig};
use hil_sim::{
    CameraModel, FanConfig, Fault, FaultKind, FaultTrigger, Flicker, LensConfig, LensKind, Light,
    MotionConfig, RigConfig, Scene, SensorConfig,
};
use rand::seq::IndexedRandom;
use rand::{Rng, RngExt};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

/// The size of a DAVIS240.
const GEOMETRY: Geometry = Geometry { width: 240, height: 180 };
/// A run that takes longer than this hangs, virtual time.
const LONGEST_RUN: Duration = Duration::from_secs(60);

/// What stands in the way of focus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Hindrance {
    /// Nothing.
    None,
    /// Nothing to focus on is in view.
    BlankWall,
    /// Focus lies so near to an end of the lens's range that its peak is cut off.
    Edge,
    /// The lens does not move, or stops on its way.
    LensStalled,
    /// The lens is unplugged in mid-sweep.
    LensUnplugged,
    /// The lens falls silent in mid-sweep.
    LensSilent,
    /// Positions are 300 ms late.
    LatePositions,
    /// The camera is unplugged in mid-sweep.
    CameraUnplugged,
    /// The camera's clock starts anew in mid-sweep.
    ClockReset,
    /// A third of the events is lost.
    EventsLost,
    /// The read-out is slower than the scene.
    Saturated,
    /// The lamps flicker.
    Flicker,
}

impl Hindrance {
    const PLANTED: [Self; 11] = [
        Self::BlankWall,
        Self::Edge,
        Self::LensStalled,
        Self::LensUnplugged,
        Self::LensSilent,
        Self::LatePositions,
        Self::CameraUnplugged,
        Self::ClockReset,
        Self::EventsLost,
        Self::Saturated,
        Self::Flicker,
    ];

    /// Words for a table.
    pub fn title(self) -> &'static str {
        match self {
            Self::None => "nothing",
            Self::BlankWall => "a blank wall",
            Self::Edge => "focus at an end of the range",
            Self::LensStalled => "the lens does not move",
            Self::LensUnplugged => "the lens is unplugged",
            Self::LensSilent => "the lens falls silent",
            Self::LatePositions => "positions 300 ms late",
            Self::CameraUnplugged => "the camera is unplugged",
            Self::ClockReset => "the camera's clock starts anew",
            Self::EventsLost => "a third of the events is lost",
            Self::Saturated => "a slow read-out",
            Self::Flicker => "lamps that flicker",
        }
    }

    /// The reasons that tell the user of it.
    fn reasons(self) -> &'static [&'static str] {
        match self {
            Self::None => &[],
            Self::BlankWall => &["flat", "too-few-events", "weak", "unsure"],
            Self::Edge => &["peak-at-edge"],
            Self::LensStalled => &["lens-not-moving", "lens-stopped-short"],
            Self::LensUnplugged => &["lens-lost"],
            Self::LensSilent => &["lens-silent"],
            Self::LatePositions => {
                &["direction-mismatch", "lens-overshoot", "lens-stopped-short", "peak-at-edge"]
            }
            Self::CameraUnplugged => &["camera-lost"],
            Self::ClockReset => &["clock-unusable"],
            Self::EventsLost => &["events-lost"],
            Self::Saturated => &["saturated", "events-lost"],
            Self::Flicker => &["flicker", "saturated", "events-lost"],
        }
    }
}

/// What a scene may be too poor for, with nothing planted in the way: reasons that speak of the scene, not of the rig.
const OF_THE_SCENE: [&str; 5] = ["weak", "unsure", "too-few-events", "flat", "direction-mismatch"];

/// A run to be made.
#[derive(Debug, Clone)]
pub struct Trial {
    /// Rig and settings.
    pub config: Config,
    /// What is asked for.
    pub request: FocusRequest,
    /// What stands in the way.
    pub hindrance: Hindrance,
    /// Whether nobody asks, and the run starts by itself.
    pub is_continuous: bool,
}

fn pick<T: Copy>(draw: &mut impl Rng, of: &[T], otherwise: T) -> T {
    of.choose(draw).copied().unwrap_or(otherwise)
}

impl Trial {
    /// The trial that follows from `seed`.
    ///
    /// # Errors
    /// None that is not a fault of this file.
    pub fn draw(seed: u64) -> Result<Self> {
        let draw = &mut Xoshiro256PlusPlus::seed_from_u64(seed);
        let hindrance = if draw.random_bool(0.3) {
            pick(draw, &Hindrance::PLANTED, Hindrance::None)
        } else {
            Hindrance::None
        };
        let mut config = Config::simulated()?;
        config.rig = rig(draw, seed);
        // One way there is nothing to hold late positions against.
        let paces: &[Pace] =
            if hindrance == Hindrance::LatePositions { &[Pace::Normal, Pace::Accurate] } else { &Pace::ALL };
        let request = FocusRequest { pace: Some(pick(draw, paces, Pace::Normal)), ..FocusRequest::default() };
        plant(hindrance, &mut config, draw);
        Ok(Self { config, request, hindrance, is_continuous: false })
    }

    /// The same in continuous mode, where a run is made as configured.
    #[must_use]
    pub fn in_continuous_mode(self) -> Self {
        Self { request: FocusRequest::default(), is_continuous: true, ..self }
    }

    /// Makes the run.
    ///
    /// # Errors
    /// A rig that is refused, or a run that does not end.
    pub fn run(&self) -> Result<Ended> {
        let mut rig = VirtualRig::new(&self.config)?;
        if self.is_continuous {
            rig.command(Command::SetMode(Mode::Continuous))?;
            rig.step();
        } else {
            rig.command(Command::Focus(self.request))?;
        }
        let latest = rig.now() + LONGEST_RUN;
        while rig.controller().snapshot().state == FocusState::Scanning {
            anyhow::ensure!(rig.now() < latest, "the run hangs: {:?}", rig.controller().snapshot());
            rig.step();
        }
        let report = rig.controller().report().context("a run that ended has a report")?.clone();
        let truth = rig.truth();
        let error = |position: LensPosition| {
            let errors = truth.iter().map(|&truth| position.counts_from(truth));
            errors.min_by(|a, b| a.abs().total_cmp(&b.abs()))
        };
        let answer = report.answer;
        let error = answer.and_then(|answer| error(answer.position));
        let optics = &self.config.rig.optics;
        Ok(Ended { error, depth_of_focus: 1.0 / optics.blur_px_per_count, report })
    }
}

fn rig(draw: &mut impl Rng, seed: u64) -> RigConfig {
    const SCENES: [Scene; 10] = [
        Scene::Text,
        Scene::SiemensStar,
        Scene::DeadLeaves,
        Scene::PinkNoise,
        Scene::StarField,
        Scene::Checker,
        Scene::Foliage,
        Scene::Buildings,
        Scene::LowTexture,
        Scene::TwoDepths,
    ];
    const LENSES: [LensKind; 5] =
        [LensKind::Good, LensKind::Worn, LensKind::Accelerating, LensKind::Rippling, LensKind::Sticking];
    let light = pick(draw, &[Light::Light, Light::Dark], Light::Light);
    let mut rig = RigConfig::preset(CameraModel::Davis346, light);
    rig.sensor = match draw.random_range(0..3) {
        0 => rig.sensor,
        1 => SensorConfig::v2e_like(light),
        _ => SensorConfig::iebcs_like(light),
    };
    // Half the pixels of a DAVIS346: twice as many runs in the same time.
    rig.sensor.geometry = GEOMETRY;
    if draw.random_bool(0.2) {
        (rig.sensor.on_threshold, rig.sensor.off_threshold) = (0.15, 0.25);
    }
    if draw.random_bool(0.2) {
        rig.sensor.hot_pixels = draw.random_range(1..80);
    }
    rig.scene = pick(draw, &SCENES, Scene::DeadLeaves);
    rig.lens = LensConfig::from(pick(draw, &LENSES, LensKind::Good));
    if let Ok(speed) = LensSpeed::new(draw.random_range(900.0..3000.0)) {
        rig.lens.max_speed = speed;
    }
    let length = rig.lens.range.length();
    let at = |share: f64| LensPosition((rig.lens.range.min().0 + share * length).round());
    rig.focus = at(draw.random_range(0.17..0.83));
    rig.second_focus = if rig.focus > at(0.5) { at(0.2) } else { at(0.8) };
    rig.lens.start = at(draw.random_range(0.0..1.0));
    rig.optics.blur_px_per_count = draw.random_range(0.015..0.04);
    rig.optics.breathing = draw.random_range(-0.02..0.02);
    rig.motion = match draw.random_range(0..10) {
        0..5 => MotionConfig::default(),
        5 => MotionConfig::fixed_rig(),
        6 => MotionConfig::moving(draw.random_range(10.0..60.0)),
        7 | 8 => shaken(draw.random_range(1.0..3.0)),
        _ => shaken(draw.random_range(3.0..7.0)),
    };
    if draw.random_bool(0.1) {
        rig.fan = Some(FanConfig::default());
    }
    rig.seed = seed;
    rig
}

fn shaken(pixels: f64) -> MotionConfig {
    MotionConfig { shake_px_rms: pixels, roll_rad_rms: 0.0015 * pixels, ..MotionConfig::default() }
}

fn plant(hindrance: Hindrance, config: &mut Config, draw: &mut impl Rng) {
    let rig = &mut config.rig;
    let (low, length) = (rig.lens.range.min().0, rig.lens.range.length());
    // Faults strike before the early stop of any pace, while the lens is on its way to focus.
    let share = (rig.focus.0.min(rig.second_focus.0) - low) / length;
    let on_the_way = LensPosition(low + draw.random_range(0.3..0.9) * share * length);
    let mut fault = |kind| rig.faults.push(Fault { kind, trigger: FaultTrigger::AtPosition(on_the_way) });
    rig.lens.start = match hindrance {
        // The lens passes the place in the sweep, not on its way to the start.
        Hindrance::LensStalled
        | Hindrance::LensUnplugged
        | Hindrance::LensSilent
        | Hindrance::CameraUnplugged
        | Hindrance::ClockReset
        | Hindrance::EventsLost => rig.lens.range.min(),
        Hindrance::None
        | Hindrance::BlankWall
        | Hindrance::Edge
        | Hindrance::LatePositions
        | Hindrance::Saturated
        | Hindrance::Flicker => rig.lens.start,
    };
    match hindrance {
        Hindrance::None => {}
        Hindrance::BlankWall => rig.scene = Scene::BlankWall,
        Hindrance::Edge => {
            let share = draw.random_range(0.0..0.05);
            let share = if draw.random_bool(0.5) { share } else { 1.0 - share };
            rig.focus = LensPosition((low + share * length).round());
            rig.second_focus = rig.focus;
        }
        Hindrance::LensStalled => fault(FaultKind::LensStalled),
        Hindrance::LensUnplugged => fault(FaultKind::LensUnplugged),
        Hindrance::LensSilent => fault(FaultKind::LensSilent),
        Hindrance::LatePositions => {
            rig.faults.push(Fault {
                kind: FaultKind::LensPositionLate { by: Duration::from_millis(300) },
                trigger: FaultTrigger::After(Duration::from_millis(900)),
            });
        }
        Hindrance::CameraUnplugged => fault(FaultKind::CameraUnplugged),
        Hindrance::ClockReset => fault(FaultKind::CameraTimeReset),
        Hindrance::EventsLost => {
            fault(FaultKind::EventLoss { share: 0.33, duration: Duration::from_secs(20) });
        }
        Hindrance::Saturated => {
            rig.motion = shaken(3.0);
            rig.sensor.readout_events_per_s = 100_000.0;
            rig.sensor.readout_queue = 4096;
        }
        Hindrance::Flicker => {
            rig.flicker = Some(Flicker { hertz: pick(draw, &[100.0, 120.0], 100.0), depth: 0.5 });
            rig.sensor.cutoff_hz = 1000.0;
        }
    }
}

/// A run that was made.
#[derive(Debug, Clone)]
pub struct Ended {
    /// The record.
    pub report: RunReport,
    /// Answer less truth, counts; `None` without an answer.
    pub error: Option<f64>,
    /// Counts from focus at which the blur circle is a pixel wide.
    pub depth_of_focus: f64,
}

/// How a run is to be judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// Focused, to within the depth of focus or 1 % of the range.
    Focused,
    /// Farther off, but no farther than three error bars, and with a confidence below 0.9.
    SaidToBeUncertain,
    /// Failed, with a reason that tells of what stood in the way.
    FailedRightly,
    /// Failed with a reason that speaks of the scene, whatever was planted.
    GaveUp,
    /// Off by more than three error bars.
    Wrong,
    /// Failed with a reason that misleads.
    Misled,
}

impl Verdict {
    /// Every verdict.
    pub const ALL: [Self; 6] = [
        Self::Focused,
        Self::SaidToBeUncertain,
        Self::FailedRightly,
        Self::GaveUp,
        Self::Wrong,
        Self::Misled,
    ];

    /// Words for a table.
    pub fn title(self) -> &'static str {
        match self {
            Self::Focused => "focused",
            Self::SaidToBeUncertain => "farther off, and said so",
            Self::FailedRightly => "failed, right reason",
            Self::GaveUp => "gave up on the scene",
            Self::Wrong => "off by more than three error bars",
            Self::Misled => "failed, misleading reason",
        }
    }
}

/// Part of the range of 3530 counts within which an answer is right.
const TOLERANCE_SHARE: f64 = 0.01;

impl Ended {
    /// The verdict on the run of `trial`.
    pub fn verdict(&self, trial: &Trial) -> Verdict {
        match self.report.outcome {
            Outcome::Focused { .. } => self.verdict_on_focus(trial),
            Outcome::Failed(failure) if trial.hindrance.reasons().contains(&failure.name()) => {
                Verdict::FailedRightly
            }
            // A dark, shaken or nearly empty scene is no easier for a hindrance beside it.
            Outcome::Failed(failure) if OF_THE_SCENE.contains(&failure.name()) => Verdict::GaveUp,
            Outcome::Failed(_) | Outcome::Aborted => Verdict::Misled,
        }
    }

    fn verdict_on_focus(&self, trial: &Trial) -> Verdict {
        let tolerance = self.depth_of_focus.max(TOLERANCE_SHARE * trial.config.rig.lens.range.length());
        let answer = self.report.answer;
        let error = self.error.map_or(f64::INFINITY, f64::abs);
        let bar = answer.and_then(|answer| answer.error_bar).unwrap_or(0.0);
        let confidence = answer.and_then(|answer| answer.confidence).unwrap_or(1.0);
        if error <= tolerance {
            Verdict::Focused
        } else if error <= 3.0 * bar && confidence < 0.9 {
            Verdict::SaidToBeUncertain
        } else {
            Verdict::Wrong
        }
    }

    /// The name of the reason, or `focused`.
    pub fn reason(&self) -> &'static str {
        match self.report.outcome {
            Outcome::Focused { .. } => "focused",
            Outcome::Failed(failure) => failure.name(),
            Outcome::Aborted => "aborted",
        }
    }
}

/// Makes the runs of `seeds` on `threads` threads.
///
/// # Errors
/// The first run that could not be made or did not end, with its seed.
pub fn run_all(seeds: &[u64], threads: usize) -> Result<Vec<(u64, Trial, Ended)>> {
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::with_capacity(seeds.len()));
    std::thread::scope(|scope| {
        for _ in 0..threads.max(1) {
            scope.spawn(|| {
                while let Some(&seed) = seeds.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let run = one(seed).with_context(|| format!("the run of seed {seed}"));
                    if let Ok(mut done) = done.lock() {
                        done.push((seed, run));
                    }
                }
            });
        }
    });
    let mut done = done.into_inner().map_err(|_| anyhow::anyhow!("a thread came to grief"))?;
    done.sort_by_key(|(seed, _)| *seed);
    done.into_iter().map(|(seed, run)| run.map(|(trial, ended)| (seed, trial, ended))).collect()
}

/// A panic is an error that names its seed as well.
fn one(seed: u64) -> Result<(Trial, Ended)> {
    let run = std::panic::catch_unwind(|| {
        let trial = Trial::draw(seed)?;
        let ended = trial.run()?;
        Ok((trial, ended))
    });
    run.unwrap_or_else(|_| Err(anyhow::anyhow!("it panicked")))
}
