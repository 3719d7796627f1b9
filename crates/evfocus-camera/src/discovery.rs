//! Which cameras are attached, and which of them is meant.

use std::fmt;
use std::str::FromStr;

use evfocus_hal::usb::UsbSpeed;
use evfocus_hal::{DeviceError, DeviceErrorKind};

use crate::{davis346, evk4};

/// A driver.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Driver {
    /// [`davis346`].
    Davis346,
    /// [`evk4`].
    Evk4,
}

impl Driver {
    /// All drivers.
    pub const ALL: [Self; 2] = [Self::Davis346, Self::Evk4];
}

impl fmt::Display for Driver {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Davis346 => "davis346",
            Self::Evk4 => "evk4",
        })
    }
}

/// There is no such driver.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("there is no camera driver {name:?}; there are davis346 and evk4")]
pub struct UnknownDriver {
    /// The name given.
    pub name: String,
}

impl FromStr for Driver {
    type Err = UnknownDriver;

    fn from_str(name: &str) -> Result<Self, UnknownDriver> {
        let found = Self::ALL.into_iter().find(|driver| driver.to_string() == name);
        found.ok_or_else(|| UnknownDriver { name: name.to_owned() })
    }
}

/// A kind of device that a driver can be tried on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct KnownDevice {
    /// Its vendor and product number.
    pub id: (u16, u16),
    /// Its driver.
    pub driver: Driver,
    /// What it is.
    pub model: &'static str,
    /// Whether the driver was written for it and tested with its emulation; otherwise it is known to speak the same protocol,
    /// and nothing more. Nothing here was tested with a device of either kind yet.
    pub is_tested: bool,
}

const fn known(id: (u16, u16), driver: Driver, model: &'static str, is_tested: bool) -> KnownDevice {
    KnownDevice { id, driver, model, is_tested }
}

/// All that are known.
pub const KNOWN_DEVICES: [KnownDevice; 6] = [
    known((0x152A, 0x841A), Driver::Davis346, davis346::MODEL, true),
    known((0x152A, 0x841B), Driver::Davis346, "DAVIS346 with FX2", false),
    known((0x04B4, 0x00F5), Driver::Evk4, evk4::MODEL, true),
    // EVK3 HD boards have these numbers too.
    known((0x04B4, 0x00F4), Driver::Evk4, evk4::MODEL, true),
    known((0x31F7, 0x0003), Driver::Evk4, "SilkyEvCam HD", false),
    known((0x1409, 0x8E00), Driver::Evk4, "uEye XCP-E", false),
];

/// Whether an attached camera can be opened.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Access {
    /// It can.
    Free,
    /// The system does not let this user open it; the remedy.
    Denied(String),
    /// Another program has it, or this one.
    Busy,
    /// It does not answer as it must; what happened.
    Faulty(String),
}

/// An attached camera.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FoundCamera {
    /// What it is.
    pub device: KnownDevice,
    /// Serial number; empty if it has none, or tells it only to who may open it.
    pub serial: String,
    /// Where it is attached: `usb` bus `:` address.
    pub location: String,
    /// The link's speed; `None` if the system does not tell.
    pub speed: Option<UsbSpeed>,
    /// `bcdDevice`.
    pub version: u16,
    /// Whether it can be opened.
    pub access: Access,
}

impl fmt::Display for FoundCamera {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { device, serial, location, .. } = self;
        let serial = if serial.is_empty() { "without a serial number" } else { serial };
        write!(f, "{} {serial} at {location}", device.model)?;
        if device.is_tested { Ok(()) } else { f.write_str(" (untested)") }
    }
}

/// Why no camera was chosen.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SelectError {
    /// None of this kind is attached.
    #[error("no {driver} is attached; check cable and power, and that lsusb shows it")]
    NoneAttached {
        /// The kind.
        driver: Driver,
    },
    /// None with this serial number is attached.
    #[error("no {driver} with serial number {serial} is attached; there is {}", list(found))]
    NoSuchSerial {
        /// The kind.
        driver: Driver,
        /// The number asked for.
        serial: String,
        /// Those that are attached.
        found: Vec<FoundCamera>,
    },
    /// There are several, and none was named.
    #[error("{} cameras are attached; name one by its serial number: {}", found.len(), list(found))]
    Several {
        /// Those that are attached.
        found: Vec<FoundCamera>,
    },
}

fn list(cameras: &[FoundCamera]) -> String {
    cameras.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
}

/// The one camera of `driver` among `found` that has `serial`, or the only one.
///
/// # Errors
/// [`SelectError`] if there is no such camera, or more than one.
pub fn select<'a>(
    found: &'a [FoundCamera],
    driver: Driver,
    serial: Option<&str>,
) -> Result<&'a FoundCamera, SelectError> {
    let of_kind: Vec<_> = found.iter().filter(|camera| camera.device.driver == driver).collect();
    let fits = |camera: &&&FoundCamera| serial.is_none_or(|serial| camera.serial == serial);
    let owned = |cameras: &[&FoundCamera]| cameras.iter().map(|&camera| camera.clone()).collect();
    let fitting: Vec<_> = of_kind.iter().filter(fits).copied().collect();
    match (fitting.as_slice(), serial) {
        ([camera], _) => Ok(camera),
        ([], Some(serial)) if !of_kind.is_empty() => {
            // A camera that keeps its number to itself may be the one, if it is the only one of its kind.
            if let [camera] = of_kind.as_slice()
                && camera.serial.is_empty()
            {
                return Ok(camera);
            }
            Err(SelectError::NoSuchSerial { driver, serial: serial.to_owned(), found: owned(&of_kind) })
        }
        ([], _) => Err(SelectError::NoneAttached { driver }),
        (several, _) => Err(SelectError::Several { found: owned(several) }),
    }
}

/// What keeps `camera` from being opened, if anything does.
///
/// # Errors
/// It is in use, the user may not open it, or it does not answer as it must; with the remedy.
pub fn check_access(camera: &FoundCamera) -> Result<(), DeviceError> {
    let (kind, what) = match &camera.access {
        Access::Free => return Ok(()),
        Access::Denied(remedy) => (DeviceErrorKind::PermissionDenied, remedy.as_str()),
        Access::Busy => (DeviceErrorKind::Busy, "end the other program; lsof /dev/bus/usb/*/* tells which"),
        Access::Faulty(what) => (DeviceErrorKind::Protocol, what.as_str()),
    };
    Err(DeviceError::new(kind, camera.to_string(), what))
}

/// What a slow link means for an event camera; `None` for one that is fast enough, or unknown.
pub fn advice_on_speed(speed: Option<UsbSpeed>) -> Option<&'static str> {
    (speed? < UsbSpeed::Super).then_some(
        "the port or the cable is slower than USB 3: events are lost at high rates, which falsifies the event rate; use a USB 3 port",
    )
}
