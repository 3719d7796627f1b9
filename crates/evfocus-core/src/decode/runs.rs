//! Runs of words of which each is an event.

use alloc::vec::Vec;

use crate::event::Event;

/// Words that are looked at together.
const STRIDE: usize = 4;

/// Appends what `event` makes of the words at the front that are `kept`, and returns the others. Four are written at a time, and as many
/// kept as go on the run: where a run ends is hard to guess for a processor.
#[inline(always)]
pub(super) fn kept_while<'words>(
    mut words: &'words [[u8; 2]],
    kept: impl Fn(u16) -> bool + Copy,
    event: impl Fn(u16) -> Event + Copy,
    events: &mut Vec<Event>,
) -> &'words [[u8; 2]] {
    while let Some(stride) = words.first_chunk::<STRIDE>() {
        let stride = stride.map(u16::from_le_bytes);
        let others = stride.iter().rev().fold(0, |bits, &word| bits << 1 | u32::from(!kept(word)));
        let count = (others | 1 << STRIDE).trailing_zeros() as usize;
        let length = events.len();
        // One by one into their places: put together elsewhere and copied they would take twice as long.
        events.extend(stride.into_iter().map(event));
        events.truncate(length + count);
        words = words.get(count..).unwrap_or_default();
        if count < STRIDE {
            return words;
        }
    }
    while let Some((&first, rest)) = words.split_first()
        && kept(u16::from_le_bytes(first))
    {
        events.push(event(u16::from_le_bytes(first)));
        words = rest;
    }
    words
}
