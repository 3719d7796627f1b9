//! Counting the events of a DAVIS346's words without their coordinates.

use core::ops::Range;

use super::time::{DavisTime, TIME_PERIOD_US};
use super::{COLUMN_KIND, Word, special};
use crate::decode::TimeRule;
use crate::decode::bins::OpenBin;
use crate::decode::framing::Framing;
use crate::decode::runs::{BLOCK, bits};
use crate::decode::vectorized::{TakeWords, take_words};
use crate::units::CameraMicros;

/// Counts events into time bins straight from the words.
///
/// It counts what [`DavisWordDecoder::live`](super::DavisWordDecoder::live) decodes, and also what that drops for an address that
/// is missing or not on the sensor ([`EventBatch::lost`](crate::EventBatch::lost)); in a sound stream there is none.
#[derive(Debug, Clone)]
pub struct DavisWordCounter {
    framing: Framing<2>,
    state: State,
}

#[derive(Debug, Clone)]
struct State {
    time: DavisTime,
    bin: OpenBin,
}

impl DavisWordCounter {
    /// A counter into bins of `bin_us` microseconds (at least 1), which begin at multiples of that.
    pub fn new(bin_us: u32) -> Self {
        let state = State { time: DavisTime::new(TimeRule::Ascending), bin: OpenBin::new(bin_us) };
        Self { framing: Framing::new(), state }
    }

    /// Counts the events in `bytes`; `out` gets the start of each bin that has events, and how many. A bin that is still open
    /// at the end of `bytes` is handed out as far as it is known, and the rest of it in the next call.
    pub fn count(&mut self, bytes: &[u8], mut out: impl FnMut(CameraMicros, u64)) {
        let state = &mut self.state;
        self.framing.feed_slices(bytes, |words| take_words(state, words, &mut out));
        state.bin.flush(&mut out);
    }

    /// The newest time; `None` before the first.
    pub fn reached(&self) -> Option<CameraMicros> {
        self.state.time.now().map(CameraMicros)
    }
}

/// The word that tells time 0 since the last wrap.
const TIME_WORD: u32 = 0x8000;
/// A word without events and without time.
const FILLER: [u8; 2] = 0x6000_u16.to_le_bytes();

impl<Out: FnMut(CameraMicros, u64)> TakeWords<Out> for State {
    #[inline(always)]
    fn take_words(&mut self, words: &[[u8; 2]], out: &mut Out) {
        let (blocks, rest) = words.as_chunks();
        for block in blocks {
            self.block(block, out);
        }
        if !rest.is_empty() {
            let mut block = [FILLER; BLOCK];
            for (slot, &word) in block.iter_mut().zip(rest) {
                *slot = word;
            }
            self.block(&block, out);
        }
    }
}

impl State {
    /// Goes from one word of time to the next; the events between them are a number of bits.
    #[inline(always)]
    fn block(&mut self, block: &[[u8; 2]; BLOCK], out: &mut impl FnMut(CameraMicros, u64)) {
        let mut events = bits(block, |word| word >> 13 == COLUMN_KIND);
        let mut times = bits(block, tells_time);
        let mut steady = self.steady();
        while times != 0 {
            let index = times.trailing_zeros();
            times &= times - 1;
            let word = block.get(index as usize).map_or(0, |&bytes| u16::from_le_bytes(bytes));
            if steady.contains(&u32::from(word)) {
                steady.start = u32::from(word);
                continue;
            }
            self.reach(steady.start);
            let before = !(u64::MAX << index);
            if self.time.now().is_some() {
                self.bin.add(u64::from((events & before).count_ones()));
            }
            events &= !before;
            match Word::of(word) {
                Word::Time(low) => self.time.low(low),
                Word::Wrap(times) => self.time.wrap(times),
                Word::Special(_) => self.time.reset(),
                Word::Row(_) | Word::Column(..) | Word::NoEvents => {}
            }
            if let Some(now) = self.time.now() {
                self.bin.move_to(now, out);
            }
            steady = self.steady();
        }
        self.reach(steady.start);
        if self.time.now().is_some() {
            self.bin.add(u64::from(events.count_ones()));
        }
    }

    /// The time words that do not fall and stay in the open bin: the first is that of the newest time. None before there is a time.
    fn steady(&self) -> Range<u32> {
        let word = |time_us: i64| {
            TIME_WORD + time_us.saturating_sub(self.time.wraps_us()).clamp(0, TIME_PERIOD_US) as u32
        };
        word(self.time.now().unwrap_or(i64::MAX))..word(self.bin.range().1)
    }

    /// Takes note of the newest time word, if there has been a time.
    fn reach(&mut self, word: u32) {
        // Of a time that no word tells the clamped one is no news.
        if self.time.now().is_some() && word < TIME_WORD + TIME_PERIOD_US as u32 {
            self.time.advance_to(self.time.wraps_us() + i64::from(word - TIME_WORD));
        }
    }
}

/// Whether a word is a time, a wrap or a reset.
#[inline(always)]
fn tells_time(word: u16) -> bool {
    (word & 0x8000 != 0) | (word >> 12 == 7) | (word == special::TIMESTAMP_RESET)
}
