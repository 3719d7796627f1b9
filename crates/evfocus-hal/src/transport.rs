//! Bytes to and from a device: a serial port, a TCP connection, or an emulator's end of either.

use evfocus_core::HostMicros;

use crate::{Bell, DeviceError};

/// An open connection that carries bytes both ways. Protocols are written against this; what is behind it does not matter to
/// them.
///
/// Errors name the port or the address as the device, since a transport does not know what it is connected to.
pub trait Transport: Send {
    /// Sends all of `bytes`, and returns when they are on the line.
    ///
    /// # Errors
    /// [`DeviceErrorKind::Disconnected`](crate::DeviceErrorKind::Disconnected) once the connection is gone, until another
    /// one is opened; [`DeviceErrorKind::TimedOut`](crate::DeviceErrorKind::TimedOut) if the line does not take the bytes.
    fn write(&mut self, bytes: &[u8]) -> Result<(), DeviceError>;

    /// Waits until something has come in, but not beyond `deadline`, and puts it into `buffer`; says how many bytes. None by
    /// the deadline is not an error. A deadline in the past takes what is there.
    ///
    /// # Errors
    /// [`DeviceErrorKind::Disconnected`](crate::DeviceErrorKind::Disconnected), as for [`write`](Self::write).
    fn read(&mut self, buffer: &mut [u8], deadline: HostMicros) -> Result<usize, DeviceError>;

    /// From now on [`read`](Self::read) returns at once, if nothing has come in, while `bell` rings.
    fn listen(&mut self, bell: &Bell);

    /// Throws away what has come in and was not read: late answers to earlier questions.
    ///
    /// # Errors
    /// [`DeviceErrorKind::Disconnected`](crate::DeviceErrorKind::Disconnected), as for [`write`](Self::write).
    fn drain(&mut self) -> Result<(), DeviceError>;
}

/// Opens a connection; called again after one was lost.
pub type Connect = Box<dyn FnMut() -> Result<Box<dyn Transport>, DeviceError> + Send>;
