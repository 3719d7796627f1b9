//! What the focus loop needs of its devices beyond the traits: opening them, and telling their failures apart.

use std::sync::Arc;

use evfocus_core::controller::{Action, DeviceFailure};
use evfocus_hal::{Camera, Clock, DeviceError, DeviceErrorKind, Lens};

use crate::config::Config;

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
    /// Opens the devices that `config` names; simulated ones live on `clock`.
    ///
    /// # Errors
    /// [`hil_sim::ConfigError`] if the simulated rig makes no sense.
    pub fn open(config: &Config, clock: &Arc<dyn Clock>) -> Result<Self, hil_sim::ConfigError> {
        let rig = hil_sim::Rig::new(config.rig.clone(), Arc::clone(clock))?;
        let (camera, lens) = rig.devices();
        Ok(Self { camera: Box::new(camera), lens: Box::new(lens) })
    }
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
