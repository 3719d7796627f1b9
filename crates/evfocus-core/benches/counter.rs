//! Counting and searching, measured by criterion: `cargo bench -p evfocus-core --bench counter`.
#![expect(clippy::unwrap_used, reason = "a benchmark without its own fixture is none")]

use core::hint::black_box;
use core::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use evfocus_core::{CameraMicros, CumulativeCounter, Method, Searcher};

#[path = "support/sweep.rs"]
mod sweep;

/// A hundredth of 100 million events at 25, and at 2.5 million events a second.
fn counting(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("count");
    group.throughput(Throughput::Elements(sweep::BATCH as u64)).sample_size(20);
    for (name, length_us) in [("25 M/s", 40_000), ("2.5 M/s", 400_000)] {
        let batch = sweep::list(&sweep::batch(0, length_us));
        let mut counter = CumulativeCounter::new(CumulativeCounter::DEFAULT_BIN, Duration::from_secs(20));
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                counter.start(CameraMicros(0));
                counter.count(black_box(&batch).as_slice());
            });
        });
    }
    group.finish();
}

fn searching(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("egs");
    group.sample_size(20);
    let mut searcher = Searcher::new(sweep::GEOMETRY);
    for (name, events, kept) in [
        ("10 M events, all kept", 10_000_000, 10_000_000),
        ("10 M events, counted only", 10_000_000, 0),
        ("100 M events, counted only", 100_000_000, 0),
    ] {
        let (recorder, trace) = sweep::sweep(events, kept);
        let sweep = recorder.sweep(&trace).unwrap();
        group.bench_function(name, |bencher| {
            bencher.iter(|| searcher.search(Method::Egs, black_box(&sweep), Duration::ZERO).unwrap());
        });
    }
    group.finish();
}

criterion_group!(benches, counting, searching);
criterion_main!(benches);
