//! A recording on disk, whatever its format.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use evfocus_core::decode::{DavisWordDecoder, Evt3Decoder};
use evfocus_core::{Damage, EventBatch, Events, Geometry};

use crate::aedat4::Aedat4Source;
use crate::csv::CsvSource;
use crate::raw_header::{MAX_HEADER_BYTES, RawHeader};
use crate::sniff::{Sniffed, sniff};
use crate::words::{WordDecoder, WordSource};
use crate::{Format, RecordError};

/// Bytes read from a file at a time.
pub const READ_BYTES: usize = 16 * 1024;
/// The most events that one [`Recording::read`] appends; a batch of this capacity never grows.
pub const MAX_EVENTS_PER_READ: usize = READ_BYTES * Evt3Decoder::MAX_EVENTS_PER_BYTE;

/// A recording, read from start to end in bounded memory.
///
/// ```no_run
/// # use evfocus_core::EventBatch;
/// # use evfocus_record::{MAX_EVENTS_PER_READ, RecordError, Recording};
/// # fn main() -> Result<(), RecordError> {
/// let mut recording = Recording::open("sweep.raw", None)?;
/// let mut batch = EventBatch::with_capacity(MAX_EVENTS_PER_READ);
/// while recording.read(&mut batch)? {
///     // batch.events, in the order of the file
/// }
/// println!("{:?}", recording.damage());
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Recording {
    path: PathBuf,
    format: Format,
    geometry: Option<Geometry>,
    source: Source,
    last_time: i64,
    time_reversals: u64,
}

#[derive(Debug)]
enum Source {
    Words(WordSource),
    Aedat4(Aedat4Source),
    Csv(CsvSource),
}

impl Recording {
    /// Opens the recording at `path`. Without a `format` the content decides what it is, not the name; with one, the file
    /// is read as that, whatever it looks like.
    ///
    /// # Errors
    /// [`RecordError::Open`] and [`RecordError::Read`] if the system refuses, [`RecordError::Unrecognised`] if the content
    /// is nothing that evfocus reads, and the errors of the formats' headers.
    pub fn open(path: impl AsRef<Path>, format: Option<Format>) -> Result<Self, RecordError> {
        let path = path.as_ref();
        let mut file = File::open(path).map_err(|source| RecordError::Open {
            path: path.to_owned(),
            remedy: "check its name and who may read it",
            source,
        })?;
        let read_error = |source| RecordError::Read { path: path.to_owned(), source };
        let mut start = Vec::new();
        file.by_ref().take(MAX_HEADER_BYTES as u64).read_to_end(&mut start).map_err(read_error)?;
        let format = match format {
            Some(format) => format,
            None => match sniff(path, &start) {
                Sniffed::Is(format) => format,
                Sniffed::Foreign { found, remedy } => {
                    return Err(RecordError::Unrecognised { path: path.to_owned(), found, remedy });
                }
            },
        };
        let (geometry, source) = match format {
            Format::Evt3 | Format::Evt2 => {
                let header = RawHeader::parse(&start);
                let decoder = if format == Format::Evt3 {
                    WordDecoder::evt3(header.geometry, header.origin_us)
                } else {
                    WordDecoder::evt2(header.geometry, header.origin_us)
                };
                let source = WordSource::new(file, header.data_start as u64, decoder).map_err(read_error)?;
                (header.geometry, Source::Words(source))
            }
            Format::DavisWords => {
                let source = WordSource::new(file, 0, WordDecoder::davis()).map_err(read_error)?;
                (Some(DavisWordDecoder::GEOMETRY), Source::Words(source))
            }
            Format::Aedat4 => {
                let source = Aedat4Source::open(path, file)?;
                (source.geometry(), Source::Aedat4(source))
            }
            Format::Csv => {
                let source = CsvSource::open(path, file, &start)?;
                (source.geometry(), Source::Csv(source))
            }
        };
        let path = path.to_owned();
        Ok(Self { path, format, geometry, source, last_time: i64::MIN, time_reversals: 0 })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What the file turned out to be.
    pub fn format(&self) -> Format {
        self.format
    }

    /// The sensor's size if the file tells it; a summary infers it where it does not.
    pub fn geometry(&self) -> Option<Geometry> {
        self.geometry
    }

    /// Empties the batch and fills it with the next events, in the order of the file, at most [`MAX_EVENTS_PER_READ`].
    /// Returns `false`, with no events, at the end of the file; `true` comes with at least one event.
    ///
    /// Times do not go back unless the file's do; such events are delivered all the same, and counted in
    /// [`Damage::time_reversals`].
    ///
    /// # Errors
    /// [`RecordError::Read`] if the system refuses, [`RecordError::Content`] and [`RecordError::Line`] for content that
    /// cannot be passed over.
    pub fn read(&mut self, batch: &mut EventBatch) -> Result<bool, RecordError> {
        batch.clear();
        let more = match &mut self.source {
            Source::Words(source) => {
                source.read(batch).map_err(|source| RecordError::Read { path: self.path.clone(), source })?
            }
            Source::Aedat4(source) => source.read(&self.path, batch)?,
            Source::Csv(source) => source.read(&self.path, batch)?,
        };
        self.count_reversals(batch.events.as_slice());
        Ok(more)
    }

    /// What was found wrong with what has been read so far.
    pub fn damage(&self) -> Damage {
        let damage = match &self.source {
            Source::Words(source) => source.damage(),
            Source::Aedat4(source) => source.damage(),
            Source::Csv(_) => Damage::default(),
        };
        Damage { time_reversals: self.time_reversals, ..damage }
    }

    /// Edges at the camera's external inputs in what has been read so far; `None` if the format does not tell.
    pub fn triggers(&self) -> Option<u64> {
        match &self.source {
            Source::Words(source) => Some(source.triggers()),
            Source::Aedat4(_) | Source::Csv(_) => None,
        }
    }

    fn count_reversals(&mut self, events: Events<'_>) {
        for event in events.iter() {
            self.time_reversals += u64::from(event.t.0 < self.last_time);
            self.last_time = event.t.0;
        }
    }
}
