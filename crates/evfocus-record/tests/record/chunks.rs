//! The decoders of live cameras give real recordings exactly, however the bytes come; so do the counters.

use evfocus_core::decode::{DavisWordCounter, DavisWordDecoder, Evt3Counter, Evt3Decoder};
use evfocus_core::{Event, EventBatch, Geometry};
use proptest::collection::vec;
use proptest::prelude::*;

use crate::common::{data, read_file};

/// The words of a file, without its header.
fn words(name: &str) -> Vec<u8> {
    const HEADER_END: &[u8] = b"% end\n";
    let bytes = std::fs::read(data(name)).unwrap();
    let start = bytes.windows(HEADER_END.len()).position(|window| window == HEADER_END);
    bytes[start.map_or(0, |start| start + HEADER_END.len())..].to_vec()
}

/// Sizes of the chunks, used in turn: 1 byte to 1 MiB, small ones as likely as large ones.
fn sizes() -> impl Strategy<Value = Vec<usize>> {
    vec((0..=20_u32).prop_flat_map(|exponent| 1_usize..=1 << exponent), 1..40)
}

fn in_chunks(bytes: &[u8], sizes: &[usize], mut feed: impl FnMut(&[u8])) {
    let mut rest = bytes;
    let mut sizes = sizes.iter().cycle();
    while !rest.is_empty() {
        let (chunk, after) = rest.split_at(sizes.next().copied().unwrap_or(1).min(rest.len()));
        feed(chunk);
        rest = after;
    }
}

fn evt3_is_exact(name: &str, geometry: Geometry, sizes: &[usize]) {
    let bytes = words(name);
    let expected = read_file(&data(name), None);
    let (mut batch, mut decoder) = (EventBatch::default(), Evt3Decoder::live(geometry));
    let (mut counted, mut counter) = (0, Evt3Counter::new(20));
    in_chunks(&bytes, sizes, |chunk| {
        decoder.decode(chunk, &mut batch);
        counter.count(chunk, |_, events| counted += events);
    });
    exact(name, &batch.events, &expected, counted);
    assert!(decoder.damage().is_none(), "{name}: {:?}", decoder.damage());
}

fn davis_is_exact(name: &str, sizes: &[usize]) {
    let bytes = words(name);
    let expected = read_file(&data(name), None);
    let (mut batch, mut decoder) = (EventBatch::default(), DavisWordDecoder::live());
    let (mut counted, mut counter) = (0, DavisWordCounter::new(20));
    in_chunks(&bytes, sizes, |chunk| {
        decoder.decode(chunk, &mut batch);
        counter.count(chunk, |_, events| counted += events);
    });
    exact(name, &batch.events, &expected, counted);
}

fn exact(name: &str, events: &[Event], expected: &[Event], counted: u64) {
    // Millions of events are no message.
    assert!(events == expected, "{name}: {} events, {} expected", events.len(), expected.len());
    assert_eq!(counted, expected.len() as u64, "{name}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn evt3_recordings(sizes in sizes()) {
        evt3_is_exact("evt3_hd_1280x720_trigger.raw", Geometry { width: 1280, height: 720 }, &sizes);
        evt3_is_exact("evt3_vga_640x480_trigger.raw", Geometry { width: 640, height: 480 }, &sizes);
    }

    #[test]
    fn davis_recordings(sizes in sizes()) {
        davis_is_exact("davis346_usb_words_made.bin", &sizes);
        davis_is_exact("davis346_usb_words_made_stall.bin", &sizes);
    }
}
