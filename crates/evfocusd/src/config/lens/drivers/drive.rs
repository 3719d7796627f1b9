//! `[lens.drive]`: a DC motor and its potentiometer, behind whatever board.

use evfocus_core::LensRange;
use evfocus_lens::drive::DriveConfig;
use serde::Deserialize;

use super::speed;
use crate::config::BadValue;

/// `[lens.drive]`
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DriveSection {
    /// Speed at full drive, counts per second; default 900.
    pub max_speed_counts_per_s: f64,
    /// How fast the lens is sped up and slowed down, counts per second squared; 1 to 1,000,000, default 4000.
    pub acceleration_counts_per_s2: f64,
    /// Share of the full drive below which the motor does not turn; 0 to 0.9, default 0.12.
    pub dead_band: f64,
    /// How near to its target the lens is left alone, counts; default 2.
    pub tolerance_counts: f64,
    /// Position at a reading of zero, counts; default 0.
    pub counts_at_zero: f64,
    /// Position at a full reading, counts; default 4095.
    pub counts_at_full: f64,
    /// Whether the positive drive lowers the position; default no.
    pub reversed: bool,
}

impl Default for DriveSection {
    fn default() -> Self {
        Self {
            max_speed_counts_per_s: 900.0,
            acceleration_counts_per_s2: 4000.0,
            dead_band: 0.12,
            tolerance_counts: 2.0,
            counts_at_zero: 0.0,
            counts_at_full: 4095.0,
            reversed: false,
        }
    }
}

impl DriveSection {
    pub(in crate::config::lens) fn config(&self, range: LensRange) -> Result<DriveConfig, BadValue> {
        let (zero, full) = (self.counts_at_zero, self.counts_at_full);
        BadValue::check("lens.drive.counts_at_zero", zero, -1e6, 1e6)?;
        BadValue::check("lens.drive.counts_at_full", full, -1e6, 1e6)?;
        for (key, limit) in [("lens.min_counts", range.min().0), ("lens.max_counts", range.max().0)] {
            // Outside of what the potentiometer can say the lens would never arrive.
            BadValue::check(key, limit, zero.min(full), zero.max(full))?;
        }
        Ok(DriveConfig {
            range,
            max_speed: speed("lens.drive.max_speed_counts_per_s", self.max_speed_counts_per_s)?,
            acceleration: BadValue::check(
                "lens.drive.acceleration_counts_per_s2",
                self.acceleration_counts_per_s2,
                1.0,
                1e6,
            )?,
            dead_band: BadValue::check("lens.drive.dead_band", self.dead_band, 0.0, 0.9)?,
            tolerance: BadValue::check(
                "lens.drive.tolerance_counts",
                self.tolerance_counts,
                1e-3,
                0.02 * range.length(),
            )?,
            at_zero: zero,
            at_full: full,
            reversed: self.reversed,
        })
    }
}
