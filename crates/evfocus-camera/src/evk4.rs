//! The EVK4 (Prophesee; sensor IMX636), streaming EVT 3.0, and boards that speak the same protocol.
//!
//! Order of the steps, registers and defaults follow OpenEB (`hal_psee_plugins`). Thermometer and light meter stay off: nothing
//! here asks them.

pub mod biases;
mod board;
mod protocol;
mod registers;
mod sequences;
mod settings;
mod setup;

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::decode::Evt3Decoder;
use evfocus_core::{EventBatch, Geometry};
use evfocus_hal::usb::{StreamQueue, UsbError, UsbTransport, VendorRequest};
use evfocus_hal::{Camera, CameraInfo, Clock, DeviceError, DeviceErrorKind};

pub use settings::{RowOrder, Settings};

use crate::error::{device_name, transfer_error, warn_of_slow_port, wrong_version};
use crate::stream::{Stream, Streaming};
use board::BoardError;
use protocol::property;
use sequences::{DESTROY, START, STOP, Step};

/// The sensor.
pub const GEOMETRY: Geometry = Geometry { width: 1280, height: 720 };
/// How many single pixels can be masked.
pub const PIXEL_MASKS: usize = 64;

/// The data's endpoint.
const DATA_ENDPOINT: u8 = 0x81;
/// OpenEB queues twenty of these.
const QUEUE: StreamQueue = StreamQueue { transfers: 20, bytes: 128 * 1024 };
/// How long the data endpoint is emptied at most when the camera is opened.
const DRAIN_TIME: Duration = Duration::from_secs(1);
/// The first firmware that OpenEB accepts.
const FIRST_RELEASE: u32 = 0x3_0800;
/// What a board with the sensor calls it; the second is an older name.
const COMPATIBLE: [&str; 2] = ["psee,ccam5_imx636", "psee,ccam5_gen42"];
/// The vendor number of Prophesee's own boards, which share it with any board of the USB chip's maker.
const VENDOR_CYPRESS: u16 = 0x04B4;
/// Asks a board of [`VENDOR_CYPRESS`] what it is.
const SYSTEM_ID: VendorRequest = VendorRequest { request: 0x72, value: 0, index: 0 };
/// The answer of EVK3 and EVK4 with the IMX636.
const SYSTEM_ID_IMX636: u8 = 0x31;
/// The model's name.
pub(crate) const MODEL: &str = "EVK4";

/// An opened EVK4.
pub struct Evk4<T: UsbTransport> {
    transport: T,
    clock: Arc<dyn Clock>,
    name: String,
    serial: String,
    streaming: Streaming<Evt3Decoder>,
}

impl<T: UsbTransport> std::fmt::Debug for Evk4<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Evk4").field("serial", &self.serial).finish_non_exhaustive()
    }
}

impl<T: UsbTransport> Evk4<T> {
    /// Checks the versions, resets the sensor and sets it up. Takes 2.5 s, most of it for the reset.
    ///
    /// # Errors
    /// A setting that the camera does not have; firmware or sensor of another kind; a request that was not answered as it must
    /// be; a transfer that failed.
    pub fn open(mut transport: T, settings: &Settings, clock: Arc<dyn Clock>) -> Result<Self, DeviceError> {
        let serial = read_serial(&mut transport)?;
        let name = device_name(MODEL, &serial);
        settings
            .check()
            .map_err(|error| DeviceError::new(DeviceErrorKind::OutOfRange, &name, error.to_string()))?;
        warn_of_slow_port(&name, transport.identity());
        let mut camera = Self { transport, clock, name, serial, streaming: Streaming::Stopped };
        camera.check_firmware()?;
        camera.set_up(settings)?;
        Ok(camera)
    }

    fn check_firmware(&mut self) -> Result<(), DeviceError> {
        let release = board::number(&mut self.transport, property::RELEASE_VERSION)
            .map_err(|error| self.board_error(error, "asking for the firmware's version"))?;
        if release < FIRST_RELEASE {
            let (found, needed) = (version(release), format!("at least {}", version(FIRST_RELEASE)));
            let remedy = "change it with the maker's updater";
            return Err(wrong_version(&self.name, "firmware", &found, &needed, remedy));
        }
        let compatible = board::is_compatible(&mut self.transport, &COMPATIBLE)
            .map_err(|error| self.board_error(error, "asking for the sensor's name"))?;
        if compatible {
            return Ok(());
        }
        Err(self.protocol_error(format!("its sensor is none of {}", COMPATIBLE.join(", "))))
    }

    fn run(&mut self, steps: &[Step]) -> Result<(), DeviceError> {
        let clock = Arc::clone(&self.clock);
        board::run(&mut self.transport, steps, |duration| clock.sleep_until(clock.now() + duration))
            .map_err(|error| self.board_error(error, "writing the sensor's sequences"))
    }

    fn halt(&mut self) -> Result<(), DeviceError> {
        let stopped = self.run(&STOP);
        let cancelled = self.transport.stop_stream();
        stopped?;
        cancelled.map_err(|error| self.usb_error(error, "taking the transfers back"))
    }

    fn usb_error(&self, error: UsbError, what: &str) -> DeviceError {
        transfer_error(error, &self.name, what)
    }

    fn board_error(&self, error: BoardError, what: &str) -> DeviceError {
        board_error(error, &self.name, what)
    }

    fn protocol_error(&self, what: impl Into<String>) -> DeviceError {
        DeviceError::new(DeviceErrorKind::Protocol, &self.name, what)
    }
}

/// Asks a board that may be an EVK4 for its serial number.
///
/// # Errors
/// The board is something else, or does not answer as it must.
pub fn read_serial(transport: &mut impl UsbTransport) -> Result<String, DeviceError> {
    if transport.identity().vendor == VENDOR_CYPRESS {
        let mut answer = [0; 2];
        let what = "asking for the system's number";
        let got = transport
            .control_in(SYSTEM_ID, &mut answer)
            .map_err(|error| transfer_error(error, MODEL, what))?;
        if got == 0 || answer[0] != SYSTEM_ID_IMX636 {
            let what = format!("system number {:#04x}; an EVK3 or EVK4 with the IMX636 has 0x31", answer[0]);
            return Err(DeviceError::new(DeviceErrorKind::Protocol, MODEL, what));
        }
    }
    let serial = board::number(transport, property::SERIAL)
        .map_err(|error| board_error(error, MODEL, "asking for the serial number"))?;
    Ok(format!("{serial:08x}"))
}

fn board_error(error: BoardError, device: &str, what: &str) -> DeviceError {
    match error {
        BoardError::Usb(error) => transfer_error(error, device, what),
        BoardError::Answer(error) => {
            let what = format!("{what}: {error}; unplug the camera and plug it in again");
            DeviceError::new(DeviceErrorKind::Protocol, device, what)
        }
    }
}

/// A release as people write it.
fn version(release: u32) -> String {
    format!("{}.{}.{}", release >> 16, release >> 8 & 0xFF, release & 0xFF)
}

impl<T: UsbTransport> Camera for Evk4<T> {
    fn info(&self) -> CameraInfo {
        let (model, serial) = (MODEL.to_owned(), self.serial.clone());
        CameraInfo { model, serial, geometry: GEOMETRY, rate_ceiling: None }
    }

    fn start(&mut self) -> Result<(), DeviceError> {
        if !self.streaming.is_to_start(&self.name)? {
            return Ok(());
        }
        let (clock, decoder) = (Arc::clone(&self.clock), Evt3Decoder::live(GEOMETRY));
        let stream = Stream::start(&mut self.transport, clock.as_ref(), DATA_ENDPOINT, QUEUE, decoder)
            .map_err(|error| self.usb_error(error, "queueing transfers"))?;
        if let Err(error) = self.run(&START) {
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
        streaming.read(transport, clock.as_ref(), name, batch, timeout)
    }
}

impl<T: UsbTransport> Drop for Evk4<T> {
    fn drop(&mut self) {
        // A camera that is gone cannot be switched off, and nobody is left to be told.
        self.stop().and_then(|()| self.run(&DESTROY)).unwrap_or_default();
    }
}
