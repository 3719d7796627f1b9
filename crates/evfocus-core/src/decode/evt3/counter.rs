//! Counting the events of EVT 3.0 words without their coordinates.

use super::time::Evt3Time;
use super::{PAYLOAD_MASK, word_type};
use crate::decode::TimeRule;
use crate::decode::bins::OpenBin;
use crate::decode::framing::Framing;
use crate::decode::vectorized::{TakeWords, take_words};
use crate::units::CameraMicros;

/// Words that are looked at together: many enough that what they share costs little, few enough that most blocks of a fast stream
/// lie within one bin.
const BLOCK: usize = 128;
/// Words that are looked at one by one where a block leaves the bin. A bound on what a stream can cost in which every word does.
const STEP: usize = 8;

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
        self.framing.feed_slices(bytes, |words| take_words(state, words, &mut out));
        state.bin.flush(&mut out);
    }

    /// The newest time; `None` before the first.
    pub fn reached(&self) -> Option<CameraMicros> {
        self.state.time.now().map(CameraMicros)
    }
}

impl<Out: FnMut(CameraMicros, u64)> TakeWords<Out> for State {
    #[inline(always)]
    fn take_words(&mut self, mut words: &[[u8; 2]], out: &mut Out) {
        while let Some(block) = words.first_chunk() {
            let taken = self.block(block, out);
            words = words.get(taken..).unwrap_or_default();
        }
        self.one_by_one(words, out);
    }
}

impl State {
    /// Counts the words of `block`, or the first of them, and says how many.
    #[inline(always)]
    fn block(&mut self, block: &[[u8; 2]; BLOCK], out: &mut impl FnMut(CameraMicros, u64)) -> usize {
        if self.time.now().is_none() {
            self.one_by_one(block, out);
            return BLOCK;
        }
        let bin = self.open_bin();
        let all = bin.look(block, BLOCK);
        if all.leaving == BLOCK {
            self.take(all);
            return BLOCK;
        }
        self.take(bin.look(block, all.leaving));
        let rest = block.get(all.leaving..).unwrap_or_default();
        let step = rest.get(..STEP).unwrap_or(rest);
        self.one_by_one(step, out);
        all.leaving + step.len()
    }

    #[inline(always)]
    fn take(&mut self, seen: Seen) {
        self.bin.add(u64::from(seen.events));
        self.time.low(seen.newest);
    }

    #[inline(always)]
    fn open_bin(&self) -> BinOfWords {
        let (high, coarse_us) = self.time.coarse();
        let (start_us, end_us) = self.bin.range();
        let first = start_us.saturating_sub(coarse_us).clamp(0, 4096) as u16;
        let width = (end_us.saturating_sub(coarse_us).clamp(0, 4096) as u16).saturating_sub(first);
        BinOfWords { first, width, high: word_type::TIME_HIGH << 12 | high }
    }

    #[inline(always)]
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

/// The open bin, as words tell time while the coarse time lasts.
#[derive(Debug, Clone, Copy)]
struct BinOfWords {
    /// Its first fine time, and how many it has.
    first: u16,
    width: u16,
    /// The TIME_HIGH that changes nothing.
    high: u16,
}

/// What words hold.
#[derive(Debug, Clone, Copy)]
struct Seen {
    /// Events in them.
    events: u16,
    /// Their newest fine time; 0 without one.
    newest: u16,
    /// The first of them that leaves the bin; their number if none does.
    leaving: usize,
}

impl BinOfWords {
    /// What the first `count` words of `block` hold. Nothing here branches on a word, so that the compiler can look at many at once.
    #[inline(always)]
    #[expect(
        clippy::explicit_counter_loop,
        reason = "16 bits wide, as the words are: numbers of one width go through the vector registers together"
    )]
    fn look(self, block: &[[u8; 2]; BLOCK], count: usize) -> Seen {
        let count = count as u16;
        let (mut events, mut newest, mut leaving) = (0, 0, count);
        let mut index = 0_u16;
        for &bytes in block {
            let word = u16::from_le_bytes(bytes);
            let counts = mask(index < count);
            let (kind, payload) = (word >> 12, word & PAYLOAD_MASK);
            let twelve = mask(kind == word_type::VECT_12) & PAYLOAD_MASK;
            let eight = mask(kind == word_type::VECT_8) & 0xFF;
            let single = mask(kind == word_type::ADDR_X) & 1 << 15;
            events += ((word & (twelve | eight) | single) & counts).count_ones() as u16;
            let is_low = mask(kind == word_type::TIME_LOW) & counts;
            newest = newest.max(payload & is_low);
            let is_high = mask(kind == word_type::TIME_HIGH) & counts;
            let leaves = is_low & mask(payload.wrapping_sub(self.first) >= self.width)
                | is_high & mask(word != self.high);
            leaving = leaving.min(index | !leaves);
            index += 1;
        }
        Seen { events, newest, leaving: usize::from(leaving) }
    }
}

/// All bits if `condition` holds, else none.
#[inline(always)]
fn mask(condition: bool) -> u16 {
    u16::from(condition).wrapping_neg()
}
