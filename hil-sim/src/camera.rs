//! The simulated camera: a sensor behind a link, with a clock of its own.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use evfocus_core::{CameraMicros, Event, EventBatch, HostMicros, Polarity};
use evfocus_hal::{Camera, CameraInfo, Clock, DeviceError, DeviceErrorKind};
use rand::RngExt;
use rand_distr::Exp1;
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::config::LinkConfig;
use crate::faults::FaultKind;
use crate::lens::{LensState, lock};
use crate::picture::{Picture, Scratch, View};
use crate::random::Stream;
use crate::sensor::{STEP_MICROS, Sensor, Spike};

/// The simulated camera, as the focus loop sees it.
///
/// It computes what the sensor saw when it is read, in steps of one millisecond: a reader that comes late gets the same
/// events as one that comes often, only later.
pub struct SimCamera {
    picture: Arc<Picture>,
    lens: Arc<Mutex<LensState>>,
    clock: Arc<dyn Clock>,
    epoch: HostMicros,
    serial: String,
    running: Option<Running>,
    gone: bool,
}

/// A started stream.
struct Running {
    sensor: Sensor,
    view: View,
    image: Vec<f32>,
    scratch: Scratch,
    spikes: Vec<Spike>,
    /// Start of the step that comes next, microseconds since the rig was made.
    next_micros: i64,
    /// When the transfer of that step arrives.
    arrival: HostMicros,
    delivery: Xoshiro256PlusPlus,
    outbox: VecDeque<Event>,
    reached: CameraMicros,
    lost: u64,
}

impl std::fmt::Debug for SimCamera {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SimCamera").field("serial", &self.serial).finish_non_exhaustive()
    }
}

impl SimCamera {
    pub(crate) fn new(
        picture: Arc<Picture>,
        lens: Arc<Mutex<LensState>>,
        clock: Arc<dyn Clock>,
        epoch: HostMicros,
        serial: String,
    ) -> Self {
        Self { picture, lens, clock, epoch, serial, running: None, gone: false }
    }

    fn error(&self, kind: DeviceErrorKind, what: &str) -> DeviceError {
        DeviceError::new(kind, format!("{} {}", self.picture.config().sensor.model, self.serial), what)
    }

    fn check_plugged(&mut self) -> Result<(), DeviceError> {
        let seconds = self.clock.now().micros_since(self.epoch) as f64 * 1e-6;
        self.gone |= lock(&self.lens).struck(seconds).any(|(kind, _)| kind == FaultKind::CameraUnplugged);
        if self.gone {
            self.running = None;
            return Err(self
                .error(DeviceErrorKind::Disconnected, "the camera is unplugged; plug it in, open it again"));
        }
        Ok(())
    }
}

impl Camera for SimCamera {
    fn info(&self) -> CameraInfo {
        let sensor = &self.picture.config().sensor;
        CameraInfo {
            model: sensor.model.clone(),
            serial: self.serial.clone(),
            geometry: sensor.geometry,
            rate_ceiling: Some(sensor.readout_events_per_s as u64),
        }
    }

    fn start(&mut self) -> Result<(), DeviceError> {
        self.check_plugged()?;
        if self.running.is_none() {
            let since = self.clock.now().micros_since(self.epoch).max(0);
            let first = (since + STEP_MICROS - 1) / STEP_MICROS * STEP_MICROS;
            self.running = Some(Running::new(&self.picture, &self.lens, self.epoch, first));
        }
        Ok(())
    }

    fn stop(&mut self) -> Result<(), DeviceError> {
        self.check_plugged()?;
        self.running = None;
        Ok(())
    }

    fn read(&mut self, batch: &mut EventBatch, timeout: Duration) -> Result<(), DeviceError> {
        batch.clear();
        let deadline = self.clock.now() + timeout;
        loop {
            self.check_plugged()?;
            let Some(stream) = &mut self.running else {
                return Err(
                    self.error(DeviceErrorKind::NotStarted, "read before start; start the camera first")
                );
            };
            let now = self.clock.now();
            if stream.outbox.is_empty() && stream.arrival <= now {
                stream.step(&self.picture, &self.lens, self.epoch);
            } else if stream.outbox.is_empty() && now < deadline {
                self.clock.sleep_until(stream.arrival.min(deadline));
            } else {
                stream.deliver(batch);
                batch.arrival = now;
                return Ok(());
            }
        }
    }
}

impl Running {
    fn new(picture: &Picture, lens: &Mutex<LensState>, epoch: HostMicros, start_micros: i64) -> Self {
        let config = picture.config();
        let seconds = start_micros as f64 * 1e-6;
        let view = picture.view(lock(lens).at(seconds).optics, seconds);
        let mut image = vec![0.0; picture.pixels()];
        let mut scratch = Scratch::default();
        picture.render(&view, &mut scratch, &mut image);
        let mut stream = Self {
            sensor: Sensor::new(&config.sensor, &image, start_micros, config.seed),
            view,
            image,
            scratch,
            spikes: Vec::new(),
            next_micros: start_micros,
            arrival: epoch,
            delivery: Stream::Delivery.generator(config.seed),
            outbox: VecDeque::new(),
            reached: camera_time(&config.link, start_micros, None),
            lost: 0,
        };
        stream.schedule(&config.link, epoch);
        stream
    }

    /// Draws when the transfer of the coming step arrives; never before the one that was sent earlier.
    fn schedule(&mut self, link: &LinkConfig, epoch: HostMicros) {
        let jitter = link.delay_jitter.as_secs_f64() * self.delivery.sample::<f64, _>(Exp1);
        let sent = epoch + Duration::from_micros((self.next_micros + STEP_MICROS).unsigned_abs());
        self.arrival = self.arrival.max(sent + link.delay + Duration::from_secs_f64(jitter));
    }

    /// Computes one step and puts its events into the outbox.
    fn step(&mut self, picture: &Picture, lens: &Mutex<LensState>, epoch: HostMicros) {
        let config = picture.config();
        let start = self.next_micros;
        let end = start + STEP_MICROS;
        let seconds = end as f64 * 1e-6;
        let (position, faults) = {
            let lens = lock(lens);
            // Nothing is allocated as long as nothing has gone wrong.
            (lens.at(seconds).optics, lens.struck(seconds).collect::<Vec<_>>())
        };
        let view = picture.view(position, seconds);
        if view != self.view {
            picture.render(&view, &mut self.scratch, &mut self.image);
            self.view = view;
        }
        self.spikes.clear();
        self.lost += self.sensor.step(&self.image, start, &mut self.spikes);
        let width = u32::from(config.sensor.geometry.width);
        let resolution = config.sensor.time_resolution.as_micros().max(1) as i64;
        let link = &config.link;
        for spike in &self.spikes {
            let mut reset = None;
            let mut dropped = false;
            for &(kind, at) in &faults {
                let since = spike.micros as f64 - at * 1e6;
                if since < 0.0 {
                    continue;
                }
                if kind == FaultKind::CameraTimeReset {
                    reset = Some((at * 1e6) as i64);
                }
                if let FaultKind::EventLoss { share, duration } = kind {
                    dropped |= since < duration.as_secs_f64() * 1e6 && self.delivery.random::<f64>() < share;
                }
            }
            if dropped {
                self.lost += 1;
                continue;
            }
            self.outbox.push_back(Event {
                t: stamped(camera_time(link, spike.micros, reset), resolution),
                x: (spike.pixel % width) as u16,
                y: (spike.pixel / width) as u16,
                polarity: Polarity::from_on(spike.on),
            });
        }
        let reset =
            faults.iter().filter(|(kind, _)| *kind == FaultKind::CameraTimeReset).map(|(_, at)| *at).last();
        let reached = camera_time(link, end - 1, reset.map(|at| (at * 1e6) as i64));
        self.reached = stamped(reached, resolution);
        self.next_micros = end;
        self.schedule(link, epoch);
    }

    /// Fills `batch` with what has arrived, as far as it has room.
    fn deliver(&mut self, batch: &mut EventBatch) {
        let count = self.outbox.len().min(batch.events.capacity());
        batch.events.extend(self.outbox.drain(..count));
        batch.lost = std::mem::take(&mut self.lost);
        batch.reached = match batch.events.last() {
            Some(last) if !self.outbox.is_empty() => Some(last.t),
            // A batch without any room: nothing is known beyond what was delivered before.
            None if !self.outbox.is_empty() => None,
            _ => Some(self.reached),
        };
    }
}

/// A time as the camera states it, in steps of `resolution` microseconds.
fn stamped(time: CameraMicros, resolution: i64) -> CameraMicros {
    CameraMicros(time.0 - time.0.rem_euclid(resolution))
}

/// The camera's clock, `micros` after the rig was made; it counts from zero again at `reset`.
fn camera_time(link: &LinkConfig, micros: i64, reset: Option<i64>) -> CameraMicros {
    let rate = 1.0 + link.clock_drift_ppm * 1e-6;
    match reset {
        Some(reset) => CameraMicros(((micros - reset).max(0) as f64 * rate) as i64),
        None => CameraMicros(link.clock_offset.as_micros() as i64 + (micros as f64 * rate) as i64),
    }
}
