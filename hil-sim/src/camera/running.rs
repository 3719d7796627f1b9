//! A started stream: the sensor, the transfers that bring its events, and the clock that stamps them.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use evfocus_core::{CameraMicros, Event, EventBatch, HostMicros, Polarity};
use rand::RngExt;
use rand_distr::Exp1;
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::config::{LinkConfig, RigConfig};
use crate::faults::FaultKind;
use crate::lens::{LensState, lock};
use crate::picture::{Picture, Scratch, View};
use crate::random::Stream;
use crate::sensor::{STEP_MICROS, Sensor, Spike};

/// What runs between `start` and `stop`.
pub(super) struct Running {
    sensor: Sensor,
    stamps: StampClock,
    link: LinkConfig,
    width: u32,
    epoch: HostMicros,
    view: View,
    image: Vec<f32>,
    scratch: Scratch,
    spikes: Vec<Spike>,
    /// Start of the step that comes next, microseconds since the rig was made.
    next_micros: i64,
    /// When the transfer of the coming step arrives.
    arrival: HostMicros,
    /// When the transfer of the last step arrived.
    arrived: HostMicros,
    transfers: Xoshiro256PlusPlus,
    outbox: VecDeque<Event>,
    reached: CameraMicros,
    lost: u64,
    /// Events that the rate cap has dropped since the rig was made.
    capped: Arc<AtomicU64>,
}

impl Running {
    /// A stream whose first step begins at `start_micros`.
    pub(super) fn new(
        picture: &Picture,
        lens: &Mutex<LensState>,
        epoch: HostMicros,
        start_micros: i64,
        capped: Arc<AtomicU64>,
    ) -> Self {
        let config = picture.config();
        let seconds = start_micros as f64 / 1e6;
        let view = picture.view(lock(lens).at(seconds).optics, seconds);
        let mut image = vec![0.0; picture.pixels()];
        let mut scratch = Scratch::default();
        picture.render(&view, &mut scratch, &mut image);
        let stamps = StampClock::new(config);
        let mut running = Self {
            sensor: Sensor::new(&config.sensor, &image, start_micros, config.seed),
            link: config.link,
            width: u32::from(config.sensor.geometry.width),
            epoch,
            view,
            image,
            scratch,
            spikes: Vec::new(),
            next_micros: start_micros,
            arrival: epoch,
            arrived: epoch + Duration::from_micros(start_micros.unsigned_abs()),
            transfers: Stream::Transfers.generator(config.seed),
            outbox: VecDeque::new(),
            reached: stamps.at(start_micros),
            lost: 0,
            capped,
            stamps,
        };
        running.schedule();
        running
    }

    /// Whether all that has arrived was delivered.
    pub(super) fn is_empty(&self) -> bool {
        self.outbox.is_empty()
    }

    /// The camera time up to which the stream has been computed.
    pub(super) fn reached(&self) -> CameraMicros {
        self.reached
    }

    /// When the transfer of the coming step arrives.
    pub(super) fn arrival(&self) -> HostMicros {
        self.arrival
    }

    /// Computes one step and puts its events into the outbox.
    pub(super) fn step(&mut self, picture: &Picture, lens: &Mutex<LensState>) {
        let start = self.next_micros;
        let end = start + STEP_MICROS;
        let seconds = end as f64 / 1e6;
        let (position, faults) = {
            let lens = lock(lens);
            (lens.at(seconds).optics, lens.struck(seconds).collect::<Vec<_>>())
        };
        let view = picture.view(position, seconds);
        if view != self.view {
            picture.render(&view, &mut self.scratch, &mut self.image);
            self.view = view;
        }
        self.spikes.clear();
        let dropped = self.sensor.step(&self.image, start, &mut self.spikes);
        self.lost += dropped.by_queue;
        self.capped.fetch_add(dropped.by_cap, Ordering::Relaxed);
        for (kind, at) in faults {
            let at = (at * 1e6) as i64;
            if let FaultKind::EventLoss { share, duration } = kind {
                self.lose(share, at..at + duration.as_micros() as i64);
            }
            if kind == FaultKind::CameraTimeReset {
                self.stamps.reset_at = Some(at);
            }
        }
        for spike in &self.spikes {
            self.outbox.push_back(Event {
                t: self.stamps.at(spike.micros),
                x: (spike.pixel % self.width) as u16,
                y: (spike.pixel / self.width) as u16,
                polarity: Polarity::from_on(spike.on),
            });
        }
        self.reached = self.stamps.at(end - 1);
        self.next_micros = end;
        self.arrived = self.arrival;
        self.schedule();
    }

    /// Loses `share` of the events of `during`, and counts them.
    fn lose(&mut self, share: f64, during: std::ops::Range<i64>) {
        let before = self.spikes.len();
        let transfers = &mut self.transfers;
        self.spikes.retain(|spike| !during.contains(&spike.micros) || transfers.random::<f64>() >= share);
        self.lost += (before - self.spikes.len()) as u64;
    }

    /// Draws when the transfer of the coming step arrives; never before the one that was sent earlier.
    fn schedule(&mut self) {
        let jitter = self.link.delay_jitter.as_secs_f64() * self.transfers.sample::<f64, _>(Exp1);
        let sent = self.epoch + Duration::from_micros((self.next_micros + STEP_MICROS).unsigned_abs());
        self.arrival = self.arrival.max(sent + self.link.delay + Duration::from_secs_f64(jitter));
    }

    /// Fills `batch` with what has arrived, as far as it has room. The arrival is the simulated link's: how long this
    /// computer took to simulate the pixels is not part of the rig.
    pub(super) fn deliver(&mut self, batch: &mut EventBatch) {
        batch.arrival = self.arrived;
        let count = self.outbox.len().min(batch.events.capacity());
        let unfit = batch.events.append(self.outbox.drain(..count));
        batch.lost = std::mem::take(&mut self.lost) + unfit;
        batch.reached = if self.outbox.is_empty() {
            Some(self.reached)
        } else {
            // The rest of the step is still to come.
            batch.events.last().map(|last| last.t)
        };
    }
}

/// The camera's clock.
#[derive(Debug, Clone, Copy)]
struct StampClock {
    offset: i64,
    rate: f64,
    resolution: i64,
    /// When it started again from zero, microseconds since the rig was made.
    reset_at: Option<i64>,
}

impl StampClock {
    fn new(config: &RigConfig) -> Self {
        Self {
            offset: config.link.clock_offset.as_micros() as i64,
            rate: 1.0 + config.link.clock_drift_ppm * 1e-6,
            resolution: config.sensor.time_resolution.as_micros().max(1) as i64,
            reset_at: None,
        }
    }

    /// What the clock shows `micros` after the rig was made.
    fn at(&self, micros: i64) -> CameraMicros {
        let (offset, origin) = match self.reset_at {
            Some(at) if micros >= at => (0, at),
            _ => (self.offset, 0),
        };
        let exact = offset + ((micros - origin) as f64 * self.rate) as i64;
        CameraMicros(exact - exact.rem_euclid(self.resolution))
    }
}
