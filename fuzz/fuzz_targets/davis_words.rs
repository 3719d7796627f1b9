//! Whatever the bytes: nothing panics, time never goes back, events lie on the sensor, and counting counts what decoding decodes.
#![no_main]

use evfocus_core::EventBatch;
use evfocus_core::decode::{DavisWordCounter, DavisWordDecoder};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Some((&cut, bytes)) = data.split_first() else { return };
    let (first, second) = bytes.split_at(usize::from(cut).min(bytes.len()));
    let (mut batch, mut decoder) = (EventBatch::default(), DavisWordDecoder::live());
    let (mut counted, mut counter) = (0, DavisWordCounter::new(20));
    for piece in [first, second] {
        decoder.decode(piece, &mut batch);
        counter.count(piece, |_, events| counted += events);
    }
    assert_eq!(counted, batch.events.len() as u64 + batch.lost);
    assert_eq!(counter.reached(), batch.reached);
    assert!(batch.events.iter().is_sorted_by_key(|event| event.t));
    let sensor = DavisWordDecoder::GEOMETRY;
    assert!(batch.events.iter().all(|event| sensor.contains(event.x, event.y)));
});
