//! Writes events as text.

use std::borrow::Borrow;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use evfocus_core::Event;

use crate::RecordError;

/// Writes a CSV file with the columns `t_us,x,y,p`: microseconds, column, row, 1 for ON and 0 for OFF. Nothing is lost;
/// times may go back.
#[derive(Debug)]
pub struct CsvWriter {
    path: PathBuf,
    file: BufWriter<File>,
}

impl CsvWriter {
    /// The first line of the file.
    pub const HEADER: &str = "t_us,x,y,p";

    /// Creates the file, or empties it.
    ///
    /// # Errors
    /// [`RecordError::Write`] if the system refuses.
    pub fn create(path: impl AsRef<Path>) -> Result<Self, RecordError> {
        let path = path.as_ref().to_owned();
        let create = || {
            let mut file = BufWriter::new(File::create(&path)?);
            writeln!(file, "{}", Self::HEADER)?;
            Ok(file)
        };
        match create() {
            Ok(file) => Ok(Self { path, file }),
            Err(source) => Err(RecordError::Write { path, source }),
        }
    }

    /// Appends events.
    ///
    /// # Errors
    /// [`RecordError::Write`] if the system refuses.
    pub fn write(&mut self, events: impl IntoIterator<Item: Borrow<Event>>) -> Result<(), RecordError> {
        let written = events.into_iter().try_for_each(|event| {
            let event = event.borrow();
            writeln!(self.file, "{},{},{},{}", event.t.0, event.x, event.y, u8::from(event.polarity.is_on()))
        });
        written.map_err(|source| RecordError::Write { path: self.path.clone(), source })
    }

    /// Writes what is still held back and closes the file. Without this call the end of the recording may be missing.
    ///
    /// # Errors
    /// [`RecordError::Write`] if the system refuses.
    pub fn finish(mut self) -> Result<(), RecordError> {
        self.file.flush().map_err(|source| RecordError::Write { path: self.path, source })
    }
}
