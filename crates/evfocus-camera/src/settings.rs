//! What both cameras' settings are checked for.

use std::time::Duration;

use evfocus_core::{Geometry, Window};

/// A setting that the camera does not have.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{key}: {what}")]
pub struct SettingsError {
    /// The setting.
    pub key: String,
    /// What it is, and what it must be.
    pub what: String,
}

impl SettingsError {
    pub(crate) fn new(key: impl Into<String>, what: impl Into<String>) -> Self {
        Self { key: key.into(), what: what.into() }
    }

    pub(crate) fn check_roi(roi: Option<Window>, geometry: Geometry) -> Result<(), Self> {
        let Some(roi) = roi.filter(|roi| !roi.fits(geometry)) else { return Ok(()) };
        let Window { x, y, width, height } = roi;
        let sensor = format!("{}x{}", geometry.width, geometry.height);
        Err(Self::new(
            "roi",
            format!("{width}x{height} pixels from column {x}, row {y} do not fit the sensor's {sensor}"),
        ))
    }

    pub(crate) fn check_pixels(pixels: &[(u16, u16)], most: usize, geometry: Geometry) -> Result<(), Self> {
        let key = "masked_pixels";
        if pixels.len() > most {
            return Err(Self::new(key, format!("{} pixels; the camera can mask {most}", pixels.len())));
        }
        match pixels.iter().find(|(x, y)| !geometry.contains(*x, *y)) {
            Some((x, y)) => {
                let sensor = format!("{}x{}", geometry.width, geometry.height);
                Err(Self::new(key, format!("column {x}, row {y} is not on the sensor of {sensor}")))
            }
            None => Ok(()),
        }
    }

    pub(crate) fn check_duration(
        key: &str,
        value: Duration,
        (min, max): (Duration, Duration),
    ) -> Result<(), Self> {
        if value >= min && value <= max {
            return Ok(());
        }
        Err(Self::new(key, format!("{value:?}; it must be from {min:?} to {max:?}")))
    }
}
