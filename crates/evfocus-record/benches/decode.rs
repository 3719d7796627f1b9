//! How fast events come out of EVT3 words. The words are those of a real recording, encoded anew so that the bench needs no
//! file of its own kind: `cargo bench -p evfocus-record`.

#![expect(clippy::expect_used, reason = "a bench that cannot run has to stop")]

use std::hint::black_box;
use std::path::Path;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use evfocus_core::{EventBatch, Geometry};
use evfocus_record::decode::Evt3Decoder;
use evfocus_record::encode::Evt3Encoder;
use evfocus_record::{MAX_EVENTS_PER_READ, READ_BYTES, Recording};

/// The recording's sensor.
const GEOMETRY: Geometry = Geometry { width: 640, height: 480 };

fn evt3(criterion: &mut Criterion) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/evt3_vga_640x480_trigger.raw");
    let bytes = std::fs::read(&path).expect("the recording is part of the crate");
    let mut recording = Recording::open(&path, None).expect("the recording is sound");
    let mut batch = EventBatch::with_capacity(MAX_EVENTS_PER_READ);
    let mut events = Vec::new();
    while recording.read(&mut batch).expect("the recording is sound") {
        events.extend_from_slice(&batch.events);
    }

    let mut group = criterion.benchmark_group("evt3");
    group.throughput(Throughput::Elements(events.len() as u64));
    // The header's few words decode as words, too, and change nothing.
    group.bench_function("decode", |bencher| {
        bencher.iter(|| {
            let mut decoder = Evt3Decoder::new(GEOMETRY);
            let mut count = 0;
            for chunk in bytes.chunks(READ_BYTES) {
                batch.clear();
                decoder.decode(chunk, &mut batch);
                count += batch.events.len();
            }
            black_box(count)
        });
    });
    group.bench_function("encode", |bencher| {
        let mut words = Vec::with_capacity(bytes.len() * 2);
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
