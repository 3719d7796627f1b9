//! The event camera, as the focus loop needs it.

use std::time::Duration;

use evfocus_core::{EventBatch, Geometry};

use crate::DeviceError;

/// What a camera says of itself.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CameraInfo {
    /// Model name, for example `DAVIS346`.
    pub model: String,
    /// Serial number as the device states it.
    pub serial: String,
    /// Sensor size.
    pub geometry: Geometry,
    /// The event rate above which the read-out or the link is known to lose or delay events, events per second.
    pub rate_ceiling: Option<u64>,
}

/// An event camera.
pub trait Camera: Send {
    /// What the camera is.
    fn info(&self) -> CameraInfo;

    /// Starts the stream. Camera time may begin anew. Starting a started camera does nothing.
    fn start(&mut self) -> Result<(), DeviceError>;

    /// Stops the stream; events not yet read are dropped. Stopping a stopped camera does nothing.
    fn stop(&mut self) -> Result<(), DeviceError>;

    /// Waits for events for at most `timeout` and puts them into `batch`, which is cleared first. Returns as soon as there
    /// is something; an empty batch after `timeout` is not an error. Never grows the batch: what does not fit its capacity
    /// waits for the next call, or is counted in `lost`.
    ///
    /// Event times never decrease, within a batch or across batches, until the next `start`.
    ///
    /// # Errors
    /// [`DeviceErrorKind::NotStarted`](crate::DeviceErrorKind::NotStarted) before `start`;
    /// [`DeviceErrorKind::Disconnected`](crate::DeviceErrorKind::Disconnected) once the camera is gone, until it is opened
    /// again.
    fn read(&mut self, batch: &mut EventBatch, timeout: Duration) -> Result<(), DeviceError>;
}
