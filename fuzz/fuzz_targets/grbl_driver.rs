//! The driver behind a line that spoils what comes over it.
#![no_main]

use evfocus_fuzz::lens;
use evfocus_lens::grbl::{Grbl, GrblConfig, protocol::Axis};
use hil_sim::wire::Protocol;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let config = GrblConfig { axis: Axis::X, range: lens::range(), needs_homing: false };
    lens::fuzz(Protocol::Grbl, data, |port, clock| Grbl::open(port, config, clock));
});
