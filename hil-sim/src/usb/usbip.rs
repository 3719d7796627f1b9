//! The device's side of USB/IP: the emulated cameras behind a real kernel's USB stack, whose vhci-hcd is the host.
//!
//! [`Session`] is one connection as a state machine, bytes in and bytes out, on any clock. [`Server`] carries the bytes over TCP
//! in real time, where `usbip attach` finds the camera. Transfers wait until the device has something (a real device would not
//! acknowledge), can be unlinked while they do, stall, overflow, end with short packets; pulling the camera's cable ends the
//! connection, which the kernel takes as just that.
//!
//! Written from the kernel's `Documentation/usb/usbip_protocol.rst`, version 1.1.1 of the protocol.

mod control;
mod import;
mod message;
mod server;
mod session;

pub use server::Server;
pub use session::Session;

/// Why a connection ends.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum UsbIpError {
    /// The camera's cable is out.
    #[error("the camera is unplugged")]
    Unplugged,
    /// The host sent something that is not a command.
    #[error("there is no USB/IP command {0:#x}")]
    UnknownCommand(u32),
    /// An endpoint number is above 15.
    #[error("there is no endpoint {0}; they are 0 to 15")]
    NoSuchEndpoint(u32),
    /// A transfer is longer than any that a kernel makes.
    #[error("a transfer of {0} bytes is too long; at most {most} bytes", most = message::LONGEST)]
    TooLong(u32),
    /// Isochronous transfers, which none of the cameras has.
    #[error("a transfer in {0} isochronous packets; the device has no isochronous endpoint")]
    Isochronous(u32),
    /// The host has more transfers under way than can be kept.
    #[error("more than {0} transfers wait")]
    TooManyTransfers(usize),
    /// The host speaks another version of the protocol.
    #[error("USB/IP version {0:#06x}; this is 0x0111")]
    Version(u16),
}
