//! Where the lens was during a recording: a CSV file with the header `t_us,position`, one sample a line, oldest first, times
//! on the clock of the recording's events.
//!
//! Not its job: judging whether the positions cover a recording or move at all.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use evfocus_core::{CameraMicros, LensPosition, LensTrace};

use crate::RecordError;

/// The first line of a positions file.
pub const HEADER: &str = "t_us,position";
/// Fewer samples say nothing about a motion.
pub const MIN_SAMPLES: usize = 2;
/// Larger files are no positions files: this is more than an hour at one sample a millisecond.
pub const MAX_BYTES: u64 = 64 << 20;

/// Reads the positions at `path`. [`LensTrace::first`], [`LensTrace::last`] and [`LensTrace::extent`] tell what they cover.
///
/// # Errors
/// [`RecordError::Open`] and [`RecordError::Read`] if the system refuses, [`RecordError::Line`] for a line that is not
/// `time,position`, a number that is not finite, a time that is not after the one before, or a wrong header;
/// [`RecordError::Unrecognised`] for a file that is empty or has fewer than [`MIN_SAMPLES`] samples.
pub fn read(path: impl AsRef<Path>) -> Result<LensTrace<CameraMicros>, RecordError> {
    let path = path.as_ref();
    let open_error =
        |source| RecordError::Open { path: path.to_owned(), source, remedy: "name the file of positions" };
    let size = fs::metadata(path).map_err(open_error)?.len();
    let unrecognised = |found: String| RecordError::Unrecognised {
        path: path.to_owned(),
        found,
        remedy: format!(
            "a positions file has the line {HEADER:?} and then at least {MIN_SAMPLES} lines such as 1000,220"
        ),
    };
    if size > MAX_BYTES {
        return Err(unrecognised(format!("{size} bytes are too many for a file of positions")));
    }
    let bytes = fs::read(path).map_err(|source| RecordError::Read { path: path.to_owned(), source })?;
    let text = String::from_utf8_lossy(&bytes);
    if text.trim().is_empty() {
        return Err(unrecognised(String::from("the file is empty")));
    }
    let trace = parse(path, text.trim_start_matches('\u{feff}'))?;
    if trace.len() < MIN_SAMPLES {
        return Err(unrecognised(format!("only {} positions", trace.len())));
    }
    Ok(trace)
}

/// Writes the samples of `trace` to `path`, replacing the file.
///
/// # Errors
/// [`RecordError::Write`] if the system refuses.
pub fn write(path: impl AsRef<Path>, trace: &LensTrace<CameraMicros>) -> Result<(), RecordError> {
    let mut writer = PositionsWriter::create(path)?;
    trace.samples().try_for_each(|(time, position)| writer.write(time, position))?;
    writer.finish()
}

/// Writes a positions file sample by sample.
#[derive(Debug)]
pub struct PositionsWriter {
    path: PathBuf,
    file: BufWriter<File>,
    last: Option<CameraMicros>,
}

impl PositionsWriter {
    /// Creates the file, or empties it.
    ///
    /// # Errors
    /// [`RecordError::Write`] if the system refuses.
    pub fn create(path: impl AsRef<Path>) -> Result<Self, RecordError> {
        let path = path.as_ref().to_owned();
        let create = || {
            let mut file = BufWriter::new(File::create(&path)?);
            writeln!(file, "{HEADER}")?;
            Ok(file)
        };
        match create() {
            Ok(file) => Ok(Self { path, file, last: None }),
            Err(source) => Err(RecordError::Write { path, source }),
        }
    }

    /// Appends a sample, in the shortest form that reads back as the same number. One that is not later than the last is no
    /// news and is left out.
    ///
    /// # Errors
    /// [`RecordError::Write`] if the system refuses.
    pub fn write(&mut self, time: CameraMicros, position: LensPosition) -> Result<(), RecordError> {
        if self.last.is_some_and(|last| time <= last) {
            return Ok(());
        }
        self.last = Some(time);
        let written = writeln!(self.file, "{},{}", time.0, position.0);
        written.map_err(|source| self.error(source))
    }

    /// Hands what was written to the system.
    ///
    /// # Errors
    /// [`RecordError::Write`] if it refuses.
    pub fn flush(&mut self) -> Result<(), RecordError> {
        self.file.flush().map_err(|source| self.error(source))
    }

    /// Writes what is still held back and closes the file.
    ///
    /// # Errors
    /// [`RecordError::Write`] if the system refuses.
    pub fn finish(mut self) -> Result<(), RecordError> {
        self.flush()
    }

    fn error(&self, source: io::Error) -> RecordError {
        RecordError::Write { path: self.path.clone(), source }
    }
}

const REMEDY: &str = "write the time in whole microseconds, a comma and the position in counts, oldest first";

fn parse(path: &Path, text: &str) -> Result<LensTrace<CameraMicros>, RecordError> {
    let mut trace = LensTrace::with_capacity(text.lines().count());
    let mut header_seen = false;
    for (index, line) in text.lines().enumerate() {
        let error = |what: String, remedy| RecordError::Line {
            path: path.to_owned(),
            line: index as u64 + 1,
            what,
            text: line.chars().take(80).collect(),
            remedy,
        };
        let trimmed = line.trim();
        if trimmed.is_empty() {
            continue;
        }
        if !header_seen {
            header_seen = true;
            if without_spaces(trimmed) != HEADER {
                return Err(error(
                    String::from("not the header of a positions file"),
                    "the first line must be t_us,position",
                ));
            }
            continue;
        }
        let (time, position) = sample(trimmed).map_err(|what| error(what, REMEDY))?;
        trace.push(CameraMicros(time), LensPosition(position)).map_err(|reason| {
            error(reason.to_string(), "sort the lines by time and leave one for each time")
        })?;
    }
    Ok(trace)
}

fn sample(line: &str) -> Result<(i64, f64), String> {
    let fields: Vec<&str> = line.split(',').map(str::trim).collect();
    let &[time, position] = fields.as_slice() else {
        return Err(format!("{} fields where there must be 2", fields.len()));
    };
    let time = time.parse().map_err(|_| format!("{time:?} is not a whole number of microseconds"))?;
    match position.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok((time, value)),
        _ => Err(format!("{position:?} is not a finite number")),
    }
}

fn without_spaces(line: &str) -> String {
    line.chars().filter(|c| !c.is_whitespace()).collect()
}
