//! Writes AEDAT 4 files with one stream of events.

use std::borrow::Borrow;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use evfocus_core::{Event, Geometry};
use lz4_flex::frame::FrameEncoder;

use super::{EVENT_BYTES, VERSION_LINE};
use crate::RecordError;
use crate::encode::EncodeError;

/// How the packets are compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Aedat4Compression {
    /// Not at all: 16 bytes an event.
    None,
    /// LZ4, what iniVation's own software writes.
    #[default]
    Lz4,
}

/// Writes an AEDAT 4 file that iniVation's tools read. Nothing is lost; times may go back.
///
/// The file has no table of its packets, which the format allows: it is complete up to its last packet at any moment, and
/// readers make the table themselves.
#[derive(Debug)]
pub struct Aedat4Writer {
    path: PathBuf,
    file: BufWriter<File>,
    geometry: Geometry,
    compression: Aedat4Compression,
    pending: Vec<Event>,
}

/// Events per packet: some milliseconds of a busy camera.
const PACKET_EVENTS: usize = 8192;
/// The number of the only stream.
const STREAM: i32 = 0;
/// Coordinates are signed 16-bit numbers.
const MAX_GEOMETRY: Geometry = Geometry { width: 1 << 15, height: 1 << 15 };

impl Aedat4Writer {
    /// Creates the file, or empties it. Times should be Unix time in microseconds, as the format has it; others are written
    /// as they are.
    ///
    /// # Errors
    /// [`RecordError::Write`] if the system refuses, [`RecordError::Encode`] if the sensor is too large for the format.
    pub fn create(
        path: impl AsRef<Path>,
        geometry: Geometry,
        compression: Aedat4Compression,
    ) -> Result<Self, RecordError> {
        let path = path.as_ref().to_owned();
        if geometry.width > MAX_GEOMETRY.width || geometry.height > MAX_GEOMETRY.height {
            let source = EncodeError::SensorTooLarge { geometry, max: MAX_GEOMETRY };
            return Err(RecordError::Encode { path, source });
        }
        let create = || {
            let mut file = BufWriter::new(File::create(&path)?);
            file.write_all(VERSION_LINE)?;
            file.write_all(&description(geometry, compression))?;
            Ok(file)
        };
        match create() {
            Ok(file) => Ok(Self { path, file, geometry, compression, pending: Vec::new() }),
            Err(source) => Err(RecordError::Write { path, source }),
        }
    }

    /// Appends events.
    ///
    /// # Errors
    /// [`RecordError::Encode`] for an event outside of the sensor (those before it are written), [`RecordError::Write`] if
    /// the system refuses.
    pub fn write(&mut self, events: impl IntoIterator<Item: Borrow<Event>>) -> Result<(), RecordError> {
        for event in events {
            let event = *event.borrow();
            if !self.geometry.contains(event.x, event.y) {
                let source = EncodeError::OutsideSensor { event, geometry: self.geometry };
                return Err(RecordError::Encode { path: self.path.clone(), source });
            }
            self.pending.push(event);
            if self.pending.len() == PACKET_EVENTS {
                self.put_packet()?;
            }
        }
        Ok(())
    }

    /// Hands what was written to the system, so that it outlives this program; a packet that is not full is ended.
    ///
    /// # Errors
    /// [`RecordError::Write`] if it refuses.
    pub fn flush(&mut self) -> Result<(), RecordError> {
        if !self.pending.is_empty() {
            self.put_packet()?;
        }
        self.file.flush().map_err(|source| RecordError::Write { path: self.path.clone(), source })
    }

    /// Writes what is still held back and closes the file. Without this call the end of the recording is missing.
    ///
    /// # Errors
    /// [`RecordError::Write`] if the system refuses.
    pub fn finish(mut self) -> Result<(), RecordError> {
        self.flush()
    }

    fn put_packet(&mut self) -> Result<(), RecordError> {
        let content = event_packet(&self.pending);
        self.pending.clear();
        let written = compress(self.compression, content).and_then(|payload| {
            // A packet is at most a few hundred kilobytes, so its size fits.
            self.file.write_all(&STREAM.to_le_bytes())?;
            self.file.write_all(&(payload.len() as i32).to_le_bytes())?;
            self.file.write_all(&payload)
        });
        written.map_err(|source| RecordError::Write { path: self.path.clone(), source })
    }
}

fn compress(compression: Aedat4Compression, content: Vec<u8>) -> io::Result<Vec<u8>> {
    match compression {
        Aedat4Compression::None => Ok(content),
        Aedat4Compression::Lz4 => {
            let mut encoder = FrameEncoder::new(Vec::new());
            encoder.write_all(&content)?;
            encoder.finish().map_err(io::Error::other)
        }
    }
}

/// A size-prefixed flatbuffer "EVTS": a table whose only field is the vector of events.
fn event_packet(events: &[Event]) -> Vec<u8> {
    // After the size: root offset 0, identifier 4, vtable 8, padding 14, table 16, vector 24, first event 28. With the size
    // before them, the events start at a multiple of eight, as the format demands.
    let mut content = Vec::with_capacity(32 + events.len() * EVENT_BYTES);
    put_u32(&mut content, 28 + (events.len() * EVENT_BYTES) as u32);
    put_u32(&mut content, 16);
    content.extend_from_slice(b"EVTS");
    // The vtable's size, the table's size, where field 0 is in the table; padding.
    put_u16s(&mut content, &[6, 8, 4, 0]);
    // The table: the distance back to the vtable, the distance on to the vector.
    put_u32(&mut content, 8);
    put_u32(&mut content, 4);
    put_u32(&mut content, events.len() as u32);
    for event in events {
        content.extend_from_slice(&event.t.0.to_le_bytes());
        content.extend_from_slice(&event.x.to_le_bytes());
        content.extend_from_slice(&event.y.to_le_bytes());
        content.extend_from_slice(&[u8::from(event.polarity.is_on()), 0, 0, 0]);
    }
    content
}

/// A size-prefixed flatbuffer "IOHE": compression, position of the packet table (-1: none), XML description.
fn description(geometry: Geometry, compression: Aedat4Compression) -> Vec<u8> {
    let (number, name) = match compression {
        Aedat4Compression::None => (0, "NONE"),
        Aedat4Compression::Lz4 => (1, "LZ4"),
    };
    let xml = xml(geometry, name);
    // After the size: root offset 0, identifier 4, padding 8, vtable 14, table 24 (distance to the vtable, compression 28,
    // string offset 32, table position 36, padding 44), string 48.
    let mut buffer = Vec::new();
    put_u32(&mut buffer, 24);
    buffer.extend_from_slice(b"IOHE");
    put_u16s(&mut buffer, &[0, 0, 0]);
    put_u16s(&mut buffer, &[10, 24, 4, 12, 8]);
    put_u32(&mut buffer, 10);
    put_u32(&mut buffer, number);
    put_u32(&mut buffer, 16);
    buffer.extend_from_slice(&(-1_i64).to_le_bytes());
    put_u32(&mut buffer, 0);
    put_u32(&mut buffer, xml.len() as u32);
    buffer.extend_from_slice(xml.as_bytes());
    // The string ends with a zero; the whole with the size before it is a multiple of eight.
    buffer.push(0);
    buffer.resize((buffer.len() + 4).next_multiple_of(8) - 4, 0);
    let mut prefixed = (buffer.len() as u32).to_le_bytes().to_vec();
    prefixed.append(&mut buffer);
    prefixed
}

fn xml(geometry: Geometry, compression: &str) -> String {
    let Geometry { width, height } = geometry;
    format!(
        r#"<dv version="2.0">
    <node name="outInfo" path="/outInfo/">
        <node name="{STREAM}" path="/outInfo/{STREAM}/">
            <attr key="compression" type="string">{compression}</attr>
            <attr key="originalModuleName" type="string">evfocus</attr>
            <attr key="originalOutputName" type="string">events</attr>
            <attr key="typeDescription" type="string">Array of events (polarity ON/OFF).</attr>
            <attr key="typeIdentifier" type="string">EVTS</attr>
            <node name="info" path="/outInfo/{STREAM}/info/">
                <attr key="sizeX" type="int">{width}</attr>
                <attr key="sizeY" type="int">{height}</attr>
                <attr key="source" type="string">evfocus</attr>
            </node>
        </node>
    </node>
</dv>
"#
    )
}

fn put_u32(out: &mut Vec<u8>, value: u32) {
    out.extend_from_slice(&value.to_le_bytes());
}

fn put_u16s(out: &mut Vec<u8>, values: &[u16]) {
    for value in values {
        out.extend_from_slice(&value.to_le_bytes());
    }
}
