//! Every driver against the model of its device: in virtual time, and on a pseudo-terminal or a socket.

#![expect(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod bench;
mod firmata;
mod grbl;
mod indi;
mod labjack;
mod moonlite;
mod optotune;
mod orders;
mod probe;
