//! Reads the events of AEDAT 4 files packet by packet.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;

use evfocus_core::{CameraMicros, Damage, DoesNotFit, Event, EventBatch, Geometry, Polarity};

use super::compression::Compression;
use super::description::{EventStream, first_event_stream};
use super::flatbuffer::Table;
use super::{EVENT_BYTES, MAX_DESCRIPTION_BYTES, MAX_PACKET_BYTES, PACKET_HEADER_BYTES, VERSION_LINE};
use crate::{Format, MAX_EVENTS_PER_READ, RecordError};

/// The first stream of events of a file; its other streams are passed over.
#[derive(Debug)]
pub(crate) struct Aedat4Source {
    file: BufReader<File>,
    /// Bytes from the start of the file.
    position: u64,
    /// Where the packets end, if the file says so.
    end: Option<u64>,
    compression: Compression,
    stream: EventStream,
    packet: Vec<u8>,
    content: Vec<u8>,
    /// The part of `content` that has not been handed out.
    pending: Range<usize>,
    damage: Damage,
}

/// A flatbuffer in a packet is preceded by its size.
const SIZE_PREFIX_BYTES: usize = 4;
const COPY_AGAIN: &str = "the file is damaged; record or copy it again";

impl Aedat4Source {
    pub(crate) fn open(path: &Path, mut file: File) -> Result<Self, RecordError> {
        let read_error = |source| RecordError::Read { path: path.to_owned(), source };
        let content_error = |offset, what: String, remedy| RecordError::Content {
            path: path.to_owned(),
            offset,
            what,
            remedy,
        };
        file.seek(SeekFrom::Start(0)).map_err(read_error)?;
        let mut file = BufReader::new(file);
        let mut start = Vec::new();
        let fixed = VERSION_LINE.len() + SIZE_PREFIX_BYTES;
        file.by_ref().take(fixed as u64).read_to_end(&mut start).map_err(read_error)?;
        let size = start.strip_prefix(VERSION_LINE).and_then(|size| size.first_chunk::<SIZE_PREFIX_BYTES>());
        let Some(size) = size.map(|&size| u32::from_le_bytes(size)) else {
            let what =
                String::from("the first line of an AEDAT4 file and the size of its description are missing");
            return Err(content_error(0, what, COPY_AGAIN));
        };
        if size as usize > MAX_DESCRIPTION_BYTES {
            let what = format!("a description of {size} bytes is larger than any real one");
            return Err(content_error(VERSION_LINE.len() as u64, what, COPY_AGAIN));
        }
        let mut description = Vec::new();
        file.by_ref().take(u64::from(size)).read_to_end(&mut description).map_err(read_error)?;
        let fixed = fixed as u64;
        if description.len() < size as usize {
            let what = String::from("the file ends within its description");
            return Err(content_error(fixed, what, COPY_AGAIN));
        }
        let Some(table) = Table::root(&description, *b"IOHE") else {
            return Err(content_error(fixed, String::from("the description is not readable"), COPY_AGAIN));
        };
        let number = table.i32(0).unwrap_or(0);
        let Some(compression) = Compression::from_number(number) else {
            let what = format!("the packets are compressed in an unknown way, number {number}");
            return Err(content_error(fixed, what, "write the file again with LZ4 or zstd compression"));
        };
        let xml = table.string(2);
        let Some(stream) = first_event_stream(&xml) else {
            return Err(RecordError::Unrecognised {
                path: path.to_owned(),
                found: String::from("an AEDAT4 file without a stream of events"),
                remedy: format!("record the camera's events; {}", Format::supported()),
            });
        };
        let position = fixed + u64::from(size);
        let end = table.i64(1).and_then(|end| u64::try_from(end).ok()).filter(|&end| end >= position);
        Ok(Self {
            file,
            position,
            end,
            compression,
            stream,
            packet: Vec::new(),
            content: Vec::new(),
            pending: 0..0,
            damage: Damage::default(),
        })
    }

    pub(crate) fn geometry(&self) -> Option<Geometry> {
        self.stream.geometry
    }

    pub(crate) fn damage(&self) -> Damage {
        self.damage
    }

    /// Appends events until there are some; `false` at the end of the file.
    pub(crate) fn read(&mut self, path: &Path, batch: &mut EventBatch) -> Result<bool, RecordError> {
        loop {
            self.hand_out(batch);
            if !batch.events.is_empty() {
                batch.reached = batch.events.last().map(|event| event.t);
                return Ok(true);
            }
            if !self.next_packet(path)? {
                return Ok(false);
            }
        }
    }

    fn hand_out(&mut self, batch: &mut EventBatch) {
        let geometry = self.stream.geometry;
        let bytes = self.content.get(self.pending.clone()).unwrap_or_default();
        let mut dropped = 0;
        for bytes in bytes.as_chunks::<EVENT_BYTES>().0.iter().take(MAX_EVENTS_PER_READ) {
            self.pending.start += EVENT_BYTES;
            match event(bytes) {
                Some(event) if geometry.is_none_or(|geometry| geometry.contains(event.x, event.y)) => {
                    match batch.events.push(event) {
                        Ok(()) => {}
                        Err(DoesNotFit::Address { .. }) => dropped += 1,
                        Err(DoesNotFit::Time { .. }) => {
                            // It will be the first of the next batch.
                            self.pending.start -= EVENT_BYTES;
                            break;
                        }
                    }
                }
                _ => dropped += 1,
            }
        }
        self.damage.outside_sensor += dropped;
        batch.lost += dropped;
    }

    /// Reads on to the next packet of events; `false` at the end of the file.
    fn next_packet(&mut self, path: &Path) -> Result<bool, RecordError> {
        let read_error = |source| RecordError::Read { path: path.to_owned(), source };
        while self.end.is_none_or(|end| self.position < end) {
            let mut header = Vec::with_capacity(PACKET_HEADER_BYTES);
            let count = read_up_to(&mut self.file, PACKET_HEADER_BYTES, &mut header).map_err(read_error)?;
            let Some((id, size)) = packet_header(&header) else {
                self.damage.trailing_bytes += count;
                self.end = Some(self.position);
                return Ok(false);
            };
            let size = usize::try_from(size).ok().filter(|&size| size <= MAX_PACKET_BYTES);
            let Some(size) = size else {
                return Err(RecordError::Content {
                    path: path.to_owned(),
                    offset: self.position,
                    what: String::from("no packet can have the size given here"),
                    remedy: COPY_AGAIN,
                });
            };
            let count_payload = read_up_to(&mut self.file, size, &mut self.packet).map_err(read_error)?;
            self.position += count + count_payload;
            if self.packet.len() < size {
                self.damage.trailing_bytes += count + count_payload;
                self.end = Some(self.position);
                return Ok(false);
            }
            if id == self.stream.id && self.unpack() {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Decompresses the packet and finds its events; counts it as bad if that fails.
    fn unpack(&mut self) -> bool {
        self.pending = 0..0;
        let events = match self.compression.decompress(&self.packet, &mut self.content) {
            Ok(()) => events_in(&self.content),
            Err(_) => None,
        };
        self.damage.bad_packets += u64::from(events.is_none());
        self.pending = events.unwrap_or(0..0);
        !self.pending.is_empty()
    }
}

/// Where the events are in a decompressed packet: a size-prefixed flatbuffer.
fn events_in(content: &[u8]) -> Option<Range<usize>> {
    let (size, buffer) = content.split_first_chunk::<SIZE_PREFIX_BYTES>()?;
    let buffer = buffer.get(..u32::from_le_bytes(*size) as usize)?;
    let table = Table::root(buffer, *b"EVTS")?;
    if !table.has(0) {
        return Some(0..0);
    }
    let events = table.vector(0, EVENT_BYTES)?;
    Some(events.start + SIZE_PREFIX_BYTES..events.end + SIZE_PREFIX_BYTES)
}

/// The event in 16 bytes; `None` for a negative coordinate.
fn event(bytes: &[u8; EVENT_BYTES]) -> Option<Event> {
    let [t @ .., x0, x1, y0, y1, on, _, _, _] = *bytes;
    Some(Event {
        t: CameraMicros(i64::from_le_bytes(t)),
        x: u16::try_from(i16::from_le_bytes([x0, x1])).ok()?,
        y: u16::try_from(i16::from_le_bytes([y0, y1])).ok()?,
        polarity: Polarity::from_on(on != 0),
    })
}

fn packet_header(bytes: &[u8]) -> Option<(i32, i32)> {
    let (id, rest) = bytes.split_first_chunk::<4>()?;
    Some((i32::from_le_bytes(*id), i32::from_le_bytes(*rest.first_chunk()?)))
}

/// Replaces the content of `out` with `size` bytes, or with what there is; memory grows with what there is, not with what a
/// damaged file promises.
fn read_up_to(file: &mut impl Read, size: usize, out: &mut Vec<u8>) -> io::Result<u64> {
    out.clear();
    Ok(file.take(size as u64).read_to_end(out)? as u64)
}
