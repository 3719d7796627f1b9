//! One error type for all hardware: what kind, which device, what happened.

use std::fmt;

/// What went wrong, as far as the focus loop must tell it apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum DeviceErrorKind {
    /// The device is gone; open it again.
    Disconnected,
    /// The operating system refuses; the message says what to change.
    PermissionDenied,
    /// Another program holds the device.
    Busy,
    /// The device did not answer in time.
    TimedOut,
    /// The [`Bell`](crate::Bell) rang while the call waited for the device: nothing is wrong, call again when there is time.
    Interrupted,
    /// The device said something that its protocol does not allow.
    Protocol,
    /// A request outside of the device's range.
    OutOfRange,
    /// The stream is read before it was started.
    NotStarted,
    /// The device reports a fault of its own: a stalled motor, an end stop.
    Fault,
}

impl fmt::Display for DeviceErrorKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Disconnected => "disconnected",
            Self::PermissionDenied => "permission denied",
            Self::Busy => "in use by another program",
            Self::TimedOut => "no answer in time",
            Self::Interrupted => "interrupted",
            Self::Protocol => "protocol violation",
            Self::OutOfRange => "out of range",
            Self::NotStarted => "not started",
            Self::Fault => "device fault",
        })
    }
}

/// A failed device operation.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{device}: {kind}: {what}")]
pub struct DeviceError {
    /// What kind of failure.
    pub kind: DeviceErrorKind,
    /// Which device, by model and serial.
    pub device: String,
    /// What was tried, with the values, and what to do about it.
    pub what: String,
}

impl DeviceError {
    /// Whether nothing is wrong, but somebody rang.
    pub fn is_interruption(&self) -> bool {
        self.kind == DeviceErrorKind::Interrupted
    }

    /// An error of `kind` on `device`.
    pub fn new(kind: DeviceErrorKind, device: impl Into<String>, what: impl Into<String>) -> Self {
        Self { kind, device: device.into(), what: what.into() }
    }
}
