//! Pure decoders of the words that cameras send: bytes in, events out. They serve live cameras and recordings alike.
//!
//! Decoders keep their state between calls, so the bytes may be cut anywhere; they never panic, never wait, and hold no memory
//! of their own beyond a partial word. For [`Evt3Decoder`] and [`DavisWordDecoder`] there is a counter that counts the same
//! events without looking at their coordinates: [`Evt3Counter`], [`DavisWordCounter`].

#![expect(
    clippy::inline_always,
    reason = "what is to use the vector instructions of a function must be inlined into it"
)]
#![expect(
    clippy::needless_bitwise_bool,
    reason = "without a branch, so that the compiler can take many words at a time"
)]

mod bins;
pub mod davis;
mod evt2;
pub mod evt3;
mod framing;
mod runs;
mod vectorized;

pub use davis::{DavisWordCounter, DavisWordDecoder};
pub use evt2::Evt2Decoder;
pub use evt3::{Evt3Counter, Evt3Decoder};

/// What becomes of time that goes back, which no sound stream does between two starts of the camera's clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TimeRule {
    /// It goes back. For recordings, whose readers want what the camera sent.
    AsSent,
    /// Time never goes back. A step back within the coarse unit of the format is held; where the camera's clock has started
    /// anew, time goes on [`RESTART_LEAP_US`] after the newest. For live cameras.
    Ascending,
}

/// By how much time leaps when the camera's clock starts anew in mid-stream, microseconds. Nobody knows how long the camera
/// was away, so the leap is too long to be believed: [`ClockMap`](crate::ClockMap) takes it for the new time base that it is.
pub const RESTART_LEAP_US: i64 = 1 << 24;
