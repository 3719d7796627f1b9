#![expect(clippy::expect_used, reason = "a benchmark of broken devices means nothing")]
//! How fast the simulated sensor is: each iteration simulates 100 ms, so a time of 25 ms is four times real time.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use hil_sim::{CameraModel, Light, MotionConfig, RigConfig};

#[path = "support/rig.rs"]
mod rig;

use rig::{Bench, STRETCH};

fn sensor(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("sensor/100ms");
    // Elements are simulated milliseconds: "4 Kelem/s" is four times real time.
    group.throughput(Throughput::Elements(STRETCH.as_millis() as u64)).sample_size(20);
    for (model, light) in [
        (CameraModel::Davis346, Light::Light),
        (CameraModel::Davis346, Light::Dark),
        (CameraModel::Imx636, Light::Light),
    ] {
        let still = RigConfig::preset(model, light);
        let shaken = RigConfig { motion: MotionConfig::hand_held(), ..still.clone() };
        for (name, config, sweeps) in
            [("idle", &still, false), ("static sweep", &still, true), ("shaken sweep", &shaken, true)]
        {
            if model == CameraModel::Imx636 && name != "shaken sweep" {
                continue;
            }
            let mut bench = Bench::new(config.clone());
            group.bench_function(format!("{model} {light} {name}"), |bencher| {
                bencher.iter(|| {
                    if sweeps {
                        bench.sweep();
                    }
                    black_box(bench.advance())
                });
            });
        }
    }
    group.finish();
}

criterion_group!(benches, sensor);
criterion_main!(benches);
