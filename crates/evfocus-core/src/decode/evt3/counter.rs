//! Counting the events of EVT 3.0 words without their coordinates.

use super::time::Evt3Time;
use super::{PAYLOAD_MASK, word_type};
use crate::decode::TimeRule;
use crate::decode::bins::OpenBin;
use crate::decode::framing::Framing;
use crate::units::CameraMicros;

/// Words that are looked at together: enough for the compiler to use vector instructions, few enough to lie within one bin of
/// a fast stream.
const BLOCK: usize = 64;

/// Counts events into time bins straight from the words.
///
/// It counts what [`Evt3Decoder::live`](super::Evt3Decoder::live) decodes, and also what that drops for an address that is missing
/// or not on the sensor ([`EventBatch::lost`](crate::EventBatch::lost)); in a sound stream there is none.
#[derive(Debug, Clone)]
pub struct Evt3Counter {
    framing: Framing<2>,
    state: State,
}

#[derive(Debug, Clone)]
struct State {
    time: Evt3Time,
    bin: OpenBin,
}

impl Evt3Counter {
    /// A counter into bins of `bin_us` microseconds (at least 1), which begin at multiples of that.
    pub fn new(bin_us: u32) -> Self {
        let state = State { time: Evt3Time::new(TimeRule::Ascending, 0), bin: OpenBin::new(bin_us) };
        Self { framing: Framing::new(), state }
    }

    /// Counts the events in `bytes`; `out` gets the start of each bin that has events, and how many. A bin that is still open
    /// at the end of `bytes` is handed out as far as it is known, and the rest of it in the next call.
    pub fn count(&mut self, bytes: &[u8], mut out: impl FnMut(CameraMicros, u64)) {
        let state = &mut self.state;
        self.framing.feed_slices(bytes, |words| state.words(words, &mut out));
        state.bin.flush(&mut out);
    }

    /// The newest time; `None` before the first.
    pub fn reached(&self) -> Option<CameraMicros> {
        self.state.time.now().map(CameraMicros)
    }
}

impl State {
    fn words(&mut self, words: &[[u8; 2]], out: &mut impl FnMut(CameraMicros, u64)) {
        let (blocks, rest) = words.as_chunks::<BLOCK>();
        for block in blocks {
            match self.block(block) {
                Some((events, newest)) => {
                    self.bin.add(events);
                    self.time.low(newest);
                }
                None => self.one_by_one(block, out),
            }
        }
        self.one_by_one(rest, out);
    }

    /// The number of events in `block` and its newest fine time (0 without one), if all of it belongs to the open bin.
    fn block(&self, block: &[[u8; 2]; BLOCK]) -> Option<(u64, u16)> {
        self.time.now()?;
        let (high, coarse_us) = self.time.coarse();
        // The bin as fine times of the present coarse time: the first one, and how many there are.
        let (start_us, end_us) = self.bin.range();
        let first = start_us.saturating_sub(coarse_us).clamp(0, 4096) as u16;
        let width = (end_us.saturating_sub(coarse_us).clamp(0, 4096) as u16).saturating_sub(first);
        let (mut events, mut leaves, mut newest) = (0, 0, 0);
        for &bytes in block {
            let word = u16::from_le_bytes(bytes);
            let (kind, payload) = (word >> 12, word & PAYLOAD_MASK);
            let twelve = u16::from(kind == word_type::VECT_12) * 0xFFF;
            let eight = u16::from(kind == word_type::VECT_8) * 0xFF;
            events += (word & (twelve | eight)).count_ones() as u16 + u16::from(kind == word_type::ADDR_X);
            leaves |= u16::from(kind == word_type::TIME_HIGH) & u16::from(payload != high);
            let is_low = u16::from(kind == word_type::TIME_LOW);
            leaves |= is_low & u16::from(payload.wrapping_sub(first) >= width);
            newest = newest.max(is_low * payload);
        }
        (leaves == 0).then_some((u64::from(events), newest))
    }

    fn one_by_one(&mut self, words: &[[u8; 2]], out: &mut impl FnMut(CameraMicros, u64)) {
        for &bytes in words {
            let word = u16::from_le_bytes(bytes);
            let payload = word & PAYLOAD_MASK;
            let events = match word >> 12 {
                word_type::ADDR_X => 1,
                word_type::VECT_12 => payload.count_ones(),
                word_type::VECT_8 => (payload & 0xFF).count_ones(),
                word_type::TIME_LOW => {
                    self.time.low(payload);
                    self.time.now().inspect(|&now| self.bin.move_to(now, out));
                    0
                }
                word_type::TIME_HIGH => {
                    self.time.high(payload);
                    self.time.now().inspect(|&now| self.bin.move_to(now, out));
                    0
                }
                _ => 0,
            };
            if self.time.now().is_some() {
                self.bin.add(u64::from(events));
            }
        }
    }
}
