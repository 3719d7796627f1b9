//! The motorised lens, as the focus loop needs it.

use std::time::Duration;

use evfocus_core::{LensPosition, LensRange, LensSample, LensSpeed};

use crate::{Bell, DeviceError};

/// Who moves a lens, and how its position is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum LensClass {
    /// It goes to where it is told by itself, and says where it is: a stepper that counts, a focuser with an encoder.
    Positioner,
    /// Its motor is told how fast to turn, and its position is measured: the host closes the loop, a step with each sample.
    RateDrive,
    /// It obeys set-points and says nothing of where it is: positions come from a model of how it follows, and a sweep is a
    /// staircase, a step with each sample.
    Setpoint,
}

/// A lens that moves with each sample is asked for one at least this often.
const STEERING: Duration = Duration::from_millis(10);

impl LensClass {
    /// The longest time between two samples while the lens moves; nothing if it moves by itself.
    pub fn longest_poll(self) -> Option<Duration> {
        match self {
            Self::Positioner => None,
            Self::RateDrive | Self::Setpoint => Some(STEERING),
        }
    }

    /// The name in documents and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Positioner => "positioner",
            Self::RateDrive => "rate drive",
            Self::Setpoint => "set-point",
        }
    }
}

/// What a lens says of itself.
#[derive(Debug, Clone, PartialEq)]
pub struct LensInfo {
    /// Model name.
    pub model: String,
    /// Serial number or port: what tells this lens from another of its model.
    pub serial: String,
    /// The positions that the lens accepts.
    pub range: LensRange,
    /// Who moves it, and how its position is known.
    pub class: LensClass,
    /// The fastest sweep the lens can make.
    pub max_speed: LensSpeed,
    /// Whether speeds are set as shares of `max_speed`, so that all are wrong where it is.
    pub speed_is_share: bool,
    /// Whether the lens must be (and can be) homed before positions mean anything.
    pub needs_homing: bool,
}

/// A motorised lens. No call waits for a motion to end: motions are started, and watched through [`Lens::sample`].
pub trait Lens: Send {
    /// What the lens is.
    fn info(&self) -> LensInfo;

    /// Ends the waits of later calls while `bell` rings, so that an order need not wait for the answer to an earlier question: a call that
    /// waits then ends with [`DeviceErrorKind::Interrupted`](crate::DeviceErrorKind::Interrupted). What it had sent stays sent; an
    /// order that ends so is not done and must be given again, or another one. Lenses that do not wait need not listen.
    fn listen(&mut self, _bell: &Bell) {}

    /// Starts to find the reference position. A lens that needs none does nothing.
    fn home(&mut self) -> Result<(), DeviceError>;

    /// Starts to move to `target` at `speed`, or as fast as the lens goes where that is slower. A motion under way is
    /// replaced.
    ///
    /// # Errors
    /// [`DeviceErrorKind::OutOfRange`](crate::DeviceErrorKind::OutOfRange) for a target outside [`LensInfo::range`]; the
    /// lens does not move then.
    fn move_to(&mut self, target: LensPosition, speed: LensSpeed) -> Result<(), DeviceError>;

    /// Stops the lens where it is. Stopping a lens at rest does nothing.
    fn stop(&mut self) -> Result<(), DeviceError>;

    /// Asks the lens where it is. The sample's two times enclose the instant to which the position belongs.
    fn sample(&mut self) -> Result<LensSample, DeviceError>;
}
