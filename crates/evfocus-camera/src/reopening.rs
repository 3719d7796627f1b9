//! A camera that is opened again when it comes back.

use std::time::Duration;

use evfocus_core::EventBatch;
use evfocus_hal::{Camera, CameraInfo, DeviceError, DeviceErrorKind};

/// Opens the camera.
type Open = Box<dyn FnMut() -> Result<Box<dyn Camera>, DeviceError> + Send>;

/// A camera that [`start`](Camera::start) opens again after it has been unplugged.
pub struct ReopeningCamera {
    open: Open,
    /// `None` once it has gone.
    camera: Option<Box<dyn Camera>>,
    info: CameraInfo,
}

impl std::fmt::Debug for ReopeningCamera {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ReopeningCamera").field("info", &self.info).finish_non_exhaustive()
    }
}

impl ReopeningCamera {
    /// Opens the camera with `open`, now and whenever it has to be; `open` must open the same camera each time.
    ///
    /// # Errors
    /// Those of `open`.
    pub fn new(
        mut open: impl FnMut() -> Result<Box<dyn Camera>, DeviceError> + Send + 'static,
    ) -> Result<Self, DeviceError> {
        let camera = open()?;
        Ok(Self { info: camera.info(), camera: Some(camera), open: Box::new(open) })
    }

    /// Does `what` with the camera, and lets go of it if it turns out to be gone.
    fn with(
        &mut self,
        what: impl FnOnce(&mut dyn Camera) -> Result<(), DeviceError>,
    ) -> Result<(), DeviceError> {
        let Some(camera) = &mut self.camera else {
            let device = format!("{} {}", self.info.model, self.info.serial);
            return Err(DeviceError::new(DeviceErrorKind::Disconnected, device, "plug it in again"));
        };
        let done = what(camera.as_mut());
        if done.as_ref().is_err_and(|error| error.kind == DeviceErrorKind::Disconnected) {
            self.camera = None;
        }
        done
    }
}

impl Camera for ReopeningCamera {
    fn info(&self) -> CameraInfo {
        self.info.clone()
    }

    fn start(&mut self) -> Result<(), DeviceError> {
        if self.camera.is_none() {
            self.camera = Some((self.open)()?);
        }
        self.with(|camera| camera.start())
    }

    fn stop(&mut self) -> Result<(), DeviceError> {
        self.with(|camera| camera.stop())
    }

    fn read(&mut self, batch: &mut EventBatch, timeout: Duration) -> Result<(), DeviceError> {
        batch.clear();
        self.with(|camera| camera.read(batch, timeout))
    }
}
