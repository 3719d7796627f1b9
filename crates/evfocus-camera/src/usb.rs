//! USB devices of this machine, through nusb: finding cameras, opening them, transfers.
//!
//! Transfers of a stream use memory that the kernel fills directly (`Endpoint::allocate`), and the same memory again: once a
//! stream runs, nothing is copied or allocated.

mod open;
mod transport;

pub use open::{list, open};
pub use transport::NusbTransport;
