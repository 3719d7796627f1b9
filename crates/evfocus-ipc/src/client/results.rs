//! What each method's reply holds, as the client reads it.

use serde::Deserialize;

use crate::{Calibration, Device, Progress, Report, Status};

/// Of `GetStatus` and `Monitor`.
#[derive(Debug, Deserialize)]
pub struct OfStatus {
    pub status: Status,
}

/// Of `Focus`.
#[derive(Debug, Deserialize)]
pub struct OfFocus {
    pub progress: Progress,
}

/// Of `Abort`.
#[derive(Debug, Deserialize)]
pub(super) struct OfAbort {
    pub(super) run_id: Option<u64>,
}

/// Of `GetReport`.
#[derive(Debug, Deserialize)]
pub(super) struct OfReport {
    pub(super) report: Report,
}

/// Of `Calibrate`.
#[derive(Debug, Deserialize)]
pub(super) struct OfCalibrate {
    pub(super) calibration: Calibration,
}

/// Of `ListDevices`.
#[derive(Debug, Deserialize)]
pub(super) struct OfDevices {
    pub(super) devices: Vec<Device>,
}

/// Of the methods without results.
#[derive(Debug, Deserialize)]
pub(super) struct Nothing {}

/// Of `Reload`: which settings have changed, by section or key.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub struct Reloaded {
    /// They hold from now on, or from the end of the run under way.
    pub applied: Vec<String>,
    /// They hold after a restart of the daemon.
    pub needs_restart: Vec<String>,
}
