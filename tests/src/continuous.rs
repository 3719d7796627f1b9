//! Trials of continuous mode in virtual time: the lens comes into focus, something changes, and either a run must start or none may.

use std::path::Path;
use std::time::Duration;

use anyhow::{Context, Result};
use evfocus_core::controller::{Command, FocusState, Mode};
use evfocus_core::{HostMicros, LensPosition};
use evfocusd::{Config, VirtualRig};
use hil_sim::{Change, ChangeKind};
use rand::RngExt;
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

/// When the scene changes: the first run takes 4 to 6 s, and 2 s later it is known how the picture looks in focus.
pub const CHANGES_AT: Duration = Duration::from_secs(10);
/// How long a loss of focus has to be noticed.
pub const NOTICED_WITHIN: Duration = Duration::from_secs(6);
/// What a run takes.
const LONGEST_RUN: Duration = Duration::from_secs(15);
const SCENES: [&str; 7] =
    ["text", "siemens-star", "dead-leaves", "pink-noise", "checker", "foliage", "buildings"];

/// What happens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Happening {
    /// Focus moves by so many counts, or the lens was knocked by as many.
    Focus(f64),
    /// The scene moves at this multiple of its speed; 0: it stands still.
    Pace(f64),
    /// The light changes by this factor.
    Light(f64),
    /// Nothing.
    Nothing,
}

impl Happening {
    /// Its name in tables.
    pub fn title(self) -> String {
        match self {
            Self::Focus(by) => format!("focus elsewhere by {:.0} counts", by.abs()),
            Self::Pace(times) => format!("scene moves {times} times as fast"),
            Self::Light(times) => format!("light {times} times as bright"),
            Self::Nothing => "nothing".to_owned(),
        }
    }

    fn change(self) -> Option<ChangeKind> {
        match self {
            Self::Focus(by) => Some(ChangeKind::Focus { by }),
            Self::Pace(times) => Some(ChangeKind::Pace { times }),
            Self::Light(times) => Some(ChangeKind::Light { times }),
            Self::Nothing => None,
        }
    }
}

/// One trial.
#[derive(Debug, Clone)]
pub struct Trial {
    /// What happens.
    pub happening: Happening,
    /// The rig.
    pub config: Config,
}

/// What came of it.
#[derive(Debug, Clone)]
pub struct Ended {
    /// Runs that were started after the change.
    pub runs: u64,
    /// From the change to the first of them.
    pub noticed_after: Option<Duration>,
    /// Where the lens stands at the end from where it should, counts.
    pub error: f64,
    /// Sharpness as last seen before a run started, or at the end.
    pub sharpness: Option<f64>,
    /// Whether the first run found focus.
    pub began_focused: bool,
}

impl Trial {
    /// The rig of `config`, to which `happening` happens.
    pub fn new(happening: Happening, mut config: Config) -> Self {
        let change = |kind| Change { after: CHANGES_AT, kind };
        config.rig.changes = happening.change().map(change).into_iter().collect();
        Self { happening, config }
    }

    /// `happening` in the scene, motion and light that follow from `seed`.
    ///
    /// # Errors
    /// If the simulator does not take them.
    pub fn draw(happening: Happening, seed: u64) -> Result<Self> {
        let mut draw = Xoshiro256PlusPlus::seed_from_u64(seed);
        let scene = SCENES[draw.random_range(0..SCENES.len())];
        let light = if draw.random_bool(0.25) { "dark" } else { "light" };
        let focus = draw.random_range(1200.0..2800.0);
        let motion = if draw.random_bool(0.6) {
            format!("shake_px_rms = {:.2}", draw.random_range(1.0..3.0))
        } else {
            format!("velocity_px_per_s = {:.0}", draw.random_range(10.0..60.0))
        };
        let text = format!(
            "[simulation]\nscene = \"{scene}\"\nlight = \"{light}\"\nfocus_counts = {focus:.0}\n{motion}\nseed = {seed}"
        );
        Ok(Self::new(happening, Config::parse(&text, Path::new("trial"))?))
    }

    /// Lets it happen.
    ///
    /// # Errors
    /// If the rig does not start.
    pub fn run(&self) -> Result<Ended> {
        let mut rig = VirtualRig::new(&self.config)?;
        rig.command(Command::SetMode(Mode::Continuous))?;
        let change = HostMicros(CHANGES_AT.as_micros() as i64);
        while rig.now() < change {
            rig.step();
        }
        let before = rig.controller().snapshot();
        let began_focused = before.state == FocusState::Focused;
        let (mut noticed, mut sharpness) = (None, None);
        let end = change + NOTICED_WITHIN;
        loop {
            rig.step();
            let snapshot = rig.controller().snapshot();
            sharpness = snapshot.sharpness.or(sharpness);
            if snapshot.continuous_runs > before.continuous_runs && noticed.is_none() {
                noticed = Some(rig.now());
            }
            let is_over = match noticed {
                None => rig.now() >= end,
                Some(since) => snapshot.run.is_none() || rig.now() >= since + LONGEST_RUN,
            };
            if is_over {
                break;
            }
        }
        let by = if let Happening::Focus(by) = self.happening { by } else { 0.0 };
        let truth = rig.truth().first().context("a truth")?.0 + by;
        Ok(Ended {
            runs: rig.controller().snapshot().continuous_runs - before.continuous_runs,
            noticed_after: noticed.map(|at| at.since(change)),
            error: rig.rig().glass(rig.now()).counts_from(LensPosition(truth)),
            sharpness,
            began_focused,
        })
    }
}
