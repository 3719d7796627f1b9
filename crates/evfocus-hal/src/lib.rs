//! The hardware traits of evfocus, written for the needs of the focus loop: a camera that is read, a lens that is moved and
//! sampled, a clock that is asked and waited on; and below them the bytes that go to and from a device, over a line or over USB.
//!
//! Not their job: deciding anything. Implementations know neither each other nor the daemon. Each is put through
//! [`conformance`] by its own tests.

mod bell;
mod camera;
mod clock;
pub mod conformance;
mod error;
mod lens;
mod transport;
pub mod usb;

pub use bell::Bell;
pub use camera::{Camera, CameraInfo};
pub use clock::{Clock, SystemClock, VirtualClock, unix_time};
pub use error::{DeviceError, DeviceErrorKind};
pub use lens::{Lens, LensClass, LensInfo};
pub use transport::{Connect, Transport};
