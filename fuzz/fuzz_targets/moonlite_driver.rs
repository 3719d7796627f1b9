//! The driver behind a line that spoils what comes over it.
#![no_main]

use evfocus_fuzz::lens;
use evfocus_lens::moonlite::{MoonLite, MoonLiteConfig, protocol::StepMode};
use hil_sim::wire::Protocol;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let config =
        MoonLiteConfig { range: lens::range(), max_speed: lens::speed(), step_mode: Some(StepMode::Half) };
    lens::fuzz(Protocol::MoonLite, data, |port, clock| MoonLite::open(port, config, clock));
});
