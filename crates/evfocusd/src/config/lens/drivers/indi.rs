//! `[lens.indi]`: a focuser of an INDI server.

use evfocus_lens::indi::{IndiConfig, Setting};
use serde::Deserialize;

use super::speed;
use crate::config::BadValue;

/// `[lens.indi]`
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct IndiSection {
    /// The device's name, as the server calls it.
    pub device: String,
    /// How often the server asks the focuser, milliseconds; 10 to 1000, default 20.
    pub polling_ms: f64,
    /// The focuser's speed, counts per second; default 1000.
    pub max_speed_counts_per_s: f64,
    /// Whether FOCUS_SPEED is set in proportion to the speed asked; default yes.
    pub set_speed: bool,
    /// Whether a focuser that cannot be stopped will do; default no.
    pub without_abort: bool,
    /// What is set before the device is connected.
    pub settings: Vec<SettingSection>,
}

impl Default for IndiSection {
    fn default() -> Self {
        Self {
            device: String::new(),
            polling_ms: 20.0,
            max_speed_counts_per_s: 1000.0,
            set_speed: true,
            without_abort: false,
            settings: Vec::new(),
        }
    }
}

/// `[[lens.indi.settings]]`
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SettingSection {
    /// The property.
    pub property: String,
    /// Its member.
    pub member: String,
    /// The value; `On` or `Off` for switches.
    pub value: String,
}

impl IndiSection {
    pub(in crate::config::lens) fn config(&self) -> Result<IndiConfig, BadValue> {
        if self.device.is_empty() {
            let remedy = "give the device's name as the server spells it; indi_getprop lists them";
            return Err(BadValue::new("lens.indi.device", "missing", remedy));
        }
        let settings = self.settings.iter().map(|SettingSection { property, member, value }| Setting {
            property: property.clone(),
            member: member.clone(),
            value: value.clone(),
        });
        Ok(IndiConfig {
            device: self.device.clone(),
            settings: settings.collect(),
            polling: BadValue::duration("lens.indi.polling_ms", self.polling_ms, 1e-3, 10.0, 1000.0)?,
            max_speed: speed("lens.indi.max_speed_counts_per_s", self.max_speed_counts_per_s)?,
            set_speed: self.set_speed,
            without_abort: self.without_abort,
        })
    }
}
