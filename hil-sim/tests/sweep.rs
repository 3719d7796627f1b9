//! Sweeps in virtual time, and what their event rate looks like.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use evfocus_core::{Event, EventBatch, Geometry, HostMicros};
use evfocus_hal::{Camera, Clock, Lens, VirtualClock};
use hil_sim::{
    CameraModel, Light, LinkConfig, OpticsConfig, Rig, RigConfig, SensorConfig, SimCamera, SimLens,
};

/// The set-up of section 3: see the module that uses it.
pub(crate) fn section_three(light: Light) -> RigConfig {
    let sensor = SensorConfig {
        geometry: Geometry { width: 160, height: 120 },
        ..SensorConfig::preset(CameraModel::Davis346, light)
    };
    let sensor = match light {
        Light::Light => sensor,
        Light::Dark => {
            SensorConfig { cutoff_hz: 25.0, shot_noise_black_hz: 3.0, shot_noise_white_hz: 3.0, ..sensor }
        }
    };
    RigConfig {
        sensor,
        optics: OpticsConfig { blur_px_per_count: 0.015, ..OpticsConfig::default() },
        link: LinkConfig { clock_offset: Duration::ZERO, clock_drift_ppm: 0.0, ..LinkConfig::default() },
        seed: 3,
        ..RigConfig::default()
    }
}

/// Events against lens position in a sweep from the low end of the range to the high end at full speed.
pub(crate) struct SweepCurve {
    /// Centre of each bin, counts from focus.
    pub(crate) offsets: Vec<f64>,
    pub(crate) on: Vec<u32>,
    pub(crate) off: Vec<u32>,
}

impl SweepCurve {
    pub(crate) fn total(&self, bin: usize) -> u32 {
        self.on[bin] + self.off[bin]
    }

    /// Highest bin with its centre in `low..high`: offset and count.
    pub(crate) fn peak(&self, low: f64, high: f64) -> (f64, u32) {
        self.extreme(low, high, |new, old| new > old)
    }

    /// Lowest bin.
    pub(crate) fn dip(&self, low: f64, high: f64) -> (f64, u32) {
        self.extreme(low, high, |new, old| new < old)
    }

    fn extreme(&self, low: f64, high: f64, better: impl Fn(u32, u32) -> bool) -> (f64, u32) {
        let mut best: Option<(f64, u32)> = None;
        for (bin, &offset) in self.offsets.iter().enumerate() {
            let total = self.total(bin);
            if offset >= low && offset < high && best.is_none_or(|(_, old)| better(total, old)) {
                best = Some((offset, total));
            }
        }
        best.unwrap()
    }

    /// Centre of the hump between `low` and `high`: the centroid of the bins within 10 % of its highest.
    pub(crate) fn hump(&self, low: f64, high: f64) -> f64 {
        let least = f64::from(self.peak(low, high).1) * 0.9;
        let bins =
            (0..self.offsets.len()).filter(|&bin| self.offsets[bin] >= low && self.offsets[bin] < high);
        let (sum, weight) =
            bins.filter(|&bin| f64::from(self.total(bin)) >= least).fold((0.0, 0.0), |sums, bin| {
                let total = f64::from(self.total(bin));
                (sums.0 + self.offsets[bin] * total, sums.1 + total)
            });
        sum / weight
    }

    /// Share of ON among the events with offsets in `low..high`.
    pub(crate) fn on_share(&self, low: f64, high: f64) -> f64 {
        let bins =
            (0..self.offsets.len()).filter(|&bin| self.offsets[bin] >= low && self.offsets[bin] < high);
        let (on, all) = bins.fold((0, 0), |(on, all), bin| (on + self.on[bin], all + self.total(bin)));
        f64::from(on) / f64::from(all)
    }
}

impl fmt::Display for SweepCurve {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (before, dip, after) = (self.peak(-700.0, 0.0), self.dip(-150.0, 250.0), self.peak(0.0, 700.0));
        writeln!(
            f,
            "before {} at {:+}, dip {} at {:+}, after {} at {:+}, ON share {:.2} / {:.2}",
            before.1,
            before.0,
            dip.1,
            dip.0,
            after.1,
            after.0,
            self.on_share(-800.0, 0.0),
            self.on_share(0.0, 800.0)
        )?;
        for bin in (0..self.offsets.len()).filter(|&bin| self.offsets[bin].abs() < 1000.0) {
            write!(f, "{:+}:{} ", self.offsets[bin], self.total(bin))?;
        }
        Ok(())
    }
}

/// Sweeps the rig's lens through its range. Positions are the glass's true ones at the events' times (the link's clock must
/// be the host's).
pub(crate) fn sweep_curve(config: &RigConfig) -> SweepCurve {
    let (rig, mut camera, mut lens, clock) = open(config);
    camera.start().unwrap();
    let info = lens.info();
    lens.move_to(info.range.max(), info.max_speed).unwrap();
    let bins = 90;
    let mut curve = SweepCurve {
        offsets: (0..bins).map(|bin| f64::from(bin - bins / 2) * 40.0 + 20.0).collect(),
        on: vec![0; bins as usize],
        off: vec![0; bins as usize],
    };
    for event in run(&mut camera, clock.as_ref(), Duration::from_millis(2200)) {
        let offset = rig.glass(HostMicros(event.t.0)).counts_from(config.focus);
        let bin = (offset / 40.0).floor() as i32 + bins / 2;
        if let Ok(bin) = usize::try_from(bin)
            && bin < bins as usize
        {
            let channel = if event.polarity.is_on() { &mut curve.on } else { &mut curve.off };
            channel[bin] += 1;
        }
    }
    curve
}

/// All events that arrive within `duration`.
pub(crate) fn run(camera: &mut dyn Camera, clock: &dyn Clock, duration: Duration) -> Vec<Event> {
    watch(camera, clock, duration).0
}

/// The same, with the number of events that were lost.
pub(crate) fn watch(camera: &mut dyn Camera, clock: &dyn Clock, duration: Duration) -> (Vec<Event>, u64) {
    let end = clock.now() + duration;
    let mut batch = EventBatch::with_capacity(100_000);
    let (mut events, mut lost) = (Vec::new(), 0);
    while clock.now() < end {
        camera.read(&mut batch, end.since(clock.now())).unwrap();
        events.extend(batch.events.iter());
        lost += batch.lost;
    }
    (events, lost)
}

/// A rig on a virtual clock, its devices and the clock.
pub(crate) fn open(config: &RigConfig) -> (Rig, SimCamera, SimLens, Arc<VirtualClock>) {
    let clock = Arc::new(VirtualClock::new());
    let rig = Rig::new(config.clone(), Arc::clone(&clock) as Arc<dyn Clock>).unwrap();
    let (camera, lens) = rig.devices();
    (rig, camera, lens, clock)
}
