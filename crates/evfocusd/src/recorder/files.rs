//! The two files of a recording.

use std::fs::OpenOptions;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use evfocus_core::{CameraMicros, Events, Geometry, LensPosition};
use evfocus_record::positions::PositionsWriter;
use evfocus_record::{Aedat4Compression, Aedat4Writer, Evt3Writer, RecordError};

use super::{RecordPlan, RecordingError};

/// Where the lens's positions go: `sweep.positions.csv` beside `sweep.raw`.
pub fn positions_beside(recording: &Path) -> PathBuf {
    recording.with_extension("positions.csv")
}

/// What a file's name asks for.
#[derive(Debug, Clone, Copy)]
enum FileFormat {
    Evt3,
    Aedat4,
}

fn format_of(path: &Path) -> Result<FileFormat, RecordingError> {
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    match ending.as_str() {
        "raw" => Ok(FileFormat::Evt3),
        "aedat4" => Ok(FileFormat::Aedat4),
        _ => Err(RecordingError::Name { path: path.to_owned() }),
    }
}

/// What can be said of the plan before devices are opened and moved.
pub(super) fn check(plan: &RecordPlan) -> Result<(), RecordingError> {
    format_of(&plan.file)?;
    let taken = [plan.file.clone(), positions_beside(&plan.file)].into_iter().find(|path| path.exists());
    match taken {
        Some(path) if !plan.overwrite => Err(RecordingError::Exists { path }),
        _ => Ok(()),
    }
}

/// The recording and the positions.
pub(super) struct Files {
    events: EventFile,
    positions: PositionsWriter,
}

enum EventFile {
    Evt3(Evt3Writer),
    Aedat4(Aedat4Writer),
}

impl Files {
    /// Creates both.
    pub(super) fn create(plan: &RecordPlan, geometry: Geometry) -> Result<Self, RecordingError> {
        let (file, beside) = (&plan.file, positions_beside(&plan.file));
        let format = format_of(file)?;
        if !plan.overwrite {
            claim(file)?;
            claim(&beside)?;
        }
        let events = match format {
            FileFormat::Evt3 => Evt3Writer::create(file, geometry).map(EventFile::Evt3),
            FileFormat::Aedat4 => {
                Aedat4Writer::create(file, geometry, Aedat4Compression::Lz4).map(EventFile::Aedat4)
            }
        };
        let files =
            events.and_then(|events| Ok(Self { events, positions: PositionsWriter::create(&beside)? }));
        files.map_err(|cause| RecordingError::Write {
            cause: Box::new(cause),
            recorded: super::Recorded::default(),
        })
    }

    pub(super) fn write(&mut self, events: Events<'_>) -> Result<(), RecordError> {
        match &mut self.events {
            EventFile::Evt3(writer) => writer.write(events.iter()),
            EventFile::Aedat4(writer) => writer.write(events.iter()),
        }
    }

    pub(super) fn position(&mut self, time: CameraMicros, position: LensPosition) -> Result<(), RecordError> {
        self.positions.write(time, position)
    }

    pub(super) fn flush(&mut self) -> Result<(), RecordError> {
        match &mut self.events {
            EventFile::Evt3(writer) => writer.flush()?,
            EventFile::Aedat4(writer) => writer.flush()?,
        }
        self.positions.flush()
    }

    /// Ends both, whether or not one fails; the recording goes on without events until `end`, where its format can say so.
    pub(super) fn finish(self, end: Option<CameraMicros>) -> Result<(), RecordError> {
        let events = match self.events {
            EventFile::Evt3(mut writer) => {
                let told = end.map_or(Ok(()), |end| writer.advance(end));
                told.and(writer.finish())
            }
            EventFile::Aedat4(writer) => writer.finish(),
        };
        let positions = self.positions.finish();
        events.and(positions)
    }
}

/// Makes an empty file, or says that one is there: in one step, so that nobody's file is emptied.
fn claim(path: &Path) -> Result<(), RecordingError> {
    match OpenOptions::new().write(true).create_new(true).open(path) {
        Ok(_) => Ok(()),
        Err(error) if error.kind() == ErrorKind::AlreadyExists => {
            Err(RecordingError::Exists { path: path.to_owned() })
        }
        Err(source) => {
            let cause = Box::new(RecordError::Write { path: path.to_owned(), source });
            Err(RecordingError::Write { cause, recorded: super::Recorded::default() })
        }
    }
}
