//! The driver behind a line that spoils what comes over it.
#![no_main]

use evfocus_fuzz::lens;
use evfocus_lens::firmata::{Firmata, FirmataConfig};
use hil_sim::wire::Protocol;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let config = FirmataConfig { pwm_pin: 3, direction_pin: 4, channel: 0, drive: lens::drive() };
    lens::fuzz(Protocol::Firmata, data, |port, clock| Firmata::open(port, config, clock));
});
