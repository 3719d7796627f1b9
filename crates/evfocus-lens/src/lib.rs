//! Drivers for motorised lenses. Each protocol has a folder: `protocol` is pure (bytes in, bytes out), the driver beside it
//! speaks it over a [`Port`] and implements [`evfocus_hal::Lens`].
//!
//! Every driver bounds its waits and retries, stops the lens when it is dropped, and opens its port again at the next call
//! after the connection was lost.
//!
//! Not their job: knowing each other, the daemon, or anything of focus.

mod continuity;
pub mod drive;
pub mod firmata;
pub mod grbl;
pub mod indi;
pub mod labjack;
mod line;
pub mod moonlite;
pub mod optotune;
mod port;
mod probe;
mod rate_drive;

pub use firmata::Firmata;
pub use grbl::Grbl;
pub use indi::Indi;
pub use labjack::LabJack;
pub use moonlite::MoonLite;
pub use optotune::Optotune;
pub use port::{Port, UsbPort, usb_ports};
pub use probe::{Answered, ask_all, probe};
