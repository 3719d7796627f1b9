//! AEDAT 4, iniVation's container ("AEDAT file formats", inivation-docs): a version line, a size-prefixed flatbuffer that
//! describes the streams, then packets of one stream each, compressed one by one.

mod compression;
mod description;
mod flatbuffer;
mod reader;
mod writer;

pub use writer::{Aedat4Compression, Aedat4Writer};

pub(crate) use reader::Aedat4Source;

/// The largest packet, compressed or not, that is read; real ones hold some milliseconds.
pub const MAX_PACKET_BYTES: usize = 64 << 20;
/// The first line of the file.
const VERSION_LINE: &[u8] = b"#!AER-DAT4.0\r\n";
/// The largest description of streams that is read.
const MAX_DESCRIPTION_BYTES: usize = 1 << 20;
/// Stream number and size, 32 bits each, before each packet.
const PACKET_HEADER_BYTES: usize = 8;
/// One event: time (64 bits), column, row (16 bits each), polarity (8 bits), three bytes of padding.
const EVENT_BYTES: usize = 16;
