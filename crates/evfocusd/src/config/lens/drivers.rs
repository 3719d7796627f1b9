//! The sections of single drivers: what their protocols do not tell.

mod drive;
mod indi;

use evfocus_core::{LensRange, LensSpeed};
use evfocus_lens::firmata::FirmataConfig;
use evfocus_lens::grbl::GrblConfig;
use evfocus_lens::grbl::protocol::Axis;
use evfocus_lens::labjack::LabJackConfig;
use evfocus_lens::moonlite::MoonLiteConfig;
use evfocus_lens::moonlite::protocol::StepMode;
use evfocus_lens::optotune::{OptotuneConfig, Quantity, ResponseConfig};
use serde::Deserialize;

use crate::config::BadValue;
use crate::config::value::set_choice;
pub use drive::DriveSection;
pub use indi::{IndiSection, SettingSection};

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

/// `[lens.grbl]`
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GrblSection {
    /// `X` (default), `Y` or `Z`.
    pub axis: String,
    /// Whether the machine has switches and must be homed before it moves; default no.
    pub homing: bool,
}

impl Default for GrblSection {
    fn default() -> Self {
        Self { axis: "X".to_owned(), homing: false }
    }
}

impl GrblSection {
    pub(super) fn config(&self, range: LensRange) -> Result<GrblConfig, BadValue> {
        let mut axis = Axis::X;
        let choices = [("X", Axis::X), ("Y", Axis::Y), ("Z", Axis::Z)];
        set_choice(&mut axis, "lens.grbl.axis", Some(&self.axis), &choices)?;
        Ok(GrblConfig { axis, range, needs_homing: self.homing })
    }
}

/// `[lens.firmata]`
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FirmataSection {
    /// The pin that enables the H-bridge; it must do PWM. Default 3.
    pub pwm_pin: u8,
    /// The pin that tells the H-bridge which way; default 4.
    pub direction_pin: u8,
    /// The analog input of the potentiometer, 0 (A0, default) to 15.
    pub channel: u8,
}

impl Default for FirmataSection {
    fn default() -> Self {
        Self { pwm_pin: 3, direction_pin: 4, channel: 0 }
    }
}

impl FirmataSection {
    pub(super) fn config(&self, range: LensRange, drive: &DriveSection) -> Result<FirmataConfig, BadValue> {
        let Self { pwm_pin, direction_pin, channel } = *self;
        for (key, pin) in [("lens.firmata.pwm_pin", pwm_pin), ("lens.firmata.direction_pin", direction_pin)] {
            BadValue::check(key, f64::from(pin), 0.0, 127.0)?;
        }
        BadValue::check("lens.firmata.channel", f64::from(channel), 0.0, 15.0)?;
        if pwm_pin == direction_pin {
            let remedy = "it must be another pin than lens.firmata.pwm_pin";
            return Err(BadValue::new("lens.firmata.direction_pin", direction_pin, remedy));
        }
        Ok(FirmataConfig { pwm_pin, direction_pin, channel, drive: drive.config(range)? })
    }
}

/// `[lens.labjack]`
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LabJackSection {
    /// The analog input of the potentiometer, 0 (AIN0, default) to 13.
    pub channel: u8,
    /// The voltage over the potentiometer, volts; 0.1 to 10, default 5.
    pub reference_volts: f64,
    /// The voltage on DAC0 at full drive, volts; 0.1 to 5, default 5.
    pub full_drive_volts: f64,
    /// The voltage on DAC1 for the positive direction, volts; 0.1 to 5, default 5.
    pub direction_volts: f64,
}

impl Default for LabJackSection {
    fn default() -> Self {
        Self { channel: 0, reference_volts: 5.0, full_drive_volts: 5.0, direction_volts: 5.0 }
    }
}

impl LabJackSection {
    pub(super) fn config(&self, range: LensRange, drive: &DriveSection) -> Result<LabJackConfig, BadValue> {
        BadValue::check("lens.labjack.channel", f64::from(self.channel), 0.0, 13.0)?;
        Ok(LabJackConfig {
            channel: self.channel,
            reference_volts: BadValue::check(
                "lens.labjack.reference_volts",
                self.reference_volts,
                0.1,
                10.0,
            )?,
            full_drive_volts: BadValue::check(
                "lens.labjack.full_drive_volts",
                self.full_drive_volts,
                0.1,
                5.0,
            )?,
            direction_volts: BadValue::check("lens.labjack.direction_volts", self.direction_volts, 0.1, 5.0)?,
            drive: drive.config(range)?,
        })
    }
}
