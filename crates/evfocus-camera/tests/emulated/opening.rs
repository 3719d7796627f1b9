//! What can go wrong when a camera is opened: which part is wrong, and what helps, is said.

use std::time::Duration;

use evfocus_camera::Driver;
use evfocus_hal::DeviceErrorKind;
use hil_sim::UsbFaults;

use crate::common::Bench;

/// Opening with these faults must fail as `kind`, and say all of `words`.
fn refused(driver: Driver, faults: UsbFaults, kind: DeviceErrorKind, words: &[&str]) {
    let bench = Bench::new(driver);
    bench.set_faults(faults);
    let error = bench.open().and_then(|mut camera| camera.start()).unwrap_err();
    assert_eq!(error.kind, kind, "{error}");
    for word in words {
        assert!(error.to_string().contains(word), "{word:?} is not in \"{error}\"");
    }
}

#[test]
fn wrong_firmware_is_named_with_the_one_needed() {
    let firmware = |version| UsbFaults { firmware: Some(version), ..UsbFaults::default() };
    refused(Driver::Davis346, firmware(4), DeviceErrorKind::Protocol, &["firmware is 4", "needs 6"]);
    refused(
        Driver::Evk4,
        firmware(0x3_0700),
        DeviceErrorKind::Protocol,
        &["firmware is 3.7.0", "at least 3.8.0"],
    );
    let logic = UsbFaults { told: Some((6, 0, 17)), ..UsbFaults::default() };
    refused(Driver::Davis346, logic, DeviceErrorKind::Protocol, &["logic is 17.1", "needs 18.1", "flashing"]);
}

#[test]
fn another_sensor_and_senseless_clocks_are_named() {
    let told =
        |module, address, value| UsbFaults { told: Some((module, address, value)), ..UsbFaults::default() };
    let davis346 = |module, parameter, value, words: &[&str]| {
        let faults = told(module, parameter, value);
        refused(Driver::Davis346, faults, DeviceErrorKind::Protocol, words);
    };
    davis346(6, 1, 2, &["chip is number 2", "260", "346"]);
    davis346(1, 0, 640, &["640 columns"]);
    davis346(6, 5, 0, &["parameter 5 of module 6 is 0", "1 to 1000"]);
    davis346(6, 6, u32::MAX, &["parameter 6 of module 6 is 4294967295", "500 to 2000"]);
    let chip = ["0x00000001", "0xa0401806"];
    refused(Driver::Evk4, told(0, 0x14, 1), DeviceErrorKind::Protocol, &chip);
    refused(Driver::Evk4, told(0, 0xF128, 2), DeviceErrorKind::Protocol, &["variant 2"]);
}

#[test]
fn answers_that_are_none_are_refused() {
    for driver in Driver::ALL {
        let faults = UsbFaults { garbled_answers: true, ..UsbFaults::default() };
        refused(driver, faults, DeviceErrorKind::Protocol, &[]);
    }
}

#[test]
fn slow_answers_are_waited_for_and_missing_ones_are_not() {
    for driver in Driver::ALL {
        let bench = Bench::new(driver);
        let slow = Duration::from_millis(40);
        bench.set_faults(UsbFaults { control_delay: slow, ..UsbFaults::default() });
        bench.open().unwrap().start().unwrap();
        let faults = UsbFaults { control_delay: Duration::from_secs(60), ..UsbFaults::default() };
        refused(driver, faults, DeviceErrorKind::TimedOut, &["unplug"]);
    }
}

#[test]
fn the_systems_limit_on_usb_memory_is_named() {
    for driver in Driver::ALL {
        let faults = UsbFaults { no_memory_for: Some(4), ..UsbFaults::default() };
        refused(driver, faults, DeviceErrorKind::Fault, &["/sys/module/usbcore/parameters/usbfs_memory_mb"]);
    }
}
