//! Packets are compressed one by one, each a complete frame.

use std::io::{self, Read};

use lz4_flex::frame::FrameDecoder;
use ruzstd::decoding::StreamingDecoder;

use super::MAX_PACKET_BYTES;

/// How the packets of a file are compressed; field 0 of the file's description.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Compression {
    None,
    Lz4,
    Zstd,
}

impl Compression {
    /// The compression with this number; the "high" levels differ only for the writer.
    pub(super) fn from_number(number: i32) -> Option<Self> {
        match number {
            0 => Some(Self::None),
            1 | 2 => Some(Self::Lz4),
            3 | 4 => Some(Self::Zstd),
            _ => None,
        }
    }

    /// Replaces the content of `out` with the packet decompressed. An error if the packet is damaged or larger than
    /// [`MAX_PACKET_BYTES`].
    pub(super) fn decompress(self, packet: &[u8], out: &mut Vec<u8>) -> io::Result<()> {
        out.clear();
        match self {
            Self::None => out.extend_from_slice(packet),
            Self::Lz4 => read_bounded(FrameDecoder::new(packet), out)?,
            Self::Zstd => {
                let decoder = StreamingDecoder::new(packet).map_err(io::Error::other)?;
                read_bounded(decoder, out)?;
            }
        }
        Ok(())
    }
}

/// A small packet may claim to hold anything, so the limit is on what comes out.
fn read_bounded(decoder: impl Read, out: &mut Vec<u8>) -> io::Result<()> {
    decoder.take(MAX_PACKET_BYTES as u64 + 1).read_to_end(out)?;
    if out.len() > MAX_PACKET_BYTES {
        return Err(io::Error::other("the packet is larger than any real one"));
    }
    Ok(())
}
