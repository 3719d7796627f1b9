//! What evfocus does with the words.

use std::hint::black_box;

use evfocus_core::EventBatch;
use evfocus_core::decode::{DavisWordCounter, DavisWordDecoder, Evt3Counter, Evt3Decoder};

use crate::streams::{BIN_US, SENSOR};
use crate::{TRANSFER_BYTES, Work};

macro_rules! contestant {
    ($count:ident: $counter:expr, $decode:ident: $decoder:expr, $counter_type:ty, $decoder_type:ty) => {
        /// Counts into bins.
        pub struct $count($counter_type);

        impl $count {
            pub fn new() -> Self {
                Self($counter)
            }
        }

        impl Work for $count {
            fn begin(&mut self) {
                self.0 = $counter;
            }

            fn transfer(&mut self, bytes: &[u8]) -> u64 {
                let mut total = 0;
                self.0.count(bytes, |_, events| total += black_box(events));
                total
            }
        }

        /// Decodes into a batch.
        pub struct $decode($decoder_type, EventBatch);

        impl $decode {
            pub fn new() -> Self {
                let capacity = TRANSFER_BYTES * Evt3Decoder::MAX_EVENTS_PER_BYTE;
                Self($decoder, EventBatch::with_capacity(capacity))
            }
        }

        impl Work for $decode {
            fn begin(&mut self) {
                self.0 = $decoder;
            }

            fn transfer(&mut self, bytes: &[u8]) -> u64 {
                self.1.clear();
                self.0.decode(bytes, &mut self.1);
                black_box(&self.1).events.len() as u64
            }
        }
    };
}

contestant!(Evt3Count: Evt3Counter::new(BIN_US), Evt3Decode: Evt3Decoder::live(SENSOR), Evt3Counter, Evt3Decoder);
contestant!(DavisCount: DavisWordCounter::new(BIN_US), DavisDecode: DavisWordDecoder::live(), DavisWordCounter, DavisWordDecoder);
