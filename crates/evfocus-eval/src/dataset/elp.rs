//! The data set of "One-step event-driven high-speed autofocus" (CVPR 2025; code: github.com/YuHanBaozju/ELP), as its code reads it: a
//! folder per sequence with `event.npy` and `info.txt`.
//!
//! `event.npy` is either an array of rows t, x, y, p (their DAVIS346) or of records with the fields t, x, y, p (their EVK4); t in
//! microseconds, p 0 or 1. `info.txt` has lines `gt_timestamp = N`, and for the DAVIS346 `start_timestamp = N` and `end_timestamp = N`, all in
//! microseconds of the camera's clock.
//!
//! What the code leaves unclear: where the lens was. The truth is a *time*, so positions here are milliseconds since the start of the
//! sweep, and so are errors; that one lens speed holds for the sweep is assumed by the methods that go by position. The number types of
//! the arrays are not told either: any whole or floating one is read. Windows of interest (`ROI selected`) are ignored.

use std::fs::{self, File};
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use evfocus_core::{CameraMicros, Event, EventList, Geometry, LensPosition, LensTrace, Polarity};
use npyz::{DType, Endianness, NpyFile, Order, TypeChar, TypeStr};

use super::{Condition, Dataset, Entry, Label, Sequence, Source, Unit};

/// The events of a sequence.
pub const EVENTS_FILE: &str = "event.npy";
/// Its times.
pub const INFO_FILE: &str = "info.txt";
/// Folders below the root: scene, condition, and one to spare.
const DEPTH: usize = 3;
const NAMES: [&str; 4] = ["t", "x", "y", "p"];

/// The sequences below `folder`.
///
/// # Errors
/// A folder that cannot be read or has no sequences.
pub fn dataset(folder: &Path) -> anyhow::Result<Dataset> {
    let mut folders = Vec::new();
    find(folder, DEPTH, &mut folders)?;
    folders.sort();
    if folders.is_empty() {
        bail!(
            "{}: no folder holds {EVENTS_FILE} and {INFO_FILE}; name the folder of the data set",
            folder.display()
        );
    }
    let entries = folders.into_iter().map(|sequence| {
        let name = sequence.strip_prefix(folder).unwrap_or(&sequence).display().to_string().replace('/', "_");
        let condition = Condition::of_name(&name);
        Entry {
            label: Label { name, condition, stress: None, unit: Unit::Milliseconds },
            source: Source::Elp(sequence),
        }
    });
    let about = String::from("the data set of the event-based Laplacian product, ELP; errors are times");
    Ok(Dataset::untaught("ELP", about, entries.collect()))
}

fn find(folder: &Path, depth: usize, found: &mut Vec<PathBuf>) -> anyhow::Result<()> {
    if folder.join(EVENTS_FILE).is_file() && folder.join(INFO_FILE).is_file() {
        found.push(folder.to_owned());
        return Ok(());
    }
    let entries =
        fs::read_dir(folder).with_context(|| format!("{}: cannot read the folder", folder.display()))?;
    for entry in entries {
        let path = entry?.path();
        if depth > 0 && path.is_dir() {
            find(&path, depth - 1, found)?;
        }
    }
    Ok(())
}

/// Reads the sequence in `folder`.
///
/// # Errors
/// Files that are missing, broken, or not what the data set's code reads.
pub fn read(folder: &Path) -> anyhow::Result<Sequence> {
    let info_path = folder.join(INFO_FILE);
    let info =
        fs::read_to_string(&info_path).with_context(|| format!("{}: cannot read", info_path.display()))?;
    let truth = time_in(&info, "gt_timestamp")
        .with_context(|| format!("{}: no line \"gt_timestamp = MICROSECONDS\"", info_path.display()))?;
    let mut events = read_events(&folder.join(EVENTS_FILE))?;
    events.sort_by_key(|event| event.t);
    if let Some(start) = time_in(&info, "start_timestamp") {
        events.retain(|event| event.t.0 >= start);
    }
    if let Some(end) = time_in(&info, "end_timestamp") {
        events.retain(|event| event.t.0 <= end);
    }
    let (Some(&first), Some(&last)) = (events.first(), events.last()) else {
        bail!("{}: no events within the times of {INFO_FILE}", folder.display());
    };
    let position = |time: i64| (time - first.t.0) as f64 * 1e-3;
    let mut trace = LensTrace::with_capacity(2);
    trace.push_if_later(first.t, LensPosition(0.0));
    trace.push_if_later(last.t, LensPosition(position(last.t.0)));
    let side = |of: fn(&Event) -> u16| events.iter().map(of).max().unwrap_or(0).saturating_add(1);
    let geometry = Geometry { width: side(|event| event.x), height: side(|event| event.y) };
    let events =
        EventList::of(events).with_context(|| format!("{}: not from this camera", folder.display()))?;
    let truths = vec![position(truth)];
    Ok(Sequence { geometry, events, trace, truths, frames: None })
}

/// The number after `name =`.
fn time_in(info: &str, name: &str) -> Option<i64> {
    let value = info.split_once(name)?.1.trim_start().strip_prefix('=')?.trim_start();
    let digits = value.split(|letter: char| !letter.is_ascii_digit()).next()?;
    digits.parse().ok()
}

/// Where t, x, y and p lie in a row, and how long a row is; bytes.
struct Row {
    fields: Vec<(usize, TypeStr)>,
    length: usize,
}

fn read_events(path: &Path) -> anyhow::Result<Vec<Event>> {
    let shown = path.display();
    let file = File::open(path).with_context(|| format!("{shown}: cannot open"))?;
    let array = NpyFile::new(BufReader::new(file)).with_context(|| format!("{shown}: not an npy file"))?;
    let row = row(&array).with_context(|| {
        format!(
            "{shown}: {} of shape {:?} is not rows of t, x, y, p; save it with numpy.save as an array of N x 4 numbers, row by row",
            array.dtype().descr(),
            array.shape()
        )
    })?;
    let number = array.shape().first().copied().unwrap_or(0);
    let mut reader = array.into_inner();
    let mut bytes = vec![0; row.length];
    let mut events = Vec::new();
    for index in 0..number {
        reader
            .read_exact(&mut bytes)
            .with_context(|| format!("{shown}: cut off in row {index} of {number}"))?;
        let mut values = [0.0; 4];
        for (value, (offset, kind)) in values.iter_mut().zip(&row.fields) {
            *value = bytes.get(*offset..).and_then(|bytes| number_in(bytes, kind)).with_context(|| {
                format!("{shown}: numbers of type {kind} are not read; save whole or floating numbers")
            })?;
        }
        let [t, x, y, p] = values;
        events.push(Event {
            t: CameraMicros(t as i64),
            x: x as u16,
            y: y as u16,
            polarity: Polarity::from_on(p > 0.0),
        });
    }
    Ok(events)
}

fn row<R: Read>(array: &NpyFile<R>) -> Option<Row> {
    match array.dtype() {
        DType::Plain(kind) => {
            let is_rows =
                array.order() == Order::C && array.shape().get(1) == Some(&4) && array.shape().len() == 2;
            let size = kind.num_bytes().filter(|_| is_rows)?;
            let fields = (0..NAMES.len()).map(|index| (index * size, kind.clone())).collect();
            Some(Row { fields, length: NAMES.len() * size })
        }
        DType::Record(columns) => {
            let mut length = 0;
            let mut places = Vec::with_capacity(columns.len());
            for column in columns {
                let DType::Plain(kind) = column.dtype else { return None };
                places.push((column.name, length, kind.clone()));
                length += kind.num_bytes()?;
            }
            let place = |name: &&str| {
                let (_, offset, kind) = places.iter().find(|(other, ..)| other == name)?;
                Some((*offset, kind.clone()))
            };
            Some(Row { fields: NAMES.iter().map(place).collect::<Option<_>>()?, length })
        }
        DType::Array(..) => None,
    }
}

/// The number at the beginning of `bytes`.
fn number_in(bytes: &[u8], kind: &TypeStr) -> Option<f64> {
    let mut number = bytes.get(..kind.num_bytes()?)?.to_vec();
    if kind.endianness() == Endianness::Big {
        number.reverse();
    }
    let is_negative = kind.type_char() == TypeChar::Int && number.last().is_some_and(|&byte| byte >= 0x80);
    let float_of_32 = || Some(f64::from(f32::from_le_bytes(number.clone().try_into().ok()?)));
    if kind.type_char() == TypeChar::Float {
        return number.clone().try_into().ok().map(f64::from_le_bytes).or_else(float_of_32);
    }
    if ![TypeChar::Int, TypeChar::Uint, TypeChar::Bool].contains(&kind.type_char()) {
        return None;
    }
    let mut wide = number.clone();
    wide.resize(8, if is_negative { 0xff } else { 0 });
    let bits: [u8; 8] = wide.try_into().ok()?;
    Some(i64::from_le_bytes(bits) as f64)
}
