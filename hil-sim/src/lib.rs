//! The simulated rig: a camera and a motorised lens before a scene, behind the same traits as real hardware.
//!
//! The physics is that of the project's notes on sensor and optics: logarithmic pixels with finite bandwidth, thresholds
//! that differ, noise, leak and a limited read-out; thin-lens blur; a motor with backlash, ripple and stick-slip; shake,
//! moving scenes, flicker; and faults on schedule. Everything follows from one seed.
//!
//! [`wire`] puts lens controllers in front of the lens as they are on the wire: bytes in, bytes out. The cameras are there on the
//! wire too ([`UsbPort`]): emulated USB devices that the real drivers can be put on.
//!
//! Not its job: knowing anything of the focus loop. What the simulator knows and a real rig does not tell
//! ([`Rig::truth`]) never passes through the traits.

mod camera;
mod changes;
mod config;
mod fan;
mod faults;
mod fourier;
mod lens;
mod motion;
mod names;
mod optics;
mod picture;
mod random;
mod rig;
mod scene;
mod sensor;
mod usb;
pub mod wire;

pub use camera::SimCamera;
pub use changes::{Change, ChangeKind};
pub use config::{ConfigError, Flicker, LinkConfig, RigConfig};
pub use fan::FanConfig;
pub use faults::{Fault, FaultKind, FaultTrigger};
pub use lens::{LensConfig, LensKind, SimLens};
pub use motion::MotionConfig;
pub use names::NameError;
pub use optics::{OpticsConfig, PointSpread};
pub use rig::Rig;
pub use scene::Scene;
pub use sensor::{CameraModel, Light, Logarithm, PatchNoise, RateCap, SensorConfig};
pub use usb::{EmulatedUsb, Tally, UsbFaults, UsbModel, UsbPort, usbip};
