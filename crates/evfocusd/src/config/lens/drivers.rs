//! The sections of single drivers: what their protocols do not tell.

use evfocus_core::{LensRange, LensSpeed};
use evfocus_lens::moonlite::MoonLiteConfig;
use evfocus_lens::moonlite::protocol::StepMode;
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
