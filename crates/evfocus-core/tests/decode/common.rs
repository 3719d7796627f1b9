//! What the tests of decoding need.

use evfocus_core::{CameraMicros, Event, Polarity};
use proptest::sample::Index;

/// Words as a camera sends them.
pub(crate) fn bytes_of(words: &[u16]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

/// An event, ON for `true`.
pub(crate) fn event(t: i64, x: u16, y: u16, on: bool) -> Event {
    Event { t: CameraMicros(t), x, y, polarity: Polarity::from_on(on) }
}

/// Cuts `bytes` at the places given and feeds the pieces.
pub(crate) fn in_pieces(bytes: &[u8], cuts: &[Index], mut feed: impl FnMut(&[u8])) {
    let mut places: Vec<usize> = cuts.iter().map(|cut| cut.index(bytes.len() + 1)).collect();
    places.sort_unstable();
    let mut start = 0;
    for place in places {
        feed(&bytes[start..place]);
        start = place;
    }
    feed(&bytes[start..]);
}
