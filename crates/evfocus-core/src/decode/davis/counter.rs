//! Counting the events of a DAVIS346's words without their coordinates.

use super::time::DavisTime;
use super::{Word, special};
use crate::decode::TimeRule;
use crate::decode::bins::OpenBin;
use crate::decode::framing::Framing;
use crate::units::CameraMicros;

/// Counts events into time bins straight from the words.
///
/// It counts what [`DavisWordDecoder::live`](super::DavisWordDecoder::live) decodes, and also what that drops for an address that
/// is missing or not on the sensor ([`EventBatch::lost`](crate::EventBatch::lost)); in a sound stream there is none.
#[derive(Debug, Clone)]
pub struct DavisWordCounter {
    framing: Framing<2>,
    time: DavisTime,
    bin: OpenBin,
}

impl DavisWordCounter {
    /// A counter into bins of `bin_us` microseconds (at least 1), which begin at multiples of that.
    pub fn new(bin_us: u32) -> Self {
        Self { framing: Framing::new(), time: DavisTime::new(TimeRule::Ascending), bin: OpenBin::new(bin_us) }
    }

    /// Counts the events in `bytes`; `out` gets the start of each bin that has events, and how many. A bin that is still open
    /// at the end of `bytes` is handed out as far as it is known, and the rest of it in the next call.
    pub fn count(&mut self, bytes: &[u8], mut out: impl FnMut(CameraMicros, u64)) {
        let Self { framing, time, bin } = self;
        framing.feed(bytes, |word| {
            match Word::of(u16::from_le_bytes(word)) {
                Word::Column(..) => {
                    bin.add(u64::from(time.now().is_some()));
                    return;
                }
                Word::Time(low) => time.low(low),
                Word::Wrap(times) => time.wrap(times),
                Word::Special(special::TIMESTAMP_RESET) => time.reset(),
                Word::Special(_) | Word::Row(_) | Word::NoEvents => return,
            }
            if let Some(now) = time.now() {
                bin.move_to(now, &mut out);
            }
        });
        bin.flush(&mut out);
    }

    /// The newest time; `None` before the first.
    pub fn reached(&self) -> Option<CameraMicros> {
        self.time.now().map(CameraMicros)
    }
}
