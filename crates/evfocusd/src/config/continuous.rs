//! `[continuous]`: when mode continuous starts a run by itself.

use evfocus_core::controller::WatchConfig;
use serde::Deserialize;

use super::value::BadValue;

/// `[continuous]`. The reference is the sharpness just after a run has found focus.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ContinuousSection {
    /// Focus is lost below this share of the reference; 0.1 to 0.95.
    pub refocus_below: f64,
    /// For how long it must be lost, seconds; 0.1 to 600.
    pub patience_s: f64,
    /// Over how long the reference is learnt at least, seconds; 0.1 to 600.
    pub learning_s: f64,
    /// Between two runs, seconds; 0.1 to 3600. Doubles with each run that fails or finds what was there before.
    pub rest_s: f64,
    /// What the rest grows to, seconds; from `rest_s` to 86,400.
    pub longest_rest_s: f64,
}

impl Default for ContinuousSection {
    fn default() -> Self {
        let WatchConfig { refocus_below, patience, learning, rest, longest_rest } = WatchConfig::default();
        Self {
            refocus_below,
            patience_s: patience.as_secs_f64(),
            learning_s: learning.as_secs_f64(),
            rest_s: rest.as_secs_f64(),
            longest_rest_s: longest_rest.as_secs_f64(),
        }
    }
}

impl ContinuousSection {
    pub(super) fn check(&self) -> Result<WatchConfig, BadValue> {
        let seconds = |key, value, min, max| BadValue::duration(key, value, 1.0, min, max);
        Ok(WatchConfig {
            refocus_below: BadValue::check("continuous.refocus_below", self.refocus_below, 0.1, 0.95)?,
            patience: seconds("continuous.patience_s", self.patience_s, 0.1, 600.0)?,
            learning: seconds("continuous.learning_s", self.learning_s, 0.1, 600.0)?,
            rest: seconds("continuous.rest_s", self.rest_s, 0.1, 3600.0)?,
            longest_rest: seconds("continuous.longest_rest_s", self.longest_rest_s, self.rest_s, 86_400.0)?,
        })
    }
}
