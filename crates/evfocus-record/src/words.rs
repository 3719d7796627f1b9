//! Files that are a header, if any, and then words.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

use evfocus_core::decode::{DavisWordDecoder, Evt2Decoder, Evt3Decoder};
use evfocus_core::{CameraMicros, Damage, EventBatch, Geometry};

use crate::READ_BYTES;

/// A decoder of one of the kinds of words.
#[derive(Debug)]
pub(crate) enum WordDecoder {
    Evt3(Box<Evt3Decoder>),
    Evt2(Evt2Decoder),
    Davis(DavisWordDecoder),
}

impl WordDecoder {
    pub(crate) fn evt3(geometry: Option<Geometry>, origin_us: i64) -> Self {
        let geometry = geometry.unwrap_or(Evt3Decoder::MAX_GEOMETRY);
        Self::Evt3(Box::new(Evt3Decoder::with_origin(geometry, CameraMicros(origin_us))))
    }

    pub(crate) fn evt2(geometry: Option<Geometry>, origin_us: i64) -> Self {
        let geometry = geometry.unwrap_or(Evt2Decoder::MAX_GEOMETRY);
        Self::Evt2(Evt2Decoder::with_origin(geometry, CameraMicros(origin_us)))
    }

    pub(crate) fn davis() -> Self {
        Self::Davis(DavisWordDecoder::new())
    }

    fn decode(&mut self, bytes: &[u8], batch: &mut EventBatch) {
        match self {
            Self::Evt3(decoder) => decoder.decode(bytes, batch),
            Self::Evt2(decoder) => decoder.decode(bytes, batch),
            Self::Davis(decoder) => decoder.decode(bytes, batch),
        }
    }

    fn finish(&mut self) {
        match self {
            Self::Evt3(decoder) => decoder.finish(),
            Self::Evt2(decoder) => decoder.finish(),
            Self::Davis(decoder) => decoder.finish(),
        }
    }
}

/// The words of a file, decoded chunk by chunk.
#[derive(Debug)]
pub(crate) struct WordSource {
    file: File,
    buffer: Vec<u8>,
    decoder: WordDecoder,
}

impl WordSource {
    /// Reads words from `data_start` on.
    pub(crate) fn new(mut file: File, data_start: u64, decoder: WordDecoder) -> io::Result<Self> {
        file.seek(SeekFrom::Start(data_start))?;
        Ok(Self { file, buffer: vec![0; READ_BYTES], decoder })
    }

    /// Appends events until there are some; `false` at the end of the file.
    pub(crate) fn read(&mut self, batch: &mut EventBatch) -> io::Result<bool> {
        loop {
            let count = match self.file.read(&mut self.buffer) {
                Ok(0) => {
                    self.decoder.finish();
                    return Ok(false);
                }
                Ok(count) => count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => return Err(error),
            };
            self.decoder.decode(self.buffer.get(..count).unwrap_or_default(), batch);
            if !batch.events.is_empty() {
                return Ok(true);
            }
        }
    }

    pub(crate) fn damage(&self) -> Damage {
        match &self.decoder {
            WordDecoder::Evt3(decoder) => decoder.damage(),
            WordDecoder::Evt2(decoder) => decoder.damage(),
            WordDecoder::Davis(decoder) => decoder.damage(),
        }
    }

    pub(crate) fn triggers(&self) -> u64 {
        match &self.decoder {
            WordDecoder::Evt3(decoder) => decoder.triggers(),
            WordDecoder::Evt2(decoder) => decoder.triggers(),
            WordDecoder::Davis(decoder) => decoder.triggers(),
        }
    }
}
