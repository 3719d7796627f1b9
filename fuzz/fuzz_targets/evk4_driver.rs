//! The driver on a device that answers anything.
#![no_main]

use std::sync::Arc;

use evfocus_camera::evk4::{Evk4, Settings};
use evfocus_fuzz::device;
use evfocus_hal::VirtualClock;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let clock = Arc::new(VirtualClock::new());
    let device = device::Anything::new(data, (0x04B4, 0x00F5), clock.clone(), |_, answer| answer[0] = 0x31);
    if let Ok(camera) = Evk4::open(device, &Settings::default(), clock) {
        device::use_it(camera);
    }
});
