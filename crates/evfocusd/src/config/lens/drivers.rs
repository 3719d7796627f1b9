//! The sections of single drivers: what their protocols do not tell.

use evfocus_core::{LensRange, LensSpeed};
use evfocus_lens::moonlite::MoonLiteConfig;
use evfocus_lens::moonlite::protocol::StepMode;
use evfocus_lens::optotune::{OptotuneConfig, Quantity, ResponseConfig};
use serde::Deserialize;

use crate::config::BadValue;
use crate::config::value::set_choice;

/// A speed from a number of counts per second.
fn speed(key: &str, value: f64) -> Result<LensSpeed, BadValue> {
    BadValue::check(key, value, 0.1, 1e6)?;
    LensSpeed::new(value).map_err(|error| BadValue::new(key, value, error.to_string()))
}

/// `[lens.moonlite]`
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MoonLiteSection {
    /// Speed at the fastest setting, steps per second; default 250, the original's.
    pub max_speed_counts_per_s: f64,
    /// `full`, `half`, or `keep` (default) for what the controller was left at.
    pub steps: String,
}

impl Default for MoonLiteSection {
    fn default() -> Self {
        Self { max_speed_counts_per_s: 250.0, steps: "keep".to_owned() }
    }
}

impl MoonLiteSection {
    pub(super) fn config(&self, range: LensRange) -> Result<MoonLiteConfig, BadValue> {
        let mut step_mode = None;
        let choices = [("keep", None), ("full", Some(StepMode::Full)), ("half", Some(StepMode::Half))];
        set_choice(&mut step_mode, "lens.moonlite.steps", Some(&self.steps), &choices)?;
        let max_speed = speed("lens.moonlite.max_speed_counts_per_s", self.max_speed_counts_per_s)?;
        Ok(MoonLiteConfig { range, max_speed, step_mode })
    }
}

/// `[lens.optotune]`
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct OptotuneSection {
    /// `current` (default) or `focal-power`: what a count is a raw unit of.
    pub quantity: String,
    /// The fastest sweep, counts per second; default 2000.
    pub max_speed_counts_per_s: f64,
    /// Natural frequency of the glass, cycles per second; 1 to 10,000, default 150.
    pub natural_hz: f64,
    /// Damping as a share of the critical one; 0.01 to 0.99, default 0.2.
    pub damping: f64,
    /// From the end of a command to the change of current, milliseconds; 0 to 100, default 0.5.
    pub delay_ms: f64,
}

impl Default for OptotuneSection {
    fn default() -> Self {
        let response = ResponseConfig::default();
        Self {
            quantity: "current".to_owned(),
            max_speed_counts_per_s: 2000.0,
            natural_hz: response.natural_hz,
            damping: response.damping,
            delay_ms: response.delay.as_secs_f64() * 1e3,
        }
    }
}

impl OptotuneSection {
    pub(super) fn config(&self) -> Result<OptotuneConfig, BadValue> {
        let mut quantity = Quantity::Current;
        let choices = [("current", Quantity::Current), ("focal-power", Quantity::FocalPower)];
        set_choice(&mut quantity, "lens.optotune.quantity", Some(&self.quantity), &choices)?;
        let response = ResponseConfig {
            natural_hz: BadValue::check("lens.optotune.natural_hz", self.natural_hz, 1.0, 1e4)?,
            damping: BadValue::check("lens.optotune.damping", self.damping, 0.01, 0.99)?,
            delay: BadValue::duration("lens.optotune.delay_ms", self.delay_ms, 1e-3, 0.0, 100.0)?,
        };
        let max_speed = speed("lens.optotune.max_speed_counts_per_s", self.max_speed_counts_per_s)?;
        Ok(OptotuneConfig { quantity, max_speed, response })
    }
}
