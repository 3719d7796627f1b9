//! The motorised lens, as the focus loop needs it.

use evfocus_core::{LensPosition, LensRange, LensSample, LensSpeed};

use crate::DeviceError;

/// What a lens says of itself.
#[derive(Debug, Clone, PartialEq)]
pub struct LensInfo {
    /// Model name.
    pub model: String,
    /// Serial number or port: what tells this lens from another of its model.
    pub serial: String,
    /// The positions that the lens accepts.
    pub range: LensRange,
    /// The fastest sweep the lens can make.
    pub max_speed: LensSpeed,
    /// Whether the lens must be (and can be) homed before positions mean anything.
    pub needs_homing: bool,
}

/// A motorised lens. No call waits for a motion to end: motions are started, and watched through [`Lens::sample`].
pub trait Lens: Send {
    /// What the lens is.
    fn info(&self) -> LensInfo;

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
