//! The simulated camera: a sensor behind a link, with a clock of its own.

mod running;

use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use evfocus_core::{CameraMicros, EventBatch, HostMicros};
use evfocus_hal::{Camera, CameraInfo, Clock, DeviceError, DeviceErrorKind};

use crate::faults::FaultKind;
use crate::lens::{LensState, lock};
use crate::picture::Picture;
use crate::sensor::STEP_MICROS;
use running::Running;

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
    /// See [`Rig::dropped_by_rate_cap`](crate::Rig::dropped_by_rate_cap).
    capped: Arc<AtomicU64>,
    running: Option<Running>,
    /// Whether this handle has noticed that the camera was unplugged: it stays dead, as a file handle would.
    gone: bool,
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
        capped: Arc<AtomicU64>,
    ) -> Self {
        Self { picture, lens, clock, epoch, serial, capped, running: None, gone: false }
    }

    fn error(&self, kind: DeviceErrorKind, what: &str) -> DeviceError {
        DeviceError::new(kind, format!("{} {}", self.picture.config().sensor.model, self.serial), what)
    }

    /// Whether the camera has been unplugged since this handle was opened.
    pub(crate) fn is_unplugged(&mut self) -> bool {
        self.check_plugged().is_err()
    }

    /// The camera time up to which the stream has been computed; `None` unless it is started.
    pub(crate) fn reached(&self) -> Option<CameraMicros> {
        self.running.as_ref().map(Running::reached)
    }

    fn check_plugged(&mut self) -> Result<(), DeviceError> {
        let seconds = self.clock.now().micros_since(self.epoch) as f64 / 1e6;
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
            rate_ceiling: Some(sensor.rate_ceiling() as u64),
        }
    }

    fn start(&mut self) -> Result<(), DeviceError> {
        self.check_plugged()?;
        if self.running.is_none() {
            let since = self.clock.now().micros_since(self.epoch).max(0);
            let first = (since + STEP_MICROS - 1) / STEP_MICROS * STEP_MICROS;
            self.running =
                Some(Running::new(&self.picture, &self.lens, self.epoch, first, Arc::clone(&self.capped)));
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
            if stream.is_empty() && stream.arrival() <= now {
                stream.step(&self.picture, &self.lens);
            } else if stream.is_empty() && now < deadline {
                self.clock.sleep_until(stream.arrival().min(deadline));
            } else {
                stream.deliver(batch);
                return Ok(());
            }
        }
    }
}
