//! The DAVIS346 (iniVation), with the logic 18 of its FX3 boards.
//!
//! Order of the steps, registers and defaults follow libcaer (`davis.c`); where neuromorphic-drivers waits longer, so does this.
//! Frames and inertial data stay off.

pub mod biases;
mod protocol;
mod registers;
mod settings;
mod setup;

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::decode::DavisWordDecoder;
use evfocus_core::{EventBatch, Geometry};
use evfocus_hal::usb::{StreamQueue, UsbTransport};
use evfocus_hal::{Camera, CameraInfo, Clock, DeviceError, DeviceErrorKind};

pub use biases::CoarseFine;
pub use settings::{PixelFilterAxes, Settings, TriggerInput};

use crate::error::{device_name, transfer_error, warn_of_slow_port, wrong_version};
use crate::stream::{Stream, Streaming};
use registers::{Parameter, mux};

/// The sensor.
pub const GEOMETRY: Geometry = DavisWordDecoder::GEOMETRY;
/// How many pixels can be masked.
pub const PIXEL_FILTERS: usize = 8;

/// The data's endpoint.
const DATA_ENDPOINT: u8 = 0x82;
/// libcaer queues eight of these; short packets end them early, so their size does not delay anything.
const QUEUE: StreamQueue = StreamQueue { transfers: 16, bytes: 16 * 1024 };
/// What the maker states for the chip's read-out, events per second; not verified.
const RATE_CEILING: u64 = 12_000_000;
/// The model's name.
pub(crate) const MODEL: &str = "DAVIS346";
/// `bcdDevice`'s low byte: the firmware of the FX3 boards, and of the older FX2 boards.
const FIRMWARE_FX3: u8 = 6;
const FIRMWARE_FX2: u8 = 4;
/// The product number of the older boards, which speak the same protocol.
const PRODUCT_FX2: u16 = 0x841B;

/// Events that a camera may say it has dropped from one look to the next; more, minutes of its highest rate, is a broken counter, and must not
/// spoil the sums.
const MOST_DROPPED: u64 = u32::MAX as u64;

/// An opened DAVIS346.
pub struct Davis346<T: UsbTransport> {
    transport: T,
    clock: Arc<dyn Clock>,
    name: String,
    serial: String,
    trigger_input: TriggerInput,
    streaming: Streaming<DavisWordDecoder>,
    /// Jumps of the camera's time that have been looked into, and what it had dropped by then.
    seen_jumps: u64,
    seen_dropped: u64,
}

impl<T: UsbTransport> std::fmt::Debug for Davis346<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Davis346").field("serial", &self.serial).finish_non_exhaustive()
    }
}

impl<T: UsbTransport> Davis346<T> {
    /// Checks the versions, stops whatever was running, and sets the camera up.
    ///
    /// # Errors
    /// A setting that the camera does not have; firmware or logic of another version; a transfer that failed.
    pub fn open(transport: T, settings: &Settings, clock: Arc<dyn Clock>) -> Result<Self, DeviceError> {
        let serial = transport.identity().serial.clone();
        let name = device_name(MODEL, &serial);
        let trigger_input = settings.trigger_input;
        let mut camera = Self {
            transport,
            clock,
            name,
            serial,
            trigger_input,
            streaming: Streaming::Stopped,
            seen_jumps: 0,
            seen_dropped: 0,
        };
        settings.check().map_err(|error| camera.error(DeviceErrorKind::OutOfRange, error.to_string()))?;
        camera.check_firmware()?;
        warn_of_slow_port(&camera.name, camera.transport.identity());
        camera.set_up(settings)?;
        Ok(camera)
    }

    /// Events that the camera has dropped because nobody read them, since it got its power; 0 if its logic does not count them.
    fn dropped(&mut self) -> Result<u64, DeviceError> {
        if self.get(mux::HAS_STATISTICS)? == 0 {
            return Ok(0);
        }
        let low = Parameter { address: mux::DVS_DROPPED.address + 1, ..mux::DVS_DROPPED };
        Ok(u64::from(self.get(mux::DVS_DROPPED)?) << 32 | u64::from(self.get(low)?))
    }

    fn check_firmware(&self) -> Result<(), DeviceError> {
        let identity = self.transport.identity();
        let needed = if identity.product == PRODUCT_FX2 { FIRMWARE_FX2 } else { FIRMWARE_FX3 };
        let found = identity.version as u8;
        if found == needed {
            return Ok(());
        }
        let remedy = "change it with the maker's flashing tool";
        Err(wrong_version(&self.name, "firmware", &found.to_string(), &needed.to_string(), remedy))
    }

    fn error(&self, kind: DeviceErrorKind, what: impl Into<String>) -> DeviceError {
        DeviceError::new(kind, &self.name, what)
    }

    fn get(&mut self, parameter: Parameter) -> Result<u32, DeviceError> {
        let Parameter { module, address } = parameter;
        let mut answer = [0; 4];
        let got = self.transport.control_in(protocol::one(parameter), &mut answer).map_err(|error| {
            transfer_error(error, &self.name, &format!("reading parameter {address} of module {module}"))
        })?;
        protocol::value_of(answer.get(..got).unwrap_or_default()).ok_or_else(|| {
            let what = format!("{got} bytes for parameter {address} of module {module}; 4 were expected");
            self.error(DeviceErrorKind::Protocol, what)
        })
    }

    fn set(&mut self, parameter: Parameter, value: u32) -> Result<(), DeviceError> {
        let Parameter { module, address } = parameter;
        self.transport.control_out(protocol::one(parameter), &protocol::value(value)).map_err(|error| {
            let what = format!("writing {value} to parameter {address} of module {module}");
            transfer_error(error, &self.name, &what)
        })
    }

    fn wait(&self, duration: Duration) {
        self.clock.sleep_until(self.clock.now() + duration);
    }
}

impl<T: UsbTransport> Camera for Davis346<T> {
    fn info(&self) -> CameraInfo {
        CameraInfo {
            model: MODEL.to_owned(),
            serial: self.serial.clone(),
            geometry: GEOMETRY,
            rate_ceiling: Some(RATE_CEILING),
        }
    }

    fn start(&mut self) -> Result<(), DeviceError> {
        if !self.streaming.is_to_start(&self.name)? {
            return Ok(());
        }
        (self.seen_jumps, self.seen_dropped) = (0, self.dropped()?);
        let (clock, decoder) = (Arc::clone(&self.clock), DavisWordDecoder::live());
        let stream = Stream::start(&mut self.transport, clock.as_ref(), DATA_ENDPOINT, QUEUE, decoder)
            .map_err(|error| transfer_error(error, &self.name, "queueing transfers"))?;
        if let Err(error) = self.run() {
            // The failure to start is what matters.
            self.halt().unwrap_or_default();
            return Err(error);
        }
        self.streaming = Streaming::Running(stream);
        Ok(())
    }

    fn stop(&mut self) -> Result<(), DeviceError> {
        if self.streaming.take_to_stop(&self.name)? { self.halt() } else { Ok(()) }
    }

    fn read(&mut self, batch: &mut EventBatch, timeout: Duration) -> Result<(), DeviceError> {
        let Self { transport, clock, name, streaming, .. } = self;
        streaming.read(transport, clock.as_ref(), name, batch, timeout)?;
        let jumps = streaming.decoder().map_or(0, |decoder| decoder.damage().time_jumps);
        if jumps > self.seen_jumps {
            // Wraps that were counted without being sent: the camera may have dropped events meanwhile.
            self.seen_jumps = jumps;
            let dropped = self.dropped()?;
            batch.lost += dropped.saturating_sub(self.seen_dropped).min(MOST_DROPPED);
            self.seen_dropped = dropped;
        }
        Ok(())
    }
}

impl<T: UsbTransport> Drop for Davis346<T> {
    fn drop(&mut self) {
        // A camera that is gone cannot be stopped, and nobody is left to be told.
        self.stop().unwrap_or_default();
    }
}
