#![expect(clippy::expect_used, reason = "a benchmark of broken devices means nothing")]
//! How fast the simulated sensor is: each iteration simulates 100 ms, so a time of 25 ms is four times real time.

use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use evfocus_core::EventBatch;
use evfocus_hal::{Camera, Clock, Lens, VirtualClock};
use hil_sim::{CameraModel, Light, MotionConfig, Rig, RigConfig, SimCamera, SimLens};

/// Simulated time of one iteration.
const STRETCH: Duration = Duration::from_millis(100);

/// A rig that runs, with the lens sweeping up and down.
struct Bench {
    clock: Arc<VirtualClock>,
    camera: SimCamera,
    lens: SimLens,
    batch: EventBatch,
}

impl Bench {
    fn new(config: RigConfig) -> Self {
        let clock = Arc::new(VirtualClock::new());
        let rig = Rig::new(config, Arc::clone(&clock) as Arc<dyn Clock>).expect("a valid configuration");
        let (mut camera, lens) = rig.devices();
        camera.start().expect("a camera that works");
        Self { clock, camera, lens, batch: EventBatch::with_capacity(1 << 20) }
    }

    /// Keeps the lens sweeping.
    fn sweep(&mut self) {
        let sample = self.lens.sample().expect("a lens that works");
        if !sample.moving {
            let info = self.lens.info();
            let middle = f64::midpoint(info.range.min().0, info.range.max().0);
            let target = if sample.position.0 < middle { info.range.max() } else { info.range.min() };
            self.lens.move_to(target, info.max_speed).expect("a target in range");
        }
    }

    fn advance(&mut self) -> usize {
        let end = self.clock.now() + STRETCH;
        let mut events = 0;
        while self.clock.now() < end {
            let rest = end.since(self.clock.now());
            self.camera.read(&mut self.batch, rest).expect("a camera that works");
            events += self.batch.events.len();
        }
        events
    }
}

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
