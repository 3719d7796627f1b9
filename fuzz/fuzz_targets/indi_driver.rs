//! The driver behind a line that spoils what comes over it.
#![no_main]

use libfuzzer_sys::fuzz_target;
use std::time::Duration;

use evfocus_fuzz::lens;
use evfocus_lens::indi::{Indi, IndiConfig};
use hil_sim::wire::Protocol;

fuzz_target!(|data: &[u8]| {
    let config = IndiConfig {
        device: "Focuser".to_owned(),
        settings: vec![],
        polling: Duration::from_millis(20),
        max_speed: lens::speed(),
        set_speed: true,
        without_abort: false,
    };
    lens::fuzz(Protocol::Indi, data, |port, clock| Indi::open(port, config, clock));
});
