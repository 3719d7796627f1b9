//! The hardware traits of evfocus, written for the needs of the focus loop: a camera that is read, a lens that is moved and
//! sampled, a clock that is asked and waited on; and below them the USB device that camera drivers are written against.
//!
//! Not their job: deciding anything. Implementations know neither each other nor the daemon. Each is put through
//! [`conformance`] by its own tests.

mod camera;
mod clock;
pub mod conformance;
mod error;
mod lens;
pub mod usb;

pub use camera::{Camera, CameraInfo};
pub use clock::{Clock, SystemClock, VirtualClock, unix_time};
pub use error::{DeviceError, DeviceErrorKind};
pub use lens::{Lens, LensInfo};
