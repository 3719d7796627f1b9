//! A rig with a lens controller on a line.

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::{HostMicros, LensPosition, LensSample};
use evfocus_hal::{Clock, DeviceError, Lens, SystemClock, VirtualClock};
use evfocus_lens::Port;
use hil_sim::wire::{Protocol, WirePort};
use hil_sim::{Fault, LensConfig, Rig, RigConfig};

/// A rig, its clock, and the controller's port.
pub(crate) struct Bench {
    pub(crate) clock: Arc<dyn Clock>,
    pub(crate) rig: Rig,
    pub(crate) wire: WirePort,
}

impl Bench {
    /// In virtual time.
    pub(crate) fn new(protocol: Protocol, lens: LensConfig) -> Self {
        Self::on(Arc::new(VirtualClock::new()), protocol, RigConfig { lens, ..RigConfig::default() })
    }

    /// In virtual time, with other noise.
    pub(crate) fn seeded(protocol: Protocol, lens: LensConfig, seed: u64) -> Self {
        Self::on(Arc::new(VirtualClock::new()), protocol, RigConfig { lens, seed, ..RigConfig::default() })
    }

    /// The same in another rig, in which things go wrong.
    pub(crate) fn with_faults(&self, protocol: Protocol, faults: Vec<Fault>) -> Self {
        let config = RigConfig { faults, ..self.rig.config().clone() };
        Self::on(Arc::new(VirtualClock::new()), protocol, config)
    }

    /// In real time.
    pub(crate) fn live(protocol: Protocol, lens: LensConfig) -> Self {
        Self::on(Arc::new(SystemClock::new()), protocol, RigConfig { lens, ..RigConfig::default() })
    }

    fn on(clock: Arc<dyn Clock>, protocol: Protocol, config: RigConfig) -> Self {
        let rig = Rig::new(config, Arc::clone(&clock)).unwrap();
        let wire = rig.wire(protocol);
        Self { clock, rig, wire }
    }

    /// The port within the process.
    pub(crate) fn port(&self) -> Port {
        let wire = self.wire.clone();
        Port::new("simulated", Box::new(move || wire.open()))
    }

    pub(crate) fn wait(&self, duration: Duration) {
        self.clock.sleep_until(self.clock.now() + duration);
    }

    /// Samples every 5 ms until the lens rests, or for `limit`.
    pub(crate) fn rest(&self, lens: &mut dyn Lens, limit: Duration) -> LensSample {
        let end = self.clock.now() + limit;
        loop {
            let sample = lens.sample().unwrap();
            if !sample.moving {
                return sample;
            }
            assert!(self.clock.now() < end, "still moving at {}", sample.position);
            self.wait(Duration::from_millis(5));
        }
    }

    /// Where the glass is now.
    pub(crate) fn glass(&self) -> LensPosition {
        self.rig.glass(self.clock.now())
    }

    pub(crate) fn now(&self) -> HostMicros {
        self.clock.now()
    }
}

/// The lens does not move any more.
pub(crate) fn stands(bench: &Bench) {
    bench.wait(Duration::from_millis(150));
    let before = bench.glass();
    bench.wait(Duration::from_millis(500));
    assert!(bench.glass().distance(before) < 1.0, "from {before} to {}", bench.glass());
}

/// The error's text contains every word.
pub(crate) fn says(error: &DeviceError, words: &[&str]) {
    let text = error.to_string();
    for word in words {
        assert!(text.contains(word), "{word:?} is not in {text:?}");
    }
}
