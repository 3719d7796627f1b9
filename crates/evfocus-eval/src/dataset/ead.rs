//! The paper's data set, EAD (DOI 10.25442/hku.19407884), as the authors' code reads it: one MAT file per sequence with
//! `aedat.data.polarity.{x, y, polarity, timeStamp, focusPosition}`, and one `gt_focus_points.txt` of true positions.
//!
//! Times are microseconds; every event has its lens position; columns and rows count from 0; `polarity` is 0 or 1. Written from the
//! authors' code: the data set itself could not be reached. MAT files of version 7.3 are HDF5 and must be converted first.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use evfocus_core::{CameraMicros, Event, EventList, Geometry, LensPosition, LensTrace, Polarity};
use matrw::{MatFile, MatVariable, MatlabType, MatrwError};

use super::{Condition, Dataset, Entry, Label, Sequence, Source, Unit};

/// The file of true positions: a sequence's name and lens counts in each line.
pub const TRUTH_FILE: &str = "gt_focus_points.txt";
/// The data set's camera, a DAVIS346.
const GEOMETRY: Geometry = Geometry { width: 346, height: 260 };
/// A sample of the lens position is taken from the first event of each millisecond, and from the last event of all.
const SAMPLE_US: i64 = 1_000;

/// The sequences below `folder`.
///
/// # Errors
/// A folder without truth file or MAT files, or a sequence whose true position is not told.
pub fn dataset(folder: &Path) -> anyhow::Result<Dataset> {
    let truths = read_truths(&folder.join(TRUTH_FILE))?;
    let mut files = Vec::new();
    find_mat_files(folder, &mut files)?;
    files.sort();
    if files.is_empty() {
        bail!("{}: there are no .mat files; name the folder of the data set", folder.display());
    }
    let mut entries = Vec::with_capacity(files.len());
    for path in files {
        let (name, truth) = name_and_truth(&path, folder, &truths)?;
        let condition = Condition::of_name(&name);
        entries.push(Entry {
            label: Label { name, condition, stress: None, unit: Unit::Counts },
            source: Source::Ead(path, truth),
        });
    }
    Ok(Dataset::untaught("EAD", String::from("the paper's data set, EAD"), entries))
}

fn find_mat_files(folder: &Path, found: &mut Vec<PathBuf>) -> anyhow::Result<()> {
    let entries =
        fs::read_dir(folder).with_context(|| format!("{}: cannot read the folder", folder.display()))?;
    for entry in entries {
        let path = entry?.path();
        if path.is_dir() {
            find_mat_files(&path, found)?;
        } else if path.extension().is_some_and(|extension| extension == "mat") {
            found.push(path);
        }
    }
    Ok(())
}

fn read_truths(path: &Path) -> anyhow::Result<Vec<(String, f64)>> {
    let text = fs::read_to_string(path).with_context(|| {
        format!("{}: cannot read the true positions; name the root of the data set", path.display())
    })?;
    let mut truths = Vec::new();
    for (index, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let fields: Vec<&str> = line.split([' ', '\t', ',']).filter(|field| !field.is_empty()).collect();
        let [name, position] = fields.as_slice() else {
            bail!("{} line {}: {line:?} is not a name and a position", path.display(), index + 1);
        };
        let position = position.parse().ok().filter(|position: &f64| position.is_finite());
        let position = position
            .with_context(|| format!("{} line {}: {line:?} has no position", path.display(), index + 1))?;
        truths.push(((*name).to_owned(), position));
    }
    Ok(truths)
}

/// The sequence's name is that of its folder; the file of truths may tell more or less of it, so that one begins with the other.
fn name_and_truth(path: &Path, root: &Path, truths: &[(String, f64)]) -> anyhow::Result<(String, f64)> {
    let folder = path.parent().filter(|folder| *folder != root);
    let named = folder.map_or_else(|| path.file_stem(), Path::file_name).unwrap_or_default();
    let name = named.to_string_lossy().into_owned();
    let alike =
        truths.iter().filter(|(other, _)| name.starts_with(other.as_str()) || other.starts_with(&name));
    let best = alike.max_by_key(|(other, _)| other.len().min(name.len()));
    let &(_, truth) = best.with_context(|| {
        format!(
            "{}: {TRUTH_FILE} has no position for {name:?}; add a line \"{name} POSITION\"",
            path.display()
        )
    })?;
    Ok((name, truth))
}

/// Reads one MAT file of version 7.
///
/// # Errors
/// A file that is missing, broken, of version 7.3, or without the fields.
pub fn read(path: &Path, truth: f64) -> anyhow::Result<Sequence> {
    let shown = path.display();
    let name = path.to_str().with_context(|| format!("{shown}: the path is not UTF-8; rename it"))?;
    let file = matrw::load_matfile(name).map_err(|error| match error {
        MatrwError::MatFile73Error => anyhow::anyhow!(
            "{shown}: a MAT file of version 7.3 (HDF5), which evfocus does not read; convert it in MATLAB: \
             load('{shown}'); save('{shown}', 'aedat', '-v7')"
        ),
        MatrwError::IoError(error) => anyhow::anyhow!("{shown}: cannot read: {error}"),
        // What it says of itself is pages long.
        MatrwError::BinrwError(_)
        | MatrwError::AccessError(_)
        | MatrwError::SerdeError(_)
        | MatrwError::TypeConstruction(_) => anyhow::anyhow!(
            "{shown}: not a MAT file of version 7 as MATLAB writes it, or it is damaged; save it in MATLAB: \
             load('{shown}'); save('{shown}', 'aedat', '-v7')"
        ),
    })?;
    let column = |field: &str| {
        numbers(&file, field).with_context(|| format!("{shown}: no numbers in aedat.data.polarity.{field}"))
    };
    let (x, y, polarity) = (column("x")?, column("y")?, column("polarity")?);
    let (times, positions) = (column("timeStamp")?, column("focusPosition")?);
    let lengths = [&x, &y, &polarity, &times, &positions].map(Vec::len);
    if lengths.iter().any(|&length| length != lengths[0]) {
        bail!("{shown}: x, y, polarity, timeStamp and focusPosition have unlike lengths: {lengths:?}");
    }
    let mut events = Vec::with_capacity(x.len());
    let mut trace = LensTrace::with_capacity(x.len());
    let mut sample_due = CameraMicros(i64::MIN);
    for index in 0..x.len() {
        let t = CameraMicros(times[index] as i64);
        events.push(Event {
            t,
            x: x[index] as u16,
            y: y[index] as u16,
            polarity: Polarity::from_on(polarity[index] > 0.0),
        });
        if t >= sample_due {
            trace.push_if_later(t, LensPosition(positions[index]));
            sample_due = CameraMicros(t.0 + SAMPLE_US);
        }
    }
    if let (Some(last), Some(&position)) = (events.last(), positions.last()) {
        trace.push_if_later(last.t, LensPosition(position));
    }
    events.sort_by_key(|event| event.t);
    let events = EventList::of(events).with_context(|| format!("{shown}: not from this camera"))?;
    Ok(Sequence { geometry: GEOMETRY, events, trace, truths: vec![truth], frames: None })
}

/// The numbers of a field of the polarity events, whichever type they are stored in.
fn numbers(file: &MatFile, field: &str) -> Option<Vec<f64>> {
    fn widened<T: Copy>(values: &[T]) -> Vec<f64>
    where
        f64: From<T>,
    {
        values.iter().copied().map(f64::from).collect()
    }
    let MatVariable::NumericArray(array) = &file["aedat"]["data"]["polarity"][field] else { return None };
    match &array.value {
        MatlabType::U8(values) => Some(widened(values)),
        MatlabType::I8(values) => Some(widened(values)),
        MatlabType::U16(values) => Some(widened(values)),
        MatlabType::I16(values) => Some(widened(values)),
        MatlabType::U32(values) => Some(widened(values)),
        MatlabType::I32(values) => Some(widened(values)),
        MatlabType::F32(values) => Some(widened(values)),
        MatlabType::F64(values) => Some(values.clone()),
        MatlabType::BOOL(values) => Some(widened(values)),
        // Whole numbers of 64 bits do not convert without loss, but microseconds and counts stay below 2^53.
        MatlabType::U64(values) => Some(values.iter().map(|&value| value as f64).collect()),
        MatlabType::I64(values) => Some(values.iter().map(|&value| value as f64).collect()),
        MatlabType::UTF8(_) | MatlabType::UTF16(_) => None,
    }
}
