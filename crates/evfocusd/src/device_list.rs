//! What there is to list: the devices in use, and the cameras and serial ports that are attached besides.

use evfocus_camera::{Access, Driver, FoundCamera, discovery, usb};
use evfocus_hal::{CameraInfo, LensInfo};
use evfocus_ipc::{Device, DeviceRole, DeviceState, Status};

use crate::config::{CameraConfig, Config, LensBackend};
use crate::serial_ports;

/// The devices in use.
#[derive(Debug)]
pub(crate) struct DeviceList {
    camera_config: CameraConfig,
    camera: CameraInfo,
    lens_backend: LensBackend,
    lens: LensInfo,
}

impl DeviceList {
    /// The devices that `config` names.
    pub(crate) fn new(config: &Config, camera: CameraInfo, lens: LensInfo) -> Self {
        let lens_backend = config.lens.clone();
        Self { camera_config: config.camera.clone(), camera, lens_backend, lens }
    }

    /// The devices in use and those that are attached. Asks the attached ones, which may take its time; what answers on the serial
    /// ports of `probe`, or on those on USB if it is empty, only if it is there.
    pub(crate) fn list(&self, status: &Status, probe: Option<&[String]>) -> Vec<Device> {
        let mut attached = attached();
        let location = match (&self.camera_config, self.camera_config.driver()) {
            (CameraConfig::Replay { file, .. }, _) => Some(file.display().to_string()),
            (_, Some(driver)) => take_out(&mut attached, (driver, &self.camera.serial)),
            (_, None) => Some(self.camera_config.name()),
        };
        let state = |is_there: bool| if is_there { DeviceState::Active } else { DeviceState::Missing };
        let message = |is_there: bool| if is_there { None } else { status.fault.clone() };
        let (camera_is_there, lens_is_there) = (status.camera.is_some(), status.lens.is_some());
        let camera = Device {
            role: DeviceRole::Camera,
            driver: self.camera_config.name(),
            model: self.camera.model.clone(),
            serial: self.camera.serial.clone(),
            location: location.unwrap_or_default(),
            state: state(camera_is_there),
            message: message(camera_is_there),
        };
        let lens = Device {
            role: DeviceRole::Lens,
            driver: self.lens_backend.name().to_owned(),
            model: self.lens.model.clone(),
            serial: self.lens.serial.clone(),
            location: self.lens_backend.location().to_owned(),
            state: state(lens_is_there),
            message: message(lens_is_there),
        };
        let ports = serial_ports::free(self.lens_backend.location(), probe);
        [camera, lens].into_iter().chain(attached.into_iter().map(device)).chain(ports).collect()
    }
}

/// The USB cameras that are attached.
fn attached() -> Vec<FoundCamera> {
    usb::list().unwrap_or_else(|error| {
        tracing::debug!(%error, "no list of USB devices");
        Vec::new()
    })
}

/// Takes the camera of `driver` with `serial`, which is in use, out of those found; where it is.
fn take_out(found: &mut Vec<FoundCamera>, (driver, serial): (Driver, &str)) -> Option<String> {
    // A camera that is in use does not tell its number to others if it tells it on request only.
    let is_silent = |camera: &FoundCamera| camera.serial.is_empty() && camera.access == Access::Busy;
    let place = found
        .iter()
        .position(|camera| camera.device.driver == driver && (camera.serial == serial || is_silent(camera)));
    place.map(|index| found.remove(index).location)
}

/// An attached camera as clients see it.
fn device(camera: FoundCamera) -> Device {
    let (state, message) = match camera.access {
        Access::Free => (DeviceState::Available, None),
        Access::Denied(remedy) => (DeviceState::PermissionDenied, Some(remedy)),
        Access::Busy => (DeviceState::Busy, Some("another program has it; end that program".to_owned())),
        Access::Faulty(what) => (DeviceState::Missing, Some(what)),
    };
    let untested = (!camera.device.is_tested)
        .then(|| "untested: it is known to speak the protocol of its driver, and nothing more".to_owned());
    let advice = discovery::advice_on_speed(camera.speed).map(str::to_owned);
    let notes: Vec<_> = [message, advice, untested].into_iter().flatten().collect();
    Device {
        role: DeviceRole::Camera,
        driver: camera.device.driver.to_string(),
        model: camera.device.model.to_owned(),
        serial: camera.serial,
        location: camera.location,
        state,
        message: (!notes.is_empty()).then(|| notes.join("; ")),
    }
}

#[cfg(test)]
mod tests {
    use evfocus_camera::discovery::KNOWN_DEVICES;
    use evfocus_hal::usb::UsbSpeed;

    use super::*;

    fn found(driver: Driver, serial: &str, access: Access) -> FoundCamera {
        let device = *KNOWN_DEVICES.iter().find(|device| device.driver == driver).unwrap();
        let location = format!("usb1:{serial}");
        let (serial, speed) = (serial.to_owned(), Some(UsbSpeed::High));
        FoundCamera { device, serial, location, speed, version: 6, access }
    }

    #[test]
    fn the_camera_in_use_is_not_listed_twice() {
        let busy = |serial| found(Driver::Evk4, serial, Access::Busy);
        let davis = found(Driver::Davis346, "7", Access::Free);
        let mut cameras = vec![davis.clone(), busy("")];
        assert_eq!(take_out(&mut cameras, (Driver::Evk4, "00000009")), Some("usb1:".to_owned()));
        assert_eq!(cameras.as_slice(), std::slice::from_ref(&davis));
        assert_eq!(take_out(&mut cameras, (Driver::Davis346, "8")), None);
        assert_eq!(take_out(&mut cameras, (Driver::Davis346, "7")), Some("usb1:7".to_owned()));
    }

    #[test]
    fn trouble_is_a_state_with_its_remedy() {
        let remedy = "install the udev rule".to_owned();
        let denied = device(found(Driver::Davis346, "7", Access::Denied(remedy)));
        assert_eq!(denied.state, DeviceState::PermissionDenied);
        let message = denied.message.unwrap();
        assert!(message.contains("udev rule") && message.contains("USB 3"), "{message}");
        let busy = device(found(Driver::Evk4, "7", Access::Busy));
        assert_eq!(busy.state, DeviceState::Busy);
        assert!(busy.message.unwrap().contains("another program has it"));
        let faulty = device(found(Driver::Evk4, "7", Access::Faulty("system number 0x00".to_owned())));
        assert_eq!(faulty.state, DeviceState::Missing);
        assert!(faulty.message.unwrap().contains("system number 0x00"));
        let free = found(Driver::Davis346, "7", Access::Free);
        let fast = device(FoundCamera { speed: Some(UsbSpeed::Super), ..free });
        assert_eq!(
            (fast.state, fast.message, fast.driver.as_str()),
            (DeviceState::Available, None, "davis346")
        );
    }
}
