//! What can go wrong, and what it is called.

use std::fmt;

use super::devices::{CameraFault, LensFault};
use super::disk::{Death, DiskFault};

/// What can go wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Mishap {
    /// Of the camera, in front of the simulated one.
    Camera(CameraFault),
    /// The simulated camera's clock starts anew.
    ClockReset,
    /// The link loses events, and says how many.
    EventLoss,
    /// Of the lens, in front of the simulated one.
    Lens(LensFault),
    /// The lens does not move any more.
    LensStalled,
    /// The lens says late where it was.
    LensLate,
    /// Clients throw in commands.
    Clients,
    /// The process gets no time for a while.
    Starved,
    /// The process is killed and started again.
    Killed,
    /// Of the disk.
    Disk(DiskFault),
    /// The process ends in the middle of a write, and is started again.
    DiesWriting(Death),
}

impl Mishap {
    /// Every mishap.
    pub const ALL: [Self; 24] = [
        Self::Camera(CameraFault::Unplugged),
        Self::Camera(CameraFault::Silent),
        Self::Camera(CameraFault::Hiccup),
        Self::Camera(CameraFault::Flood),
        Self::Camera(CameraFault::Lies),
        Self::Camera(CameraFault::ClockRuns),
        Self::Camera(CameraFault::ClockLeaps),
        Self::ClockReset,
        Self::EventLoss,
        Self::Lens(LensFault::Unplugged),
        Self::Lens(LensFault::Silent),
        Self::Lens(LensFault::Garbage),
        Self::Lens(LensFault::Deaf),
        Self::Lens(LensFault::Frozen),
        Self::LensStalled,
        Self::LensLate,
        Self::Clients,
        Self::Starved,
        Self::Killed,
        Self::Disk(DiskFault::Full),
        Self::Disk(DiskFault::ReadOnly),
        Self::Disk(DiskFault::Broken),
        Self::DiesWriting(Death::Killed),
        Self::DiesWriting(Death::PowerCut),
    ];
}

impl fmt::Display for Mishap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Camera(CameraFault::Unplugged) => "camera: unplugged for a while",
            Self::Camera(CameraFault::Silent) => "camera: sends nothing",
            Self::Camera(CameraFault::Hiccup) => "camera: reports faults",
            Self::Camera(CameraFault::Flood) => "camera: 20,000 events at one instant, again and again",
            Self::Camera(CameraFault::Lies) => "camera: events outside of the sensor",
            Self::Camera(CameraFault::ClockRuns) => "camera: clock runs a tenth too fast",
            Self::Camera(CameraFault::ClockLeaps) => "camera: clock leaps 100 hours ahead, and back",
            Self::ClockReset => "camera: clock starts anew",
            Self::EventLoss => "camera: events lost on the way",
            Self::Lens(LensFault::Unplugged) => "lens: unplugged for a while",
            Self::Lens(LensFault::Silent) => "lens: answers nothing, hears nothing",
            Self::Lens(LensFault::Garbage) => "lens: positions that are none",
            Self::Lens(LensFault::Deaf) => "lens: answers, and does nothing",
            Self::Lens(LensFault::Frozen) => "lens: always says the same position",
            Self::LensStalled => "lens: does not move any more",
            Self::LensLate => "lens: says late where it was",
            Self::Clients => "clients: throw in commands, sense and nonsense",
            Self::Starved => "process: gets no time for a while",
            Self::Killed => "process: killed",
            Self::Disk(DiskFault::Full) => "disk: full",
            Self::Disk(DiskFault::ReadOnly) => "disk: read-only",
            Self::Disk(DiskFault::Broken) => "disk: cannot make anything last",
            Self::DiesWriting(Death::Killed) => "process: killed in the middle of a write",
            Self::DiesWriting(Death::PowerCut) => "power cut in the middle of a write",
        })
    }
}
