//! Tests of the simulated rig from outside, all in virtual time.

mod conformance;
mod physics;
mod sweep;
