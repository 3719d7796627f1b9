//! Reads events from text files line by line.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use evfocus_core::{DoesNotFit, Event, EventBatch, Geometry};

use super::layout::is_blank;
use super::{Layout, MAX_LINE_BYTES};
use crate::{READ_BYTES, RecordError};

/// The events of a text file.
#[derive(Debug)]
pub(crate) struct CsvSource {
    file: BufReader<File>,
    layout: Layout,
    line: Vec<u8>,
    line_number: u64,
    header_passed: bool,
    /// Too far in time from the events of the batch before.
    held: Option<Event>,
}

/// Events handed out at a time.
const EVENTS_PER_READ: usize = READ_BYTES;
const REMEDY: &str = "correct or remove the line";

impl CsvSource {
    /// Opens a text file whose first bytes are `start`.
    pub(crate) fn open(path: &Path, mut file: File, start: &[u8]) -> Result<Self, RecordError> {
        file.seek(SeekFrom::Start(0))
            .map_err(|source| RecordError::Read { path: path.to_owned(), source })?;
        let start = String::from_utf8_lossy(start);
        let layout = Layout::detect(&start).map_err(|error| {
            let text = usize::try_from(error.line).ok().and_then(|line| start.lines().nth(line - 1));
            RecordError::Line {
                path: path.to_owned(),
                line: error.line,
                what: error.what,
                text: shortened(text.unwrap_or_default()),
                remedy: "begin the file with a line such as t_us,x,y,p",
            }
        })?;
        let file = BufReader::with_capacity(READ_BYTES, file);
        Ok(Self { file, layout, line: Vec::new(), line_number: 0, header_passed: false, held: None })
    }

    pub(crate) fn geometry(&self) -> Option<Geometry> {
        self.layout.geometry()
    }

    /// Appends events; `false` with none at the end of the file.
    pub(crate) fn read(&mut self, path: &Path, batch: &mut EventBatch) -> Result<bool, RecordError> {
        if let Some(held) = self.held.take() {
            batch.events.append([held]);
        }
        while batch.events.len() < EVENTS_PER_READ {
            self.line.clear();
            let limit = MAX_LINE_BYTES as u64 + 1;
            let count = self.file.by_ref().take(limit).read_until(b'\n', &mut self.line);
            let count = count.map_err(|source| RecordError::Read { path: path.to_owned(), source })?;
            if count == 0 {
                break;
            }
            self.line_number += 1;
            let line_error = |what, text: &str| RecordError::Line {
                path: path.to_owned(),
                line: self.line_number,
                what,
                text: shortened(text),
                remedy: REMEDY,
            };
            let Ok(line) = std::str::from_utf8(&self.line) else {
                let text = String::from_utf8_lossy(&self.line);
                return Err(line_error(String::from("not text"), &text));
            };
            if count > MAX_LINE_BYTES {
                return Err(line_error(format!("longer than {MAX_LINE_BYTES} bytes"), line));
            }
            let line = line.trim_start_matches('\u{feff}').trim();
            if is_blank(line) {
                continue;
            }
            if self.layout.has_header() && !self.header_passed {
                self.header_passed = true;
                continue;
            }
            let event = self.layout.parse(line).map_err(|what| line_error(what, line))?;
            match batch.events.push(event) {
                Ok(()) => {}
                Err(DoesNotFit::Time { .. }) => {
                    self.held = Some(event);
                    break;
                }
                Err(unfit @ DoesNotFit::Address { .. }) => return Err(line_error(unfit.to_string(), line)),
            }
        }
        batch.reached = batch.events.last().map(|event| event.t);
        Ok(!batch.events.is_empty())
    }
}

fn shortened(text: &str) -> String {
    text.chars().take(80).collect()
}
