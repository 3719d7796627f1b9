//! Runs with things going wrong at random moments, in virtual time, and what must hold whatever goes wrong.
//!
//! A trial is the daemon's controller on the simulated rig with a small sensor; between the two stand a camera and a lens that fail as
//! their script says. Clients throw commands in, and the process may be killed and started again. All of it follows from a seed.

pub mod devices;
mod judge;

use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, Result};
use evfocus_core::controller::{Accepted, Command, FocusRequest, Mode, Pace};
use evfocus_core::{Directions, Geometry, HostMicros, LensPosition, LensRange, LensSpeed, Method};
use evfocusd::devices::Devices;
use evfocusd::{Config, VirtualRig};
use hil_sim::{
    CameraModel, Fault, FaultKind, FaultTrigger, LensConfig, LensKind, Light, MotionConfig, RigConfig, Scene,
};
use rand::seq::IndexedRandom;
use rand::{Rng, RngExt};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

use devices::{CameraFault, FaultyCamera, FaultyLens, LensFault, Spell, Witness};
use judge::Judge;

/// Small enough for thousands of runs, large enough for focus.
const GEOMETRY: Geometry = Geometry { width: 48, height: 36 };
/// When the run is triggered, after the second that the rig takes to start.
const TRIGGER: Duration = Duration::from_millis(1500);
/// What the service manager waits before it tries to start the process again.
const RESTART: Duration = Duration::from_secs(2);
/// A fault that ends lasts no longer than this.
const LONGEST_SPELL: Duration = Duration::from_secs(8);
/// Nothing new goes wrong after this.
const LAST_FAULT: Duration = Duration::from_secs(9);

/// What can go wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Mishap {
    /// Of the camera, in front of the simulated one.
    Camera(CameraFault),
    /// Of the lens, in front of the simulated one.
    Lens(LensFault),
    /// The simulated camera's clock starts anew.
    ClockReset,
    /// The link loses events, and says how many.
    EventLoss,
    /// The lens does not move any more.
    LensStalled,
    /// The lens says late where it was.
    LensLate,
    /// Clients throw in commands.
    Clients,
    /// The process is killed and started again.
    Killed,
}

impl Mishap {
    /// Every mishap.
    pub const ALL: [Self; 17] = [
        Self::Camera(CameraFault::Unplugged),
        Self::Camera(CameraFault::Silent),
        Self::Camera(CameraFault::Hiccup),
        Self::Camera(CameraFault::Flood),
        Self::Camera(CameraFault::Lies),
        Self::Camera(CameraFault::ClockRuns),
        Self::Lens(LensFault::Unplugged),
        Self::Lens(LensFault::Silent),
        Self::Lens(LensFault::Garbage),
        Self::Lens(LensFault::Deaf),
        Self::Lens(LensFault::Frozen),
        Self::ClockReset,
        Self::EventLoss,
        Self::LensStalled,
        Self::LensLate,
        Self::Clients,
        Self::Killed,
    ];
}

/// A trial, drawn.
#[derive(Debug, Clone)]
pub struct Trial {
    /// What goes wrong.
    pub mishaps: BTreeSet<Mishap>,
    config: Config,
    request: FocusRequest,
    camera: Vec<Spell<CameraFault>>,
    lens: Vec<Spell<LensFault>>,
    commands: Vec<(HostMicros, Command)>,
    killed: Option<HostMicros>,
}

/// How a trial went.
#[derive(Debug, Clone)]
pub struct Ended {
    /// How each call to focus ended, by `focused`, `aborted`, `killed`, `refused` or the reason.
    pub outcomes: Vec<&'static str>,
    /// The invariants that did not hold, in words.
    pub broken: Vec<String>,
}

fn at(time: Duration) -> HostMicros {
    HostMicros(0) + time
}

fn moment(draw: &mut impl Rng) -> Duration {
    draw.random_range(Duration::from_millis(1100)..LAST_FAULT)
}

fn spell<Kind>(kind: Kind, draw: &mut impl Rng) -> Spell<Kind> {
    let from = moment(draw);
    // From a hiccup to an absence that outlasts every time-out.
    let length = Duration::from_secs_f64(10_f64.powf(draw.random_range(-2.0..0.8)));
    Spell { kind, from: at(from), until: at(from + length) }
}

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
        let mut trial = Self {
            mishaps: BTreeSet::new(),
            config,
            request: FocusRequest { pace: Pace::ALL.choose(draw).copied(), ..FocusRequest::default() },
            camera: Vec::new(),
            lens: Vec::new(),
            commands: vec![],
            killed: None,
        };
        for _ in 0..draw.random_range(0..=3) {
            let mishap = Mishap::ALL.choose(draw).copied().context("there are mishaps")?;
            trial.add(mishap, draw);
        }
        trial.commands.push((at(TRIGGER), Command::Focus(trial.request)));
        trial.commands.sort_by_key(|(time, _)| *time);
        Ok(trial)
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
            Mishap::Killed => self.killed = Some(at(moment(draw))),
        }
    }

    /// Makes the runs and judges them. A panic is a broken invariant.
    ///
    /// # Errors
    /// A rig that is refused, which is a fault of this file.
    pub fn run(&self) -> Result<Ended> {
        match catch_unwind(AssertUnwindSafe(|| self.run_guarded())) {
            Ok(ended) => ended,
            Err(panic) => {
                let words = panic.downcast_ref::<String>().cloned();
                let words = words.or_else(|| panic.downcast_ref::<&str>().map(|words| (*words).to_owned()));
                let broken = vec![format!("a panic: {}", words.unwrap_or_default())];
                Ok(Ended { outcomes: vec!["panicked"], broken })
            }
        }
    }

    fn run_guarded(&self) -> Result<Ended> {
        let mut judge = Judge::default();
        let mut commands = self.commands.iter().peekable();
        let mut life = Life::begin(self, &self.config, HostMicros(0))?;
        let mut killed = self.killed;
        while life.now() < at(LAST_FAULT) || !judge.is_settled() {
            if killed.is_some_and(|moment| life.now() >= moment) {
                killed = None;
                life = life.kill(self, &mut judge)?;
                // Who had called has lost the connection, and calls again.
                judge.command(&mut life.rig, Command::Focus(self.request));
            }
            while let Some((_, command)) = commands.next_if(|(time, _)| *time <= life.now()) {
                judge.command(&mut life.rig, *command);
            }
            life.rig.step();
            judge.watch(&life.rig, &life.witness, life.age);
            if judge.is_hopeless() {
                break;
            }
        }
        judge.count(&life.rig, &life.witness);
        Ok(judge.verdict())
    }
}

/// The life of a process: from a start to a kill or the end.
struct Life {
    rig: VirtualRig,
    witness: Arc<Witness>,
    /// When it began; the rig's own clock begins anew with each.
    age: Duration,
}

impl Life {
    fn begin(trial: &Trial, config: &Config, now: HostMicros) -> Result<Self> {
        let witness = Arc::new(Witness::new(config.rig.lens.range));
        let age = now.since(HostMicros(0));
        let rig = VirtualRig::with_devices(config, |rig, clock| {
            let (camera, lens) = rig.devices();
            let camera = FaultyCamera::new(
                camera,
                shifted(&trial.camera, age),
                Arc::clone(&clock),
                Arc::clone(&witness),
            );
            let lens = FaultyLens::new(lens, shifted(&trial.lens, age), clock, Arc::clone(&witness));
            Ok(Devices { camera: Box::new(camera), lens: Box::new(lens) })
        })?;
        Ok(Self { rig, witness, age })
    }

    /// Trial time.
    fn now(&self) -> HostMicros {
        self.rig.now() + self.age
    }

    /// The process ends here, without a word to anybody, and starts again: the lens is where it was, and knows nothing.
    fn kill(self, trial: &Trial, judge: &mut Judge) -> Result<Self> {
        judge.count(&self.rig, &self.witness);
        judge.killed();
        let mut config = trial.config.clone();
        let (low, high) = (config.rig.lens.range.min().0, config.rig.lens.range.max().0);
        config.rig.lens.start = LensPosition(self.rig.rig().glass(self.rig.now()).0.clamp(low, high));
        config.rig.faults.clear();
        // A camera that is away keeps the process from starting; the service manager tries again.
        let mut start = self.now();
        loop {
            match Self::begin(trial, &config, start) {
                Err(_) if start < at(LAST_FAULT) + LONGEST_SPELL => start += RESTART,
                begun => return begun,
            }
        }
    }
}

/// The script as a process sees it that started at `age`.
fn shifted<Kind: Copy>(script: &[Spell<Kind>], age: Duration) -> Vec<Spell<Kind>> {
    let shift = |time: HostMicros| HostMicros(time.0 - age.as_micros() as i64);
    script
        .iter()
        .map(|spell| Spell { kind: spell.kind, from: shift(spell.from), until: shift(spell.until) })
        .filter(|spell| spell.until > HostMicros(0))
        .collect()
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
    match draw.random_range(0..10) {
        0..4 => Command::Focus(request(draw)),
        4 => Command::Abort,
        5 => Command::SetMode(Mode::Manual),
        6 | 7 => Command::SetMode(Mode::Auto),
        _ => Command::MoveTo(LensPosition(match draw.random_range(0..6) {
            0 => f64::NAN,
            1 => f64::INFINITY,
            2 => -1e300,
            _ => draw.random_range(0.0..4000.0),
        })),
    }
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

/// Whether a command began something that moves the lens.
fn moves(command: Command, accepted: Accepted) -> bool {
    matches!((command, accepted), (Command::MoveTo(_), Accepted::Done))
}
