//! How fast events come out of EVT3 words and go into them; the words are those of a real recording.
//! `cargo bench -p evfocus-record`.

#![expect(clippy::expect_used, reason = "a bench that cannot run has to stop")]

use std::hint::black_box;
use std::path::Path;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use evfocus_core::decode::Evt3Decoder;
use evfocus_core::{EventBatch, Geometry};
use evfocus_record::encode::Evt3Encoder;
use evfocus_record::{MAX_EVENTS_PER_READ, READ_BYTES, Recording};

/// The last line of the recording's header; the words follow.
const HEADER_END: &[u8] = b"% end\n";
/// The recording's sensor.
const GEOMETRY: Geometry = Geometry { width: 640, height: 480 };

fn evt3(criterion: &mut Criterion) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/evt3_vga_640x480_trigger.raw");
    let bytes = std::fs::read(&path).expect("the recording is part of the crate");
    let end = bytes.windows(HEADER_END.len()).position(|window| window == HEADER_END);
    let words = &bytes[end.expect("the recording has a header") + HEADER_END.len()..];
    let mut recording = Recording::open(&path, None).expect("the recording is sound");
    let mut batch = EventBatch::with_capacity(MAX_EVENTS_PER_READ);
    let mut events = Vec::new();
    while recording.read(&mut batch).expect("the recording is sound") {
        events.extend(batch.events.iter());
    }

    let mut group = criterion.benchmark_group("evt3");
    group.throughput(Throughput::Elements(events.len() as u64));
    group.bench_function("decode", |bencher| {
        bencher.iter(|| {
            let mut decoder = Evt3Decoder::new(GEOMETRY);
            let mut count = 0;
            for chunk in words.chunks(READ_BYTES) {
                batch.clear();
                decoder.decode(chunk, &mut batch);
                count += batch.events.len();
            }
            assert_eq!(count, events.len(), "decodes something else");
            black_box(count)
        });
    });
    group.bench_function("encode", |bencher| {
        let mut words = Vec::with_capacity(2 * bytes.len());
        bencher.iter(|| {
            words.clear();
            let mut encoder = Evt3Encoder::new(GEOMETRY).expect("the sensor is small");
            encoder.encode(&events, &mut words).expect("the events are in order");
            black_box(words.len())
        });
    });
    group.finish();
}

criterion_group!(benches, evt3);
criterion_main!(benches);
