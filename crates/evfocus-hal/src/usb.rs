//! A USB device as the camera drivers need it: requests, answers, and one stream of bulk transfers.
//!
//! The trait stands here and not beside the drivers so that the emulated devices of the simulated rig can be plugged into the
//! drivers without either knowing the other: an emulator that took its register numbers from the driver could not find a
//! wrong one.

use std::fmt;
use std::time::Duration;

use evfocus_core::HostMicros;

/// How fast the link is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum UsbSpeed {
    /// 12 Mbit/s or less.
    Full,
    /// USB 2: 480 Mbit/s.
    High,
    /// USB 3: 5 Gbit/s or more.
    Super,
}

impl fmt::Display for UsbSpeed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Full => "USB 1 (12 Mbit/s)",
            Self::High => "USB 2 (480 Mbit/s)",
            Self::Super => "USB 3 (5 Gbit/s or more)",
        })
    }
}

/// What a device says of itself before anything is asked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UsbIdentity {
    /// Vendor.
    pub vendor: u16,
    /// Product.
    pub product: u16,
    /// `bcdDevice`.
    pub version: u16,
    /// The serial number string; empty if there is none.
    pub serial: String,
    /// The link's speed; `None` if the system does not tell.
    pub speed: Option<UsbSpeed>,
}

/// A vendor request to the device on endpoint 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct VendorRequest {
    /// `bRequest`.
    pub request: u8,
    /// `wValue`.
    pub value: u16,
    /// `wIndex`.
    pub index: u16,
}

/// The transfers that are kept waiting for a stream's data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StreamQueue {
    /// How many, at least 1.
    pub transfers: usize,
    /// Bytes in each; a multiple of 1024, the largest bulk packet.
    pub bytes: usize,
}

/// Why a transfer failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum UsbError {
    /// The device is gone.
    #[error("the device is gone")]
    Disconnected,
    /// The endpoint refuses until its halt is cleared; on endpoint 0, the request is refused.
    #[error("the device refuses the transfer (stall)")]
    Stalled,
    /// No answer in time.
    #[error("no answer in time")]
    TimedOut,
    /// Garbled, too long, or otherwise not according to USB; while a cable is being pulled this may come before
    /// [`Disconnected`](Self::Disconnected).
    #[error("the transfer broke the rules of USB")]
    Fault,
    /// The system has no more memory for transfers.
    #[error("the system has no memory for the transfers")]
    OutOfMemory,
    /// Anything else, with the system's number for it.
    #[error("system error {0}")]
    System(u32),
}

/// A device whose interface has been claimed. Dropping it gives the interface back.
pub trait UsbTransport: Send {
    /// What the device says of itself.
    fn identity(&self) -> &UsbIdentity;

    /// Asks for `answer.len()` bytes; returns how many came.
    fn control_in(&mut self, request: VendorRequest, answer: &mut [u8]) -> Result<usize, UsbError>;

    /// Sends `data` with a request.
    fn control_out(&mut self, request: VendorRequest, data: &[u8]) -> Result<(), UsbError>;

    /// Sends one bulk transfer.
    fn bulk_out(&mut self, endpoint: u8, data: &[u8]) -> Result<(), UsbError>;

    /// Waits at most `timeout` for one bulk transfer; returns how many bytes came. An endpoint that streams refuses this.
    fn bulk_in(&mut self, endpoint: u8, data: &mut [u8], timeout: Duration) -> Result<usize, UsbError>;

    /// Clears the halt of an endpoint that does not stream.
    fn clear_halt(&mut self, endpoint: u8) -> Result<(), UsbError>;

    /// Hands `queue` to the system, to be filled from `endpoint`. One stream at a time.
    fn start_stream(&mut self, endpoint: u8, queue: StreamQueue) -> Result<(), UsbError>;

    /// Gives the transfer received before back to the queue, and waits at most `timeout` for the next: when it arrived, or
    /// `None`. After an error the stream must be stopped.
    fn receive(&mut self, timeout: Duration) -> Result<Option<HostMicros>, UsbError>;

    /// The bytes of the transfer received last; empty without one.
    fn received(&self) -> &[u8];

    /// Cancels what is queued and waits until the system has given all of it back. Without a stream it does nothing.
    fn stop_stream(&mut self) -> Result<(), UsbError>;
}
