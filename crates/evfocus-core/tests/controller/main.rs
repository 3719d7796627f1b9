//! The controller as a state machine in virtual time.
#![expect(clippy::unwrap_used, clippy::panic, reason = "a test whose own fixture is missing fails")]

#[path = "../support/random.rs"]
mod random;
mod rig;

mod abort;
mod continuous;
mod failures;
mod focus;
mod garbage;
mod refusals;
