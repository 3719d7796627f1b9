//! Cameras on the wire: emulated devices behind the USB trait, so that the real drivers can be run against the simulated rig.
//!
//! A device has the registers, requests, stream words and packets of its model, written from the makers' published software and
//! not from our drivers; what its pixels see comes from the rig. A [`UsbPort`] is the socket it is plugged into: opening it
//! gives a [`EmulatedUsb`], what drivers take for the system's USB.
//!
//! The picture of the rig's sensor is the upper left part of the device's, so that a small simulated sensor can stand for a
//! large one.

mod background;
mod davis346;
mod descriptors;
mod device;
mod evk4;
mod faults;
mod link;
mod tally;
mod transport;
pub mod usbip;

use std::sync::{Arc, Mutex, MutexGuard};

use evfocus_hal::usb::{UsbError, UsbIdentity};

use crate::camera::SimCamera;
use crate::rig::Rig;
use background::Background;
use device::Device;
use link::Link;

pub use faults::UsbFaults;
pub use tally::Tally;
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
    /// Those that are not simulated.
    background: Option<Background>,
    /// Events and bytes that were put into the stream, whatever became of it.
    sent: (u64, u64),
    faults: UsbFaults,
    /// The data endpoint refuses until its halt is cleared.
    halted: bool,
    is_plugged: bool,
    /// Counts the times the cable was pulled: a connection of an earlier plug is dead.
    plug: u32,
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
            background: None,
            sent: (0, 0),
            faults: UsbFaults::default(),
            halted: false,
            is_plugged: true,
            plug: 0,
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
        let (identity, link) = self.connect()?;
        Ok(EmulatedUsb::new(identity, self.rig.clock(), link))
    }

    /// Pulls the camera's cable. Connections stay dead; what the camera knew is gone.
    pub fn pull(&self) {
        let mut shared = lock(&self.shared);
        if shared.is_plugged {
            shared.is_plugged = false;
            shared.plug += 1;
            self.power_up(&mut shared);
        }
    }

    /// Puts the cable that was [pulled](Self::pull) in again.
    pub fn push(&self) {
        lock(&self.shared).is_plugged = true;
    }

    /// A connection to the device, and what the device says of itself.
    fn connect(&self) -> Result<(UsbIdentity, Link), UsbError> {
        let mut shared = lock(&self.shared);
        if shared.camera.is_unplugged() {
            self.power_up(&mut shared);
        }
        if !shared.is_plugged || shared.camera.is_unplugged() {
            return Err(UsbError::Disconnected);
        }
        let identity = shared.device.identity(&shared.faults);
        drop(shared);
        Ok((identity, Link::new(Arc::clone(&self.shared))))
    }

    /// Everything as it is after power-up.
    fn power_up(&self, shared: &mut Shared) {
        shared.camera = self.rig.devices().0;
        shared.device = device::power_up(self.model, self.rig.config().seed);
        shared.halted = false;
    }

    /// From now on, what goes wrong.
    pub fn set_faults(&self, faults: UsbFaults) {
        lock(&self.shared).faults = faults;
    }

    /// Lets the pixels below the simulated ones send events by chance, so many a second.
    pub fn set_background(&self, events_per_s: u32) {
        let size = match self.model {
            UsbModel::Davis346 => (346, 260),
            UsbModel::Evk4 => (1280, 720),
        };
        let simulated = self.rig.config().sensor.geometry.height;
        lock(&self.shared).background = Some(Background::new(events_per_s, size, simulated));
    }

    /// Events and bytes that the camera has put into its streams so far, over all connections; those that nobody read are among them.
    pub fn sent(&self) -> (u64, u64) {
        lock(&self.shared).sent
    }

    /// Sums over the first 2, 4, 8 and so on events that the camera has put into its stream, since the stream began or the host
    /// reset the camera's time.
    pub fn tallies(&self) -> Vec<Tally> {
        lock(&self.shared).device.tallies().to_vec()
    }

    /// What a register of the device holds: of the DAVIS346 module and parameter, of the EVK4 zero and the address.
    pub fn register(&self, module: u8, address: u32) -> u32 {
        lock(&self.shared).device.register(module, address)
    }
}
