//! Single events between words that say their row and time, many words at a time.

use crate::event_list::{EventList, SPARE_ROOM};
use crate::packed_event::PackedEvent;

/// Words that are looked at together: as many as a number has bits.
pub(super) const BLOCK: usize = 64;
/// Events that are written together, of which as many are kept as there are: most runs need no loop, whose end would be hard to guess.
const STRIDE: usize = 8;
/// A block with room behind it, so that a stride may begin at any word.
const PADDED: usize = BLOCK + STRIDE;
const _: () = assert!(PADDED <= SPARE_ROOM, "decoding must not make a batch grow");

/// Bit i is what `test` says of word i.
#[inline(always)]
pub(super) fn bits(block: &[[u8; 2]; BLOCK], test: impl Fn(u16) -> bool) -> u64 {
    let flags = block.map(|bytes| u8::from(test(u16::from_le_bytes(bytes))));
    let eights = flags.as_chunks::<8>().0.iter().enumerate();
    // The factor moves the lowest bit of byte i to bit i of the highest byte.
    let byte = |eight: &[u8; 8]| u64::from_le_bytes(*eight).wrapping_mul(0x0102_0408_1020_4080) >> 56;
    eights.fold(0, |bits, (index, eight)| bits | byte(eight) << (8 * index))
}

/// What a word that is no event does to the events after it. A format has one of these for each of the upper four bits of a word.
#[derive(Debug, Clone, Copy)]
pub(super) struct Kind {
    /// Its bits that are the new row or time.
    mask: u16,
    /// The first of those values that does not exist; 0 for words that do more than say a row or a time.
    limit: u16,
    /// Where they belong in an event.
    shift: u32,
    /// Bits of an event that stay as they are.
    keep: u64,
}

impl Kind {
    /// Says something else.
    pub(super) const OTHER: Self = Self { mask: 0, limit: 0, shift: 0, keep: u64::MAX };

    /// Says the row of the picture, which is below `limit`.
    pub(super) const fn row(mask: u16, limit: u16) -> Self {
        Self { mask, limit, shift: PackedEvent::ROW_SHIFT, keep: !PackedEvent::ROW }
    }

    /// Says the column of the picture, which is below `limit`.
    pub(super) const fn column(mask: u16, limit: u16) -> Self {
        Self { mask, limit, shift: 0, keep: !PackedEvent::COLUMN }
    }

    /// Says the time, to be added to a coarse one.
    pub(super) const fn time(mask: u16) -> Self {
        Self { mask, limit: mask + 1, shift: PackedEvent::TIME_SHIFT, keep: !PackedEvent::TIME }
    }
}

/// Decodes the words at the front that are events, or that say a row, column or time that exists and does not fall, and returns how many
/// they are, at most [`BLOCK`]. `event` makes an event of what it shares with those before and of its word; `shared` is moved on.
#[inline(always)]
pub(super) fn decode_run(
    words: &[[u8; 2]],
    kinds: &[Kind; 16],
    is_event: impl Fn(u16) -> bool,
    event: impl Fn(PackedEvent, u16) -> PackedEvent + Copy,
    (shared, coarse): (&mut PackedEvent, PackedEvent),
    events: &mut EventList,
) -> usize {
    let length = events.len();
    let count = words.len().min(BLOCK);
    let mut block = [[0; 2]; PADDED];
    for (slot, &word) in block.iter_mut().zip(words.first_chunk::<BLOCK>().map_or(words, |full| full)) {
        *slot = word;
    }
    let singles = block.first_chunk().map_or(0, |words| bits(words, is_event));
    // What lies behind the words ends the run.
    let mut others = !singles | u64::MAX.checked_shl(count as u32).unwrap_or(0);
    let Some(places) = events.places::<PADDED>() else { return 0 };
    let (mut written, mut start) = (0, 0);
    let taken = loop {
        let next = others.trailing_zeros() as usize;
        let mut run = next - start;
        while run > 0 {
            let (Some(from), Some(to)) = (stride(&block, start), stride_mut(places, written)) else { break };
            *to = from.map(|bytes| event(*shared, u16::from_le_bytes(bytes)));
            let step = run.min(STRIDE);
            run -= step;
            start += step;
            written += step;
        }
        let Some(&bytes) = block.get(next).filter(|_| next < count) else { break next };
        let word = u16::from_le_bytes(bytes);
        let kind = &kinds[usize::from(word >> 12)];
        let value = word & kind.mask;
        let changed = shared.changed(kind.keep, u64::from(value) << kind.shift, coarse);
        if value >= kind.limit || changed.is_before(*shared) {
            break next;
        }
        *shared = changed;
        others &= others - 1;
        start = next + 1;
    };
    events.truncate(length + written);
    taken
}

#[inline(always)]
fn stride(block: &[[u8; 2]; PADDED], start: usize) -> Option<&[[u8; 2]; STRIDE]> {
    block.get(start..)?.first_chunk()
}

#[inline(always)]
fn stride_mut(places: &mut [PackedEvent; PADDED], start: usize) -> Option<&mut [PackedEvent; STRIDE]> {
    places.get_mut(start..)?.first_chunk_mut()
}
