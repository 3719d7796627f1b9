//! What lenses have in common whose motor is told how fast to turn and whose potentiometer is read: the line to the board, the loop that
//! the host closes, and what makes a reading fit to be believed.

use std::sync::Arc;

use evfocus_core::{LensPosition, LensSample, LensSpeed};
use evfocus_hal::{Clock, DeviceError, DeviceErrorKind, LensClass, LensInfo};

use crate::Port;
use crate::continuity::Continuity;
use crate::drive::{Drive, DriveConfig};
use crate::line::Line;

/// A line to a board, and the loop over it. What the board is told, and how it is read, is the driver's business.
#[derive(Debug)]
pub(crate) struct RateDrive {
    pub(crate) line: Line,
    model: &'static str,
    drive: Drive,
    continuity: Continuity,
}

impl RateDrive {
    pub(crate) fn new(model: &'static str, port: Port, config: DriveConfig, clock: Arc<dyn Clock>) -> Self {
        Self {
            line: Line::new(model, port, clock),
            model,
            drive: Drive::new(config),
            continuity: Continuity::new(config.range, config.max_speed),
        }
    }

    /// Opens the line if it is closed, and forgets what was before; returns whether it did, so that the board must be greeted.
    pub(crate) fn open(&mut self) -> Result<bool, DeviceError> {
        if self.line.is_open() {
            return Ok(false);
        }
        self.line.open()?;
        self.drive = Drive::new(*self.drive.config());
        self.continuity.forget();
        Ok(true)
    }

    /// The first reading tells where the lens is; readings have `steps` steps from zero to the full one.
    pub(crate) fn begin_at(&mut self, sample: &LensSample, steps: f64) {
        let DriveConfig { at_zero, at_full, .. } = *self.drive.config();
        self.drive.set_resolution((at_full - at_zero) / steps);
        self.drive.follow(sample.replied, sample.position).unwrap_or_default();
    }

    pub(crate) fn aim(&mut self, target: LensPosition, speed: LensSpeed) {
        self.drive.aim(target, speed);
    }

    /// The loop stands; the board is still to be told.
    pub(crate) fn cut(&mut self) {
        self.drive.cut(self.line.now());
    }

    /// Takes a step of the loop with a reading: the drive to put out, -1 to 1.
    ///
    /// # Errors
    /// A reading that cannot be, or a motor that does not do as it is told.
    pub(crate) fn step(&mut self, sample: &LensSample) -> Result<f64, DeviceError> {
        let fault = |what: String| self.line.error(DeviceErrorKind::Fault, what);
        self.continuity.check(sample.replied, sample.position).map_err(fault)?;
        let drive = self.drive.follow(sample.replied, sample.position);
        drive.map_err(|found| self.line.error(DeviceErrorKind::Fault, found.explain(sample.position)))
    }

    pub(crate) fn is_moving(&self) -> bool {
        self.drive.is_moving()
    }

    pub(crate) fn check_target(&self, target: LensPosition) -> Result<(), DeviceError> {
        self.line.check_target(target, self.drive.config().range)
    }

    pub(crate) fn info(&self, serial: &str) -> LensInfo {
        let DriveConfig { range, max_speed, .. } = *self.drive.config();
        LensInfo {
            model: self.model.to_owned(),
            class: LensClass::RateDrive,
            serial: serial.to_owned(),
            range,
            max_speed,
            speed_is_share: false,
            needs_homing: false,
        }
    }
}
