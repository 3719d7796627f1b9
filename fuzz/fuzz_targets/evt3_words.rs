//! Whatever the bytes: nothing panics, time never goes back, events lie on the sensor, and counting counts what decoding decodes.
#![no_main]

use evfocus_core::decode::{Evt3Counter, Evt3Decoder};
use evfocus_core::{EventBatch, Geometry};
use libfuzzer_sys::fuzz_target;

const SENSOR: Geometry = Geometry { width: 1280, height: 720 };

fuzz_target!(|data: &[u8]| {
    let Some((&cut, bytes)) = data.split_first() else { return };
    let (first, second) = bytes.split_at(usize::from(cut).min(bytes.len()));
    let (mut batch, mut decoder) = (EventBatch::default(), Evt3Decoder::live(SENSOR));
    let (mut counted, mut counter) = (0, Evt3Counter::new(20));
    for piece in [first, second] {
        decoder.decode(piece, &mut batch);
        counter.count(piece, |_, events| counted += events);
    }
    // What the camera says it dropped was never in the words.
    let dropped = decoder.damage().dropped_by_camera;
    assert_eq!(counted, batch.events.len() as u64 + batch.lost - dropped);
    assert_eq!(counter.reached(), batch.reached);
    assert!(batch.events.iter().is_sorted_by_key(|event| event.t));
    assert!(batch.events.iter().all(|event| SENSOR.contains(event.x, event.y)));
    assert!(batch.events.len() <= bytes.len() * Evt3Decoder::MAX_EVENTS_PER_BYTE);
});
