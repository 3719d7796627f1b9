//! Failed transfers as what the focus loop understands, with what to do about them.

use evfocus_hal::usb::{UsbError, UsbIdentity};
use evfocus_hal::{DeviceError, DeviceErrorKind};

/// The name of a device in messages: model and serial.
pub(crate) fn device_name(model: &str, serial: &str) -> String {
    format!("{model} {serial}").trim_end().to_owned()
}

/// A transfer of `device` that failed while `what` was tried.
pub(crate) fn transfer_error(error: UsbError, device: &str, what: &str) -> DeviceError {
    let (kind, remedy) = match error {
        UsbError::Disconnected => (DeviceErrorKind::Disconnected, "plug it in again"),
        // A cable that is being pulled looks like this first; opening it again tells.
        UsbError::Fault => (DeviceErrorKind::Disconnected, "check cable and port; it will be opened again"),
        UsbError::TimedOut => (DeviceErrorKind::TimedOut, "unplug the camera and plug it in again"),
        UsbError::Stalled => (DeviceErrorKind::Protocol, "the camera's firmware does not know this request"),
        UsbError::OutOfMemory => (
            DeviceErrorKind::Fault,
            "raise the limit, for example: echo 128 | sudo tee /sys/module/usbcore/parameters/usbfs_memory_mb",
        ),
        UsbError::System(_) => (DeviceErrorKind::Fault, "the system's log may say more"),
    };
    DeviceError::new(kind, device, format!("{what}: {error}; {remedy}"))
}

/// The device's firmware is not the one this driver was written for.
pub(crate) fn wrong_version(
    device: &str,
    part: &str,
    found: &str,
    needed: &str,
    remedy: &str,
) -> DeviceError {
    let what = format!("its {part} is {found}, and this driver needs {needed}; {remedy}");
    DeviceError::new(DeviceErrorKind::Protocol, device, what)
}

/// Logs what a slow port does to an event camera.
pub(crate) fn warn_of_slow_port(device: &str, identity: &UsbIdentity) {
    if let Some(advice) = crate::discovery::advice_on_speed(identity.speed) {
        tracing::warn!(device, advice);
    }
}
