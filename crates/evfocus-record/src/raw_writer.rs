//! Writes Prophesee RAW files with EVT 3.0 words.

use std::borrow::Borrow;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use evfocus_core::{CameraMicros, Event, Geometry};

use crate::RecordError;
use crate::encode::Evt3Encoder;
use crate::raw_header::ORIGIN_KEY;

/// Writes a RAW file that Prophesee's tools and the other readers of EVT3 understand. Nothing is lost, not even times that
/// the format's 24 bits do not hold: a header line `% t0_us N` says what to add, and [`Recording`](crate::Recording) adds
/// it; other readers see the times from the last multiple of 2^24 us before the first event on. Times below 2^24 us need no
/// such line.
#[derive(Debug)]
pub struct Evt3Writer {
    path: PathBuf,
    file: BufWriter<File>,
    geometry: Geometry,
    encoder: Evt3Encoder,
    words: Vec<u8>,
    header_written: bool,
}

impl Evt3Writer {
    /// Creates the file, or empties it.
    ///
    /// # Errors
    /// [`RecordError::Write`] if the system refuses, [`RecordError::Encode`] if the sensor is too large for the format.
    pub fn create(path: impl AsRef<Path>, geometry: Geometry) -> Result<Self, RecordError> {
        let path = path.as_ref().to_owned();
        let encoder = Evt3Encoder::new(geometry)
            .map_err(|source| RecordError::Encode { path: path.clone(), source })?;
        let file = File::create(&path).map_err(|source| RecordError::Write { path: path.clone(), source })?;
        let file = BufWriter::new(file);
        Ok(Self { path, file, geometry, encoder, words: Vec::new(), header_written: false })
    }

    /// Appends events, oldest first.
    ///
    /// # Errors
    /// [`RecordError::Encode`] for an event outside of the sensor, before the last one, or too long after it;
    /// [`RecordError::Write`] if the system refuses.
    pub fn write(&mut self, events: impl IntoIterator<Item: Borrow<Event>>) -> Result<(), RecordError> {
        self.words.clear();
        let encoded = self.encoder.encode(events, &mut self.words);
        self.put_words()?;
        encoded.map_err(|source| RecordError::Encode { path: self.path.clone(), source })
    }

    /// Says that the recording goes on without events until `time`.
    ///
    /// # Errors
    /// As [`write`](Self::write).
    pub fn advance(&mut self, time: CameraMicros) -> Result<(), RecordError> {
        self.words.clear();
        let encoded = self.encoder.advance(time, &mut self.words);
        self.put_words()?;
        encoded.map_err(|source| RecordError::Encode { path: self.path.clone(), source })
    }

    /// Hands what was written to the system, so that it outlives this program.
    ///
    /// # Errors
    /// [`RecordError::Write`] if it refuses.
    pub fn flush(&mut self) -> Result<(), RecordError> {
        self.file.flush().map_err(|source| RecordError::Write { path: self.path.clone(), source })
    }

    /// Writes what is still held back and closes the file. Without this call the end of the recording may be missing.
    ///
    /// # Errors
    /// [`RecordError::Write`] if the system refuses.
    pub fn finish(mut self) -> Result<(), RecordError> {
        self.words.clear();
        self.put_words()?;
        self.file.flush().map_err(|source| RecordError::Write { path: self.path, source })
    }

    fn put_words(&mut self) -> Result<(), RecordError> {
        let write_error = |source| RecordError::Write { path: self.path.clone(), source };
        if !self.header_written {
            self.header_written = true;
            let header = header(self.geometry, self.encoder.origin());
            self.file.write_all(header.as_bytes()).map_err(write_error)?;
        }
        self.file.write_all(&self.words).map_err(write_error)
    }
}

fn header(geometry: Geometry, origin: Option<CameraMicros>) -> String {
    let Geometry { width, height } = geometry;
    let origin = match origin {
        Some(CameraMicros(origin)) if origin != 0 => format!("% {ORIGIN_KEY} {origin}\n"),
        _ => String::new(),
    };
    // The first four are those that the format's description calls mandatory.
    format!(
        "% integrator_name evfocus\n% plugin_name evfocus\n% serial_number 00000000\n% system_ID 49\n\
         % evt 3.0\n% format EVT3;height={height};width={width}\n% geometry {width}x{height}\n{origin}% end\n"
    )
}
