//! Where a lens is attached.

mod list;
pub(crate) mod serial;
mod tcp;
mod watch;

use std::fmt;
use std::sync::Arc;

use evfocus_hal::{Clock, Connect, Transport};

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

    /// The same, with each connection wrapped by `wrap`, which may watch or spoil what goes over it.
    #[must_use]
    pub fn through(
        mut self,
        wrap: impl Fn(Box<dyn Transport>) -> Box<dyn Transport> + Send + 'static,
    ) -> Self {
        Self { place: self.place, connect: Box::new(move || (self.connect)().map(&wrap)) }
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
