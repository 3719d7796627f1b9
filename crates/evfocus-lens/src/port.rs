//! Where a lens is attached.

mod list;
pub(crate) mod serial;
mod tcp;

use std::fmt;
use std::sync::Arc;

use evfocus_hal::{Clock, Connect};

pub use list::{UsbPort, usb_ports};

/// A place at which a lens is attached, and how to connect to it.
pub struct Port {
    pub(crate) place: String,
    pub(crate) connect: Connect,
}

impl fmt::Debug for Port {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Port").field("place", &self.place).finish_non_exhaustive()
    }
}

impl Port {
    /// A port of any kind; errors call it `place`.
    pub fn new(place: impl Into<String>, connect: Connect) -> Self {
        Self { place: place.into(), connect }
    }

    /// A serial port, 8 data bits, no parity, one stop bit, no flow control. `path` may be a link, as those in
    /// `/dev/serial/by-id` are. Nothing is opened yet.
    pub fn serial(path: impl Into<String>, baud: u32, clock: Arc<dyn Clock>) -> Self {
        let place: String = path.into();
        let path = place.clone();
        Self::new(place, Box::new(move || serial::open(&path, baud, Arc::clone(&clock))))
    }

    /// A TCP connection to `address`, `host:port`. Nothing is opened yet.
    pub fn tcp(address: impl Into<String>, clock: Arc<dyn Clock>) -> Self {
        let place: String = address.into();
        let address = place.clone();
        Self::new(place, Box::new(move || tcp::open(&address, Arc::clone(&clock))))
    }
}
