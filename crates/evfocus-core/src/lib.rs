//! The pure core of evfocus: it counts events, aligns clocks, measures focus, searches for it, and decides what a focus run
//! does next.
//!
//! Not its job: opening devices, waiting, reading clocks, spawning, logging. Time is an argument everywhere. The crate is
//! `no_std` with `alloc`, so the compiler keeps this true.
#![no_std]

extern crate alloc;
#[cfg(test)]
extern crate std;

mod event;
mod lens_trace;
mod units;

pub use event::{Event, EventBatch, Geometry, Polarity};
pub use lens_trace::{Leg, LensSample, LensTrace, LensTraceError};
pub use units::{CameraMicros, EventRate, HostMicros, LensPosition, LensRange, LensSpeed, Timestamp, UnitError};
