//! What goes wrong between a lens controller and the host.

use std::time::Duration;

/// A fault of the line or of the controller. All but the last two last until [`WirePort::repair`](super::WirePort::repair).
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum WireFault {
    /// Nothing comes from the controller; it hears.
    Silence,
    /// Something else comes: as many bytes, but others, as with a wrong baud rate.
    Garbage,
    /// Each answer ends in its middle.
    HalfReplies,
    /// One bit of each answer is wrong.
    WrongBit,
    /// Answers come this much later.
    SlowReplies(Duration),
    /// The cable is pulled; connections stay dead, the controller and its motor go on.
    Unplugged,
    /// The controller starts anew, once: what it knew and did is gone.
    Reset,
    /// The controller miscounts by this many counts, once.
    PositionJump(f64),
}

impl WireFault {
    /// What becomes of an answer.
    pub(super) fn spoil(self, reply: &mut Vec<u8>) {
        match self {
            Self::Silence => reply.clear(),
            Self::Garbage => {
                // Neither a digit nor an end of any protocol, and not always the same.
                for (index, byte) in reply.iter_mut().enumerate() {
                    *byte = 0x80 | byte.wrapping_mul(37).wrapping_add(index as u8) | 0x04;
                }
            }
            Self::HalfReplies => reply.truncate(reply.len() / 2),
            Self::WrongBit => {
                if let Some(byte) = reply.first_mut() {
                    *byte ^= 0x10;
                }
            }
            Self::SlowReplies(_) | Self::Unplugged | Self::Reset | Self::PositionJump(_) => {}
        }
    }
}
