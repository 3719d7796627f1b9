//! Choosing among cameras; this machine's ports.

use evfocus_camera::discovery::{KNOWN_DEVICES, advice_on_speed, check_access, select};
use evfocus_camera::{Access, Driver, FoundCamera, SelectError, usb};
use evfocus_hal::DeviceErrorKind;
use evfocus_hal::usb::UsbSpeed;

fn camera(driver: Driver, serial: &str) -> FoundCamera {
    FoundCamera {
        device: *KNOWN_DEVICES.iter().find(|device| device.driver == driver).unwrap(),
        serial: serial.to_owned(),
        location: format!("usb1:{serial}"),
        speed: Some(UsbSpeed::Super),
        version: 6,
        access: Access::Free,
    }
}

#[test]
fn the_only_camera_of_its_kind_needs_no_name() {
    let found = [camera(Driver::Davis346, "1"), camera(Driver::Evk4, "2")];
    assert_eq!(select(&found, Driver::Davis346, None), Ok(&found[0]));
    assert_eq!(select(&found, Driver::Evk4, Some("2")), Ok(&found[1]));
}

#[test]
fn of_several_cameras_one_must_be_named() {
    let found = [camera(Driver::Davis346, "1"), camera(Driver::Davis346, "2")];
    let error = select(&found, Driver::Davis346, None).unwrap_err();
    assert_eq!(
        error.to_string(),
        "2 cameras are attached; name one by its serial number: DAVIS346 1 at usb1:1; DAVIS346 2 at usb1:2"
    );
    assert_eq!(select(&found, Driver::Davis346, Some("2")), Ok(&found[1]));
    let error = select(&found, Driver::Davis346, Some("3")).unwrap_err();
    assert!(error.to_string().contains("serial number 3 is attached; there is DAVIS346 1"), "{error}");
}

#[test]
fn no_camera_is_said_with_what_to_check() {
    let found = [camera(Driver::Davis346, "1")];
    let error = select(&found, Driver::Evk4, None).unwrap_err();
    assert_eq!(error, SelectError::NoneAttached { driver: Driver::Evk4 });
    assert_eq!(error.to_string(), "no evk4 is attached; check cable and power, and that lsusb shows it");
}

#[test]
fn what_keeps_a_camera_from_being_opened_is_said_with_the_remedy() {
    let error = |access| {
        let error = check_access(&FoundCamera { access, ..camera(Driver::Davis346, "7") }).unwrap_err();
        (error.kind, error.to_string())
    };
    let (kind, text) = error(Access::Busy);
    assert_eq!(kind, DeviceErrorKind::Busy);
    assert!(text.contains("DAVIS346 7 at usb1:7") && text.contains("end the other program"), "{text}");
    let (kind, text) = error(Access::Denied("install the udev rule".to_owned()));
    assert_eq!(kind, DeviceErrorKind::PermissionDenied);
    assert!(text.contains("DAVIS346 7") && text.contains("install the udev rule"), "{text}");
    let (kind, text) = error(Access::Faulty("system number 0x00".to_owned()));
    assert_eq!(kind, DeviceErrorKind::Protocol);
    assert!(text.contains("system number 0x00"), "{text}");
    assert_eq!(check_access(&camera(Driver::Davis346, "7")), Ok(()));
}

#[test]
fn a_camera_that_keeps_its_number_to_itself_may_be_the_one_named() {
    // Who may not open an EVK4 does not learn its number, and should hear of the permission.
    let found = [FoundCamera { access: Access::Denied("a remedy".to_owned()), ..camera(Driver::Evk4, "") }];
    assert_eq!(select(&found, Driver::Evk4, Some("7")), Ok(&found[0]));
}

#[test]
fn slow_ports_and_untested_models_are_said() {
    assert!(advice_on_speed(Some(UsbSpeed::High)).unwrap().contains("USB 3"));
    assert_eq!((advice_on_speed(Some(UsbSpeed::Super)), advice_on_speed(None)), (None, None));
    let mut silky = camera(Driver::Evk4, "9");
    silky.device = *KNOWN_DEVICES.iter().find(|device| device.id == (0x31F7, 0x0003)).unwrap();
    assert_eq!(silky.to_string(), "SilkyEvCam HD 9 at usb1:9 (untested)");
}

#[test]
fn this_machine_is_asked_without_harm() {
    // With ports or without, with cameras or without.
    match usb::list() {
        Ok(found) => println!("{} cameras are attached", found.len()),
        Err(error) => assert!(error.what.contains("USB"), "{error}"),
    }
}
