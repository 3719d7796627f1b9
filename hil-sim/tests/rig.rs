//! Tests of the simulated rig from outside, all in virtual time.

#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::wildcard_enum_match_arm,
    reason = "a failed unwrap is a failed test, and the figures belong in its output"
)]

mod configuration;
mod conformance;
mod faults;
mod foreign;
mod lens;
mod patches;
mod physics;
mod rate_cap;
mod repeat;
mod scenes;
mod sensor;
mod sweep;
mod usbip;
