//! The driver behind a line that spoils what comes over it.
#![no_main]

use evfocus_fuzz::lens;
use evfocus_lens::labjack::{LabJack, LabJackConfig};
use hil_sim::wire::Protocol;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let config = LabJackConfig {
        channel: 0,
        reference_volts: 5.0,
        full_drive_volts: 5.0,
        direction_volts: 5.0,
        drive: lens::drive(),
    };
    lens::fuzz(Protocol::LabJack, data, |port, clock| LabJack::open(port, config, clock));
});
