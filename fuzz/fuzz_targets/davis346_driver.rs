//! The driver on a device that answers anything.
#![no_main]

use std::sync::Arc;

use evfocus_camera::davis346::{Davis346, Settings};
use evfocus_fuzz::device;
use evfocus_hal::VirtualClock;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let clock = Arc::new(VirtualClock::new());
    // Sound answers for as long as the data say, or opening never gets far.
    let sound = |module: u16, parameter: u16| match (module, parameter) {
        (6, 0) => 18,
        (6, 1) => 5,
        (6, 6) => 1008,
        (6, 7) => 1,
        (1, 0) => 260,
        (1, 1) => 346,
        (1, 2) => 4,
        _ => 1,
    };
    let device = device::Anything::new(data, (0x152A, 0x841A), clock.clone(), move |request, answer| {
        answer.copy_from_slice(&u32::to_be_bytes(sound(request.value, request.index)));
    });
    if let Ok(camera) = Davis346::open(device, &Settings::default(), clock) {
        device::use_it(camera);
    }
});
