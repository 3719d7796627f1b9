//! Cameras and lenses that the daemon knows of.

use serde::{Deserialize, Serialize};

/// What a device is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DeviceRole {
    /// An event camera.
    Camera,
    /// A motorised lens.
    Lens,
}

/// Whether a device can be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DeviceState {
    /// This daemon uses it.
    Active,
    /// It is there and free.
    Available,
    /// It is there, but the operating system does not let the daemon open it.
    PermissionDenied,
    /// Another program holds it.
    Busy,
    /// It is configured, but it is not there or does not answer.
    Missing,
}

/// A camera or a lens.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Device {
    /// What it is for.
    pub role: DeviceRole,
    /// The driver, as the configuration names it.
    pub driver: String,
    /// Model name.
    pub model: String,
    /// Serial number; empty if the device has none.
    pub serial: String,
    /// Where it is attached: a USB path, a serial port, `simulated`.
    pub location: String,
    /// Whether it can be used.
    pub state: DeviceState,
    /// What to do about a state other than active and available.
    pub message: Option<String>,
}
