//! The driver behind a line that spoils what comes over it.
#![no_main]

use evfocus_fuzz::lens;
use evfocus_lens::optotune::{Optotune, OptotuneConfig, Quantity, ResponseConfig};
use hil_sim::wire::Protocol;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let quantity = if data.len() % 2 == 0 { Quantity::Current } else { Quantity::FocalPower };
    let config = OptotuneConfig { quantity, max_speed: lens::speed(), response: ResponseConfig::default() };
    lens::fuzz(Protocol::Optotune, data, |port, clock| Optotune::open(port, config, clock));
});
