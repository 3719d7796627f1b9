//! Cameras on the wire: emulated devices behind the USB trait, so that the real drivers can be run against the simulated rig.
//!
//! A device has the registers, requests, stream words and packets of its model, written from the makers' published software and
//! not from our drivers; what its pixels see comes from the rig. A [`UsbPort`] is the socket it is plugged into: opening it
//! gives a [`EmulatedUsb`], what drivers take for the system's USB.
//!
//! The picture of the rig's sensor is the upper left part of the device's, so that a small simulated sensor can stand for a
//! large one.

mod davis346;
mod device;
mod evk4;
mod faults;
mod transport;

use std::sync::{Arc, Mutex, MutexGuard};

use evfocus_hal::usb::UsbError;

use crate::camera::SimCamera;
use crate::rig::Rig;
use device::Device;

pub use faults::UsbFaults;
pub use transport::EmulatedUsb;

/// Which camera is on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UsbModel {
    /// iniVation DAVIS346 with FX3 and logic 18.
    Davis346,
    /// Prophesee EVK4.
    Evk4,
}

/// A USB port with a camera in it. Clones are handles to the same port.
#[derive(Debug, Clone)]
pub struct UsbPort {
    rig: Rig,
    model: UsbModel,
    shared: Arc<Mutex<Shared>>,
}

/// What the port's handles and the transport share.
#[derive(Debug)]
struct Shared {
    device: Box<dyn Device>,
    /// The pixels.
    camera: SimCamera,
    faults: UsbFaults,
    /// The data endpoint refuses until its halt is cleared.
    halted: bool,
}

/// The lock, whatever a test that panicked has done with it.
fn lock(shared: &Mutex<Shared>) -> MutexGuard<'_, Shared> {
    shared.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

impl Rig {
    /// Plugs a camera of `model` into a port; its pixels are the rig's.
    pub fn plug(&self, model: UsbModel) -> UsbPort {
        let shared = Shared {
            device: device::power_up(model, self.config().seed),
            camera: self.devices().0,
            faults: UsbFaults::default(),
            halted: false,
        };
        UsbPort { rig: self.clone(), model, shared: Arc::new(Mutex::new(shared)) }
    }
}

impl UsbPort {
    /// Opens the device and claims its interface. A camera that was unplugged is plugged in again, as after power-up, once the
    /// rig is repaired.
    ///
    /// # Errors
    /// [`UsbError::Disconnected`] while it is unplugged.
    pub fn open(&self) -> Result<EmulatedUsb, UsbError> {
        let mut shared = lock(&self.shared);
        if shared.camera.is_unplugged() {
            let (mut camera, _) = self.rig.devices();
            if camera.is_unplugged() {
                return Err(UsbError::Disconnected);
            }
            shared.camera = camera;
            shared.device = device::power_up(self.model, self.rig.config().seed);
            shared.halted = false;
        }
        let identity = shared.device.identity(&shared.faults);
        Ok(EmulatedUsb::new(identity, self.rig.clock(), Arc::clone(&self.shared)))
    }

    /// From now on, what goes wrong.
    pub fn set_faults(&self, faults: UsbFaults) {
        lock(&self.shared).faults = faults;
    }

    /// What a register of the device holds: of the DAVIS346 module and parameter, of the EVK4 zero and the address.
    pub fn register(&self, module: u8, address: u32) -> u32 {
        lock(&self.shared).device.register(module, address)
    }
}
