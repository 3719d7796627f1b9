//! What goes wrong on the rig, and when.

use std::time::Duration;

use evfocus_core::LensPosition;

/// A fault of the rig.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum FaultKind {
    /// The camera's cable is pulled: every call to the camera fails as disconnected from then on.
    CameraUnplugged,
    /// The camera's clock starts again at zero; event times go back.
    CameraTimeReset,
    /// The link loses this share of the events (0 to 1) for a while; the camera reports how many.
    EventLoss {
        /// Share of the events lost, 0 to 1.
        share: f64,
        /// For how long.
        duration: Duration,
    },
    /// The lens's cable is pulled: every call to the lens fails as disconnected, and the motor stops.
    LensUnplugged,
    /// The lens stays where it is, whatever it is told. At [`FaultTrigger::After`] zero: a lens that never moves.
    LensStalled,
    /// The lens does not answer any more (the calls time out); a motion under way goes on to its end.
    LensSilent,
    /// The lens reports where it was this long ago.
    LensPositionLate {
        /// Age of the reported positions.
        by: Duration,
    },
}

/// When a fault strikes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FaultTrigger {
    /// This long after the rig was made.
    After(Duration),
    /// When the lens's motor first comes to this position.
    AtPosition(LensPosition),
}

/// A scheduled fault. It lasts for good unless its kind says otherwise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fault {
    /// What.
    pub kind: FaultKind,
    /// When.
    pub trigger: FaultTrigger,
}
