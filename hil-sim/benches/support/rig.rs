//! A simulated rig that runs, for the benchmarks.

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::EventBatch;
use evfocus_hal::{Camera, Clock, Lens, VirtualClock};
use hil_sim::{Rig, RigConfig, SimCamera, SimLens};

/// Simulated time of one iteration.
pub(crate) const STRETCH: Duration = Duration::from_millis(100);

/// A rig that runs, with the lens sweeping up and down.
pub(crate) struct Bench {
    clock: Arc<VirtualClock>,
    camera: SimCamera,
    lens: SimLens,
    batch: EventBatch,
}

impl Bench {
    pub(crate) fn new(config: RigConfig) -> Self {
        let clock = Arc::new(VirtualClock::new());
        let rig = Rig::new(config, Arc::clone(&clock) as Arc<dyn Clock>).expect("a valid configuration");
        let (mut camera, lens) = rig.devices();
        camera.start().expect("a camera that works");
        Self { clock, camera, lens, batch: EventBatch::with_capacity(1 << 20) }
    }

    /// Keeps the lens sweeping.
    pub(crate) fn sweep(&mut self) {
        let sample = self.lens.sample().expect("a lens that works");
        if !sample.moving {
            let info = self.lens.info();
            let middle = f64::midpoint(info.range.min().0, info.range.max().0);
            let target = if sample.position.0 < middle { info.range.max() } else { info.range.min() };
            self.lens.move_to(target, info.max_speed).expect("a target in range");
        }
    }

    pub(crate) fn advance(&mut self) -> usize {
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
