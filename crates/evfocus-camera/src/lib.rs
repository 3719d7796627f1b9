//! Drivers for event cameras on USB: [`davis346`] and [`evk4`].
//!
//! Each driver has three layers: registers as named constants; a pure protocol over bytes (the words of the stream are decoded by
//! [`evfocus_core::decode`]); and the driver itself, over anything that is a [`UsbTransport`](evfocus_hal::usb::UsbTransport).
//! [`usb`] is that transport on this machine's ports; the simulated rig has emulated devices behind the same trait.
//!
//! Not its job: deciding when to open, start or give up; that is the daemon's.
//!
//! Facts about the devices come from the makers' published software. No driver here has met a real device yet.

pub mod davis346;
pub mod discovery;
mod error;
pub mod evk4;
mod reopening;
mod settings;
mod stream;
pub mod usb;

pub use discovery::{Access, Driver, FoundCamera, SelectError};
pub use reopening::ReopeningCamera;
pub use settings::SettingsError;
