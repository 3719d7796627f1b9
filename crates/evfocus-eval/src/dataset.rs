//! Sequences with known focus.

pub mod ead;
pub mod elp;
pub mod simulated;
mod stress;
pub mod sweep_files;

use std::path::PathBuf;

use evfocus_core::{CameraMicros, EventList, Events, Geometry, LensTrace};
use serde::{Deserialize, Serialize};

use crate::cache::Cache;
use crate::frames::Frames;

pub use stress::stress_suite;

/// How a sequence was lit and moved, as the paper divides them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Condition {
    /// Light, camera still.
    LightStatic,
    /// Light, camera shaken.
    LightDynamic,
    /// Dark, camera still.
    DarkStatic,
    /// Dark, camera shaken.
    DarkDynamic,
}

impl Condition {
    /// Every condition, in the order of the paper's columns.
    pub const ALL: [Self; 4] = [Self::LightStatic, Self::LightDynamic, Self::DarkStatic, Self::DarkDynamic];

    /// Light or dark, still or shaken.
    pub fn new(is_dark: bool, is_shaken: bool) -> Self {
        match (is_dark, is_shaken) {
            (false, false) => Self::LightStatic,
            (false, true) => Self::LightDynamic,
            (true, false) => Self::DarkStatic,
            (true, true) => Self::DarkDynamic,
        }
    }

    /// How it was lit.
    pub(crate) fn light(self) -> hil_sim::Light {
        match self {
            Self::LightStatic | Self::LightDynamic => hil_sim::Light::Light,
            Self::DarkStatic | Self::DarkDynamic => hil_sim::Light::Dark,
        }
    }

    /// Whether the camera was shaken.
    pub(crate) fn is_shaken(self) -> bool {
        matches!(self, Self::LightDynamic | Self::DarkDynamic)
    }

    /// What `name` says of itself in the words of the public data sets (`dark_shake`, `bright_static`, `dynamic`); nothing if a word is
    /// missing.
    pub fn of_name(name: &str) -> Option<Self> {
        let name = name.to_lowercase();
        let says = |words: &[&str]| words.iter().any(|word| name.contains(word));
        let is_dark = says(&["dark"]);
        let is_shaken = says(&["shake", "dynamic"]);
        (is_dark || says(&["light", "bright"])).then_some(())?;
        (is_shaken || says(&["static"])).then_some(Self::new(is_dark, is_shaken))
    }

    /// Words for a table.
    pub fn title(self) -> &'static str {
        match self {
            Self::LightStatic => "light static",
            Self::LightDynamic => "light dynamic",
            Self::DarkStatic => "dark static",
            Self::DarkDynamic => "dark dynamic",
        }
    }
}

/// What positions, and so errors, are measured in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Unit {
    /// Lens counts.
    Counts,
    /// Milliseconds of the sweep, where positions are not known.
    Milliseconds,
}

impl Unit {
    /// Words for a table.
    pub fn title(self) -> &'static str {
        match self {
            Self::Counts => "lens counts",
            Self::Milliseconds => "milliseconds of the sweep",
        }
    }
}

/// What is known of a sequence without its data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Label {
    /// Its name within its data set.
    pub name: String,
    /// How it was lit and moved, if that is known.
    pub condition: Option<Condition>,
    /// What makes it hard, if it is one of a stress suite.
    pub stress: Option<String>,
    /// What positions are measured in.
    pub unit: Unit,
}

/// A focus sweep with known focus.
#[derive(Debug, Clone)]
pub struct Sequence {
    /// The sensor.
    pub geometry: Geometry,
    /// All events, in the order of their times.
    pub events: EventList,
    /// Where the lens was, in camera time.
    pub trace: LensTrace<CameraMicros>,
    /// Where the scene is sharp; several for several depths, each of which is right.
    pub truths: Vec<f64>,
    /// What a frame camera saw, if there was one.
    pub frames: Option<Frames>,
}

/// Share of the way that the lens must go back for it to be a way back.
const TURN_SHARE: f64 = 0.05;

/// One way of the lens.
#[derive(Debug)]
pub struct Way<'a> {
    /// The events of this way.
    pub events: Events<'a>,
    /// Lens positions, of this way alone.
    pub trace: LensTrace<CameraMicros>,
    /// First instant of the way.
    pub start: CameraMicros,
    /// Last instant of the way.
    pub end: CameraMicros,
}

impl Sequence {
    /// One part for each way the lens went, in the order of time, together holding every event.
    pub fn ways(&self) -> Vec<Way<'_>> {
        let (low, high) = self.trace.extent().unwrap_or_default();
        let legs = self.trace.legs(TURN_SHARE * high.distance(low));
        let mut rest = self.events.as_slice();
        let mut ways = Vec::with_capacity(legs.len());
        for (index, leg) in legs.iter().enumerate() {
            let is_last = index + 1 == legs.len();
            let ends = if is_last { rest.len() } else { rest.first_at_or_after(leg.end) };
            let (events, later) = (rest.range(0..ends), rest.from(ends));
            let mut trace = LensTrace::with_capacity(self.trace.len());
            for (time, position) in self.trace.samples() {
                if time >= leg.start && time <= leg.end {
                    trace.push_if_later(time, position);
                }
            }
            ways.push(Way { events, trace, start: leg.start, end: leg.end });
            rest = later;
        }
        ways
    }
}

/// Where the data of a sequence come from.
#[derive(Debug, Clone)]
pub enum Source {
    /// The simulated rig; made once and kept in the cache.
    Simulated(Box<simulated::Recipe>),
    /// A recording with positions and truth.
    SweepFiles(PathBuf),
    /// A MAT file of the paper's data set, and the true position.
    Ead(PathBuf, f64),
    /// A folder of the ELP data set.
    Elp(PathBuf),
}

/// A sequence that is not loaded yet.
#[derive(Debug, Clone)]
pub struct Entry {
    /// What is known of it.
    pub label: Label,
    /// Where its data come from.
    pub source: Source,
}

impl Entry {
    /// What tells this sequence from every other one: its configuration, or its files with their size and time of change.
    pub fn key(&self) -> String {
        let file = |path: &PathBuf| {
            let about = std::fs::metadata(path).ok().map(|about| (about.len(), about.modified().ok()));
            format!("{} {about:?}", path.display())
        };
        let source = match &self.source {
            Source::Simulated(recipe) => recipe.key(),
            Source::SweepFiles(path) => file(path),
            Source::Ead(path, truth) => format!("{} {truth}", file(path)),
            Source::Elp(folder) => file(&folder.join(elp::EVENTS_FILE)) + &file(&folder.join(elp::INFO_FILE)),
        };
        format!("{:?} {source}", self.label)
    }

    /// Loads or makes the data.
    ///
    /// # Errors
    /// Files that are missing, broken or not what they should be.
    pub fn load(&self, cache: &Cache) -> anyhow::Result<Sequence> {
        match &self.source {
            Source::Simulated(recipe) => recipe.load(cache),
            Source::SweepFiles(recording) => sweep_files::read(recording),
            Source::Ead(path, truth) => ead::read(path, *truth),
            Source::Elp(folder) => elp::read(folder),
        }
    }
}

/// Sequences that are judged together.
#[derive(Debug, Clone)]
pub struct Dataset {
    /// Its name.
    pub name: String,
    /// Where it comes from, in a sentence.
    pub about: String,
    /// The sequences.
    pub entries: Vec<Entry>,
    /// Sweeps both ways of the same rig before other scenes, which teach it the pixels' delay; none, and there is nothing learnt.
    pub teachers: Vec<Entry>,
}

impl Dataset {
    /// Sequences that nothing was taught about.
    fn untaught(name: &str, about: String, entries: Vec<Entry>) -> Self {
        Self { name: name.to_owned(), about, entries, teachers: Vec::new() }
    }
}
