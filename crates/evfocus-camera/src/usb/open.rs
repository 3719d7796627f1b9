//! Finding cameras and opening one.

use std::sync::Arc;

use evfocus_hal::usb::{UsbIdentity, UsbSpeed};
use evfocus_hal::{Clock, DeviceError, DeviceErrorKind, SystemClock};
use nusb::{DeviceInfo, ErrorKind, MaybeFuture, Speed};

use super::NusbTransport;
use crate::discovery::{
    Access, Driver, FoundCamera, KNOWN_DEVICES, KnownDevice, SelectError, check_access, select,
};
use crate::evk4;

/// All cameras use their first interface, in their first configuration.
const INTERFACE: u8 = 0;
const CONFIGURATION: u8 = 1;

/// What helps where the system does not let one open a camera.
const PERMISSION_REMEDY: &str = "install config/udev/70-evfocus.rules, join the group video (sudo usermod -aG video $USER, then log in \
                                 again), and plug the camera in again";

/// The cameras that are attached.
///
/// # Errors
/// [`DeviceErrorKind::Fault`] if the system does not tell what is attached.
pub fn list() -> Result<Vec<FoundCamera>, DeviceError> {
    Ok(attached()?.into_iter().map(|(device, info)| found(device, &info)).collect())
}

/// Claims the camera of `driver` that has `serial`, or the only one.
///
/// # Errors
/// None or several are attached; another program has it; the system does not let this user open it.
pub fn open(
    driver: Driver,
    serial: Option<&str>,
    clock: Arc<dyn Clock>,
) -> Result<NusbTransport, DeviceError> {
    let attached = attached()?;
    let found: Vec<_> = attached.iter().map(|(device, info)| found(*device, info)).collect();
    let chosen = select(&found, driver, serial).map_err(|error| {
        let kind = match error {
            SelectError::NoneAttached { .. } | SelectError::NoSuchSerial { .. } => {
                DeviceErrorKind::Disconnected
            }
            SelectError::Several { .. } => DeviceErrorKind::OutOfRange,
        };
        DeviceError::new(kind, driver.to_string(), error.to_string())
    })?;
    let name = chosen.to_string();
    check_access(chosen)?;
    let info = attached.iter().find(|(_, info)| location(info) == chosen.location);
    let (_, info) =
        info.ok_or_else(|| DeviceError::new(DeviceErrorKind::Disconnected, &name, "plug it in again"))?;
    claim(info, clock).map_err(|error| device_error(&error, &name))
}

/// The attached devices that are known.
fn attached() -> Result<Vec<(KnownDevice, DeviceInfo)>, DeviceError> {
    let devices = nusb::list_devices().wait().map_err(|error| {
        let what = format!("the system does not tell what is attached: {error}; is there a USB port?");
        DeviceError::new(DeviceErrorKind::Fault, "USB", what)
    })?;
    let known = |info: &DeviceInfo| {
        KNOWN_DEVICES.into_iter().find(|device| device.id == (info.vendor_id(), info.product_id()))
    };
    let mut found: Vec<_> = devices.filter_map(|info| Some((known(&info)?, info))).collect();
    found.sort_by_key(|(_, info)| location(info));
    Ok(found)
}

fn found(device: KnownDevice, info: &DeviceInfo) -> FoundCamera {
    let mut serial = info.serial_number().unwrap_or_default().to_owned();
    let access = match claim(info, Arc::new(SystemClock::new())) {
        Ok(mut transport) => match device.driver {
            // It tells its number on request only.
            Driver::Evk4 => match evk4::read_serial(&mut transport) {
                Ok(number) => {
                    serial = number;
                    Access::Free
                }
                Err(error) => Access::Faulty(error.what),
            },
            Driver::Davis346 => Access::Free,
        },
        Err(error) if error.kind() == ErrorKind::PermissionDenied => {
            Access::Denied(PERMISSION_REMEDY.to_owned())
        }
        Err(error) if error.kind() == ErrorKind::Busy => Access::Busy,
        Err(error) => Access::Faulty(error.to_string()),
    };
    let version = info.device_version();
    FoundCamera { device, serial, location: location(info), speed: speed(info), version, access }
}

/// Opens the device and claims its interface.
fn claim(info: &DeviceInfo, clock: Arc<dyn Clock>) -> Result<NusbTransport, nusb::Error> {
    let device = info.open().wait()?;
    let is_configured =
        device.active_configuration().is_ok_and(|active| active.configuration_value() == CONFIGURATION);
    if !is_configured {
        device.set_configuration(CONFIGURATION).wait()?;
    }
    let interface = device.detach_and_claim_interface(INTERFACE).wait()?;
    let identity = UsbIdentity {
        vendor: info.vendor_id(),
        product: info.product_id(),
        version: info.device_version(),
        serial: info.serial_number().unwrap_or_default().to_owned(),
        speed: speed(info),
    };
    Ok(NusbTransport::new(interface, identity, clock))
}

fn device_error(error: &nusb::Error, name: &str) -> DeviceError {
    let known = [
        (ErrorKind::Disconnected, DeviceErrorKind::Disconnected, "plug it in again"),
        (ErrorKind::Busy, DeviceErrorKind::Busy, "end the other program"),
        (ErrorKind::PermissionDenied, DeviceErrorKind::PermissionDenied, PERMISSION_REMEDY),
    ];
    let (kind, remedy) = known
        .into_iter()
        .find(|(kind, ..)| *kind == error.kind())
        .map_or((DeviceErrorKind::Fault, "the system's log may say more"), |(_, kind, remedy)| {
            (kind, remedy)
        });
    DeviceError::new(kind, name, format!("opening it: {error}; {remedy}"))
}

fn location(info: &DeviceInfo) -> String {
    format!("usb{}:{}", info.bus_id(), info.device_address())
}

fn speed(info: &DeviceInfo) -> Option<UsbSpeed> {
    match info.speed()? {
        Speed::Low | Speed::Full => Some(UsbSpeed::Full),
        Speed::High => Some(UsbSpeed::High),
        Speed::Super | Speed::SuperPlus => Some(UsbSpeed::Super),
        _ => None,
    }
}
