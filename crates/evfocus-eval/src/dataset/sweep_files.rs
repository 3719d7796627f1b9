//! Recorded sweeps as files side by side: `NAME.raw` (events, any format that evfocus reads), `NAME.positions.csv` (lens) and
//! `NAME.truth.json`; `NAME.frames.npy` if there was a frame camera.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use evfocus_core::{CameraMicros, EventBatch, EventList};
use evfocus_record::{MAX_EVENTS_PER_READ, Recording, positions};
use npyz::WriterBuilder;
use serde::{Deserialize, Serialize};

use super::{Condition, Dataset, Entry, Label, Sequence, Source, Unit};
use crate::frames::Frames;

const RECORDING: &str = ".raw";
const POSITIONS: &str = ".positions.csv";
const TRUTH: &str = ".truth.json";
const FRAMES: &str = ".frames.npy";

/// What a truth file must say. There are two makes; `positions` is what `evfocus simulate` writes.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Truth {
    /// Where the scene is sharp, lens counts.
    pub(crate) positions: Vec<f64>,
    /// The same in sweeps of the other make, which have one position, and one more for a background.
    #[serde(skip_serializing)]
    gt_position: Option<f64>,
    #[serde(skip_serializing)]
    two: Option<Background>,
    /// Number of events, if it is told.
    #[serde(alias = "n_events")]
    pub(crate) events: Option<u64>,
    /// Middle of the exposure of each frame, microseconds of the camera's clock.
    pub(crate) frame_times_us: Vec<i64>,
}

#[derive(Debug, Clone, Default, Deserialize)]
struct Background {
    bg: f64,
}

impl Truth {
    pub(crate) fn of(positions: Vec<f64>, events: u64) -> Self {
        Self { positions, events: Some(events), ..Self::default() }
    }

    fn all_positions(&self) -> Vec<f64> {
        let background = self.two.as_ref().map(|two| two.bg);
        self.positions.iter().copied().chain(self.gt_position).chain(background).collect()
    }
}

/// The sweeps in `folder`, sorted by name.
///
/// # Errors
/// A folder that cannot be read or has no sweeps.
pub fn dataset(folder: &Path) -> anyhow::Result<Dataset> {
    let mut entries = Vec::new();
    for name in names(folder)? {
        // A name such as `flicker_light_shake` tells the condition and what makes it hard; `light_shake` is nothing special.
        let condition = Condition::of_name(&name);
        let is_plain = name
            .split('_')
            .all(|word| word.len() == 1 || ["light", "dark", "static", "shake"].contains(&word));
        let stress = (condition.is_none() || !is_plain).then(|| name.clone());
        let source = Source::SweepFiles(folder.join(format!("{name}{RECORDING}")));
        entries.push(Entry { label: Label { name, condition, stress, unit: Unit::Counts }, source });
    }
    if entries.is_empty() {
        bail!(
            "{}: there are no sweeps; a sweep is NAME{RECORDING}, NAME{POSITIONS} and NAME{TRUTH}, as evfocus simulate writes them",
            folder.display()
        );
    }
    let about = format!("recorded sweeps in {}", folder.display());
    Ok(Dataset::untaught("sweeps", about, entries))
}

/// The names of the sweeps in `folder`, sorted.
///
/// # Errors
/// A folder that cannot be read.
pub fn names(folder: &Path) -> anyhow::Result<Vec<String>> {
    let mut names = Vec::new();
    let entries = fs::read_dir(folder)
        .with_context(|| format!("{}: cannot read the folder; name one with sweeps", folder.display()))?;
    for entry in entries {
        if let Some(name) = entry?.file_name().to_string_lossy().strip_suffix(RECORDING) {
            names.push(name.to_owned());
        }
    }
    names.sort();
    Ok(names)
}

/// Reads the sweep whose recording is `recording`.
///
/// # Errors
/// A file that is missing, broken or damaged.
pub fn read(recording: &Path) -> anyhow::Result<Sequence> {
    let path = recording;
    let mut recording = Recording::open(path, None)?;
    let geometry = recording
        .geometry()
        .with_context(|| format!("{}: the recording does not tell the sensor's size", path.display()))?;
    let mut events = EventList::default();
    let mut batch = EventBatch::with_capacity(MAX_EVENTS_PER_READ);
    while recording.read(&mut batch)? {
        batch.events.iter().try_for_each(|event| events.push(event))?;
    }
    let trace = positions::read(beside(path, POSITIONS))?;
    let truth = read_truth(&beside(path, TRUTH))?;
    if let Some(expected) = truth.events.filter(|&expected| expected != events.len() as u64) {
        bail!(
            "{}: {} events, but the truth says {expected}; the file is cut off or another one",
            path.display(),
            events.len()
        );
    }
    let frames = read_frames(&beside(path, FRAMES), &truth)?;
    Ok(Sequence { geometry, events, trace, truths: truth.all_positions(), frames })
}

/// The path of the file that belongs to `recording` and ends in `suffix`.
pub(crate) fn beside(recording: &Path, suffix: &str) -> PathBuf {
    let name = recording.file_name().unwrap_or_default().to_string_lossy();
    let stem = name.strip_suffix(RECORDING).unwrap_or(&name);
    recording.with_file_name(format!("{stem}{suffix}"))
}

fn read_truth(path: &Path) -> anyhow::Result<Truth> {
    let text = fs::read(path).with_context(|| format!("{}: cannot read the truth", path.display()))?;
    let truth: Truth = serde_json::from_slice(&text).with_context(|| {
        format!(
            "{}: not a truth file; it has \"positions\": [COUNTS, ...] or \"gt_position\": COUNTS",
            path.display()
        )
    })?;
    if truth.all_positions().is_empty() {
        bail!("{}: no position; add \"positions\": [COUNTS]", path.display());
    }
    Ok(truth)
}

fn read_frames(path: &Path, truth: &Truth) -> anyhow::Result<Option<Frames>> {
    if !path.exists() {
        return Ok(None);
    }
    let wrong = || format!("{}: not the frames of this sweep", path.display());
    let file = npyz::NpyFile::new(std::io::BufReader::new(fs::File::open(path).with_context(wrong)?))
        .with_context(wrong)?;
    let [number, _, width] = *file.shape() else { bail!(wrong()) };
    if number != truth.frame_times_us.len() as u64 {
        bail!("{}: {number} frames, but {} times in the truth", path.display(), truth.frame_times_us.len());
    }
    let times = truth.frame_times_us.iter().map(|&time| CameraMicros(time)).collect();
    Ok(Some(Frames { width: width as usize, times, bytes: file.into_vec::<u8>().with_context(wrong)? }))
}

/// Writes what belongs to `recording` beside it: lens positions, truth and frames.
pub(crate) fn write_beside(
    recording: &Path,
    trace: &evfocus_core::LensTrace<CameraMicros>,
    mut truth: Truth,
    frames: &Frames,
) -> anyhow::Result<()> {
    positions::write(beside(recording, POSITIONS), trace)?;
    truth.frame_times_us = frames.times.iter().map(|time| time.0).collect();
    fs::write(beside(recording, TRUTH), serde_json::to_vec_pretty(&truth)?)?;
    if frames.times.is_empty() {
        return Ok(());
    }
    let length = frames.bytes.len() / frames.times.len();
    let shape = [frames.times.len(), length / frames.width.max(1), frames.width].map(|side| side as u64);
    let mut file = std::io::BufWriter::new(fs::File::create(beside(recording, FRAMES))?);
    let mut writer = npyz::WriteOptions::new().default_dtype().shape(&shape).writer(&mut file).begin_nd()?;
    writer.extend(&frames.bytes)?;
    Ok(writer.finish()?)
}
