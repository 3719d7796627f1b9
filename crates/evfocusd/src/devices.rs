//! What the focus loop needs of its devices beyond the traits: opening them, and telling their failures apart.

use std::sync::Arc;

use evfocus_camera::davis346::Davis346;
use evfocus_camera::evk4::Evk4;
use evfocus_camera::usb::{self, NusbTransport};
use evfocus_camera::{Driver, ReopeningCamera};
use evfocus_core::controller::{Action, DeviceFailure};
use evfocus_hal::{Camera, Clock, DeviceError, DeviceErrorKind, Lens};
use evfocus_lens::{Firmata, Grbl, Indi, LabJack, MoonLite, Optotune, Port};
use evfocus_record::{RecordError, ReplayCamera};

use crate::config::{CameraConfig, Config, LensBackend, LensDriver, LensPlace};

/// A camera and a lens that belong together.
pub struct Devices {
    /// The camera.
    pub camera: Box<dyn Camera>,
    /// The lens.
    pub lens: Box<dyn Lens>,
}

impl std::fmt::Debug for Devices {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Devices")
            .field("camera", &self.camera.info())
            .field("lens", &self.lens.info())
            .finish()
    }
}

impl Devices {
    /// Opens the devices that `config` names; simulated and emulated ones live on `clock`.
    ///
    /// # Errors
    /// [`OpenError`] with what helps.
    pub fn open(config: &Config, clock: &Arc<dyn Clock>) -> Result<Self, OpenError> {
        let rig = hil_sim::Rig::new(config.rig.clone(), Arc::clone(clock))?;
        let camera: Box<dyn Camera> = match config.camera.clone() {
            CameraConfig::Simulated => Box::new(rig.devices().0),
            CameraConfig::Replay { file, pace, end } => {
                Box::new(ReplayCamera::open(file, pace, end, Arc::clone(clock))?)
            }
            CameraConfig::Davis346 { serial, settings } => {
                open_usb(Driver::Davis346, serial, clock, move |transport, clock| {
                    Ok(Box::new(Davis346::open(transport, &settings, clock)?))
                })?
            }
            CameraConfig::Evk4 { serial, settings } => {
                open_usb(Driver::Evk4, serial, clock, move |transport, clock| {
                    Ok(Box::new(Evk4::open(transport, &settings, clock)?))
                })?
            }
        };
        Ok(Self { camera, lens: open_lens(&config.lens, &rig, clock)? })
    }
}

/// What keeps a device from being opened.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The simulated rig makes no sense.
    #[error(transparent)]
    Rig(#[from] hil_sim::ConfigError),
    /// A device cannot be opened.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// The recording to be replayed cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordError),
}

/// Opens the lens that `backend` names: that of `rig`, the rig's behind an emulated controller, or a real one.
pub(crate) fn open_lens(
    backend: &LensBackend,
    rig: &hil_sim::Rig,
    clock: &Arc<dyn Clock>,
) -> Result<Box<dyn Lens>, DeviceError> {
    let LensBackend::Driver { driver, place } = backend else { return Ok(Box::new(rig.devices().1)) };
    let port = match place {
        LensPlace::Emulated => {
            let wire = rig.wire(driver.protocol());
            Port::new("emulated", Box::new(move || wire.open()))
        }
        LensPlace::Serial { path, baud } => Port::serial(path, *baud, Arc::clone(clock)),
        LensPlace::Tcp(address) => Port::tcp(address, Arc::clone(clock)),
    };
    open_driver(driver, port, Arc::clone(clock))
}

/// Opens the lens at `port` with `driver`.
///
/// # Errors
/// What keeps it from being opened.
pub fn open_driver(
    driver: &LensDriver,
    port: Port,
    clock: Arc<dyn Clock>,
) -> Result<Box<dyn Lens>, DeviceError> {
    Ok(match driver {
        LensDriver::MoonLite(config) => Box::new(MoonLite::open(port, *config, clock)?),
        LensDriver::Optotune(config) => Box::new(Optotune::open(port, *config, clock)?),
        LensDriver::Grbl(config) => Box::new(Grbl::open(port, *config, clock)?),
        LensDriver::Firmata(config) => Box::new(Firmata::open(port, *config, clock)?),
        LensDriver::LabJack(config) => Box::new(LabJack::open(port, *config, clock)?),
        LensDriver::Indi(config) => Box::new(Indi::open(port, config.clone(), clock)?),
    })
}

/// Opens the camera of `driver` with `serial`, or the only one; and the same one again whenever it comes back.
fn open_usb(
    driver: Driver,
    serial: Option<String>,
    clock: &Arc<dyn Clock>,
    set_up: impl Fn(NusbTransport, Arc<dyn Clock>) -> Result<Box<dyn Camera>, DeviceError> + Send + 'static,
) -> Result<Box<dyn Camera>, DeviceError> {
    let (clock, mut serial) = (Arc::clone(clock), serial);
    let camera = ReopeningCamera::new(move || {
        let transport = usb::open(driver, serial.as_deref(), Arc::clone(&clock))?;
        let camera = set_up(transport, Arc::clone(&clock))?;
        // Another camera of its kind is not the one that was unplugged.
        serial = Some(camera.info().serial);
        Ok(camera)
    })?;
    Ok(Box::new(camera))
}

/// Model and serial, as reports name a device.
pub fn name(model: &str, serial: &str) -> String {
    format!("{model} {serial}")
}

/// What a failed operation means for the controller.
pub fn failure(error: &DeviceError) -> DeviceFailure {
    if error.kind == DeviceErrorKind::Disconnected {
        DeviceFailure::Gone
    } else if error.kind == DeviceErrorKind::TimedOut {
        DeviceFailure::Silent
    } else {
        DeviceFailure::Fault
    }
}

/// Does what the controller decided, as far as it concerns the lens.
pub fn perform(action: Action, lens: &mut dyn Lens) -> Result<(), DeviceError> {
    match action {
        Action::Home => lens.home(),
        Action::MoveLens { target, speed } => lens.move_to(target, speed),
        Action::StopLens => lens.stop(),
        Action::RunEnded => Ok(()),
    }
}
