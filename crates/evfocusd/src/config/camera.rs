//! `[camera]`: which camera, and how it is set up.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Duration;

use evfocus_camera::davis346::{self, CoarseFine, PixelFilterAxes, TriggerInput};
use evfocus_camera::evk4::{self, RowOrder};
use evfocus_camera::{Driver, SettingsError};
use evfocus_core::{Geometry, Window};
use evfocus_record::{ReplayEnd, ReplayPace};
use serde::Deserialize;

use super::BadValue;

/// `[camera]`
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CameraSection {
    /// `simulated`, `davis346`, `evk4` or `replay`.
    pub backend: String,
    /// The recording that is replayed.
    pub file: Option<PathBuf>,
    /// How fast: `real-time` or `fastest`.
    pub replay_pace: Option<String>,
    /// What comes after its end: `repeat` or `disconnect`.
    pub replay_end: Option<String>,
    /// Serial number of the camera that is meant; needed where several are attached.
    pub serial: Option<String>,
    /// Changed biases by name: `[coarse, fine]` of a DAVIS346, the offset to the factory's value of an EVK4.
    pub biases: BTreeMap<String, Bias>,
    /// First column, first row, columns and rows of the window outside of which pixels send no events.
    pub roi: Option<[u16; 4]>,
    /// Column and row of pixels that send no events: 8 of a DAVIS346, 64 of an EVK4.
    pub masked_pixels: Vec<[u16; 2]>,
    /// What a DAVIS346 takes a masked pixel's place for: `picture` or `chip`.
    pub pixel_filter_axes: Option<String>,
    /// How an EVK4 counts rows of windows and masks: `top-down` or `bottom-up`.
    pub row_order: Option<String>,
    /// Background-activity filter of a DAVIS346, milliseconds; 0.25 to 1000; absent: off.
    pub activity_filter_ms: Option<f64>,
    /// Refractory filter of a DAVIS346, milliseconds; 0.25 to 1000; absent: off.
    pub refractory_filter_ms: Option<f64>,
    /// After what time a DAVIS346 sends a packet that is not full, milliseconds; 0.125 to 10.
    pub packet_delay_ms: Option<f64>,
    /// Events a second above which an EVK4 drops some; absent: never.
    pub rate_limit_events_per_s: Option<u32>,
    /// Lowest and highest frequency, Hz, at which an EVK4 drops what flickers; 50 to 500; absent: nothing.
    pub anti_flicker_hz: Option<[u16; 2]>,
    /// Signals put into the stream: `off`; of a DAVIS346 `rising`, `falling` or `pulse`; of an EVK4 `edges`.
    pub trigger_input: Option<String>,
}

/// A bias as written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(untagged)]
pub enum Bias {
    /// Coarse and fine value.
    CoarseFine([u8; 2]),
    /// Offset to the factory's value.
    Offset(i32),
}

impl Default for CameraSection {
    fn default() -> Self {
        Self {
            backend: "simulated".to_owned(),
            file: None,
            replay_pace: None,
            replay_end: None,
            serial: None,
            biases: BTreeMap::new(),
            roi: None,
            masked_pixels: Vec::new(),
            pixel_filter_axes: None,
            row_order: None,
            activity_filter_ms: None,
            refractory_filter_ms: None,
            packet_delay_ms: None,
            rate_limit_events_per_s: None,
            anti_flicker_hz: None,
            trigger_input: None,
        }
    }
}

/// The camera, checked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum CameraConfig {
    /// The simulated rig's.
    Simulated,
    /// A DAVIS346.
    Davis346 {
        /// Which one, where there are several.
        serial: Option<String>,
        /// How it is set up.
        settings: davis346::Settings,
    },
    /// An EVK4.
    Evk4 {
        /// Which one, where there are several.
        serial: Option<String>,
        /// How it is set up.
        settings: evk4::Settings,
    },
    /// A recording.
    Replay {
        /// The file.
        file: PathBuf,
        /// How fast.
        pace: ReplayPace,
        /// What comes after its end.
        end: ReplayEnd,
    },
}

impl CameraConfig {
    /// The USB driver; `None` if there is none.
    pub fn driver(&self) -> Option<Driver> {
        match self {
            Self::Simulated | Self::Replay { .. } => None,
            Self::Davis346 { .. } => Some(Driver::Davis346),
            Self::Evk4 { .. } => Some(Driver::Evk4),
        }
    }

    /// The sensor's size, as far as it is known without opening the camera; `simulated` is that of the simulated one.
    pub(crate) fn geometry(&self, simulated: Geometry) -> Option<Geometry> {
        match self {
            Self::Simulated => Some(simulated),
            Self::Davis346 { .. } => Some(davis346::GEOMETRY),
            Self::Evk4 { .. } => Some(evk4::GEOMETRY),
            Self::Replay { .. } => None,
        }
    }

    /// As the configuration names it.
    pub fn name(&self) -> String {
        match self {
            Self::Simulated => "simulated".to_owned(),
            Self::Replay { .. } => "replay".to_owned(),
            Self::Davis346 { .. } => Driver::Davis346.to_string(),
            Self::Evk4 { .. } => Driver::Evk4.to_string(),
        }
    }
}

/// Where a setting stands in the file.
fn bad_setting(error: &SettingsError) -> BadValue {
    let key = match error.key.as_str() {
        "activity_filter" => "activity_filter_ms",
        "refractory_filter" => "refractory_filter_ms",
        "packet_delay" => "packet_delay_ms",
        "rate_limit" => "rate_limit_events_per_s",
        other => other,
    };
    BadValue::new(format!("camera.{key}"), "not what the camera has", error.what.clone())
}

fn milliseconds(key: &str, value: Option<f64>, min: f64, max: f64) -> Result<Option<Duration>, BadValue> {
    value.map(|value| BadValue::duration(key, value, 1e-3, min, max)).transpose()
}

/// What the name `given` stands for; `None` is the first of `names`.
fn choice<T: Copy>(key: &str, given: Option<&String>, names: &[(&str, T)]) -> Result<T, BadValue> {
    let found = match given {
        None => names.first(),
        Some(given) => names.iter().find(|(name, _)| name == given),
    };
    found.map(|(_, value)| *value).ok_or_else(|| {
        let known: Vec<String> = names.iter().map(|(name, _)| format!("\"{name}\"")).collect();
        let value = given.map(String::as_str).unwrap_or_default();
        BadValue::new(key, value, format!("it must be {}", known.join(" or ")))
    })
}

impl CameraSection {
    /// The camera that the section describes.
    pub(super) fn camera(&self) -> Result<CameraConfig, BadValue> {
        if self.serial.as_ref().is_some_and(String::is_empty) {
            return Err(BadValue::new(
                "camera.serial",
                "empty",
                "give a serial number, or leave the key out",
            ));
        }
        let serial = self.serial.clone();
        match self.backend.as_str() {
            "simulated" => {
                let written = self.only_of(&["davis346", "evk4", "replay"]).chain(self.of_both());
                self.refuse(written)?;
                Ok(CameraConfig::Simulated)
            }
            "replay" => {
                self.refuse(self.only_of(&["davis346", "evk4"]).chain(self.of_both()))?;
                self.replay()
            }
            "davis346" => {
                self.refuse(self.only_of(&["evk4", "replay"]))?;
                Ok(CameraConfig::Davis346 { serial, settings: self.davis346()? })
            }
            "evk4" => {
                self.refuse(self.only_of(&["davis346", "replay"]))?;
                Ok(CameraConfig::Evk4 { serial, settings: self.evk4()? })
            }
            other => {
                let remedy = "it must be \"simulated\", \"davis346\", \"evk4\" or \"replay\"";
                Err(BadValue::new("camera.backend", other, remedy))
            }
        }
    }

    /// Keys that are written and that only the named backends have.
    fn only_of(&self, backends: &'static [&'static str]) -> impl Iterator<Item = &'static str> {
        let davis346 = [
            ("pixel_filter_axes", self.pixel_filter_axes.is_some()),
            ("activity_filter_ms", self.activity_filter_ms.is_some()),
            ("refractory_filter_ms", self.refractory_filter_ms.is_some()),
            ("packet_delay_ms", self.packet_delay_ms.is_some()),
        ];
        let evk4 = [
            ("row_order", self.row_order.is_some()),
            ("rate_limit_events_per_s", self.rate_limit_events_per_s.is_some()),
            ("anti_flicker_hz", self.anti_flicker_hz.is_some()),
        ];
        let replay = [
            ("file", self.file.is_some()),
            ("replay_pace", self.replay_pace.is_some()),
            ("replay_end", self.replay_end.is_some()),
        ];
        let davis346 = davis346.into_iter().filter(move |_| backends.contains(&"davis346"));
        let evk4 = evk4.into_iter().filter(move |_| backends.contains(&"evk4"));
        let replay = replay.into_iter().filter(move |_| backends.contains(&"replay"));
        davis346.chain(evk4).chain(replay).filter_map(|(key, is_written)| is_written.then_some(key))
    }

    /// Keys that are written and that both USB cameras have.
    fn of_both(&self) -> impl Iterator<Item = &'static str> {
        let keys = [
            ("serial", self.serial.is_some()),
            ("biases", !self.biases.is_empty()),
            ("roi", self.roi.is_some()),
            ("masked_pixels", !self.masked_pixels.is_empty()),
            ("trigger_input", self.trigger_input.is_some()),
        ];
        keys.into_iter().filter_map(|(key, is_written)| is_written.then_some(key))
    }

    fn refuse(&self, mut written: impl Iterator<Item = &'static str>) -> Result<(), BadValue> {
        written.next().map_or(Ok(()), |key| {
            let remedy = format!("the camera \"{}\" has no such setting; take it out", self.backend);
            Err(BadValue::new(format!("camera.{key}"), "given", remedy))
        })
    }

    fn replay(&self) -> Result<CameraConfig, BadValue> {
        let file = self.file.clone().filter(|file| !file.as_os_str().is_empty()).ok_or_else(|| {
            BadValue::new("camera.file", "not given", "name the recording that is to be replayed")
        })?;
        let paces = [("real-time", ReplayPace::RealTime), ("fastest", ReplayPace::AsFastAsPossible)];
        let ends = [("repeat", ReplayEnd::Repeat), ("disconnect", ReplayEnd::Disconnect)];
        let pace = choice("camera.replay_pace", self.replay_pace.as_ref(), &paces)?;
        let end = choice("camera.replay_end", self.replay_end.as_ref(), &ends)?;
        Ok(CameraConfig::Replay { file, pace, end })
    }

    fn davis346(&self) -> Result<davis346::Settings, BadValue> {
        let biases = self.biases.iter().map(|(name, bias)| match *bias {
            Bias::CoarseFine([coarse, fine]) => Ok((name.clone(), CoarseFine { coarse, fine })),
            Bias::Offset(value) => {
                let remedy = "a bias of the DAVIS346 is [coarse, fine], 0 to 7 and 0 to 255";
                Err(BadValue::new(format!("camera.biases.{name}"), value, remedy))
            }
        });
        let axes = [("picture", PixelFilterAxes::Picture), ("chip", PixelFilterAxes::Chip)];
        let triggers = [
            ("off", TriggerInput::Off),
            ("rising", TriggerInput::Rising),
            ("falling", TriggerInput::Falling),
            ("pulse", TriggerInput::Pulse),
        ];
        let (axes_key, trigger_key) = ("camera.pixel_filter_axes", "camera.trigger_input");
        let (activity, refractory) = ("camera.activity_filter_ms", "camera.refractory_filter_ms");
        let default = davis346::Settings::default();
        let delay = milliseconds("camera.packet_delay_ms", self.packet_delay_ms, 0.125, 10.0)?;
        let settings = davis346::Settings {
            biases: biases.collect::<Result<_, _>>()?,
            roi: self.window(),
            masked_pixels: self.pixels(),
            pixel_filter_axes: choice(axes_key, self.pixel_filter_axes.as_ref(), &axes)?,
            activity_filter: milliseconds(activity, self.activity_filter_ms, 0.25, 1000.0)?,
            refractory_filter: milliseconds(refractory, self.refractory_filter_ms, 0.25, 1000.0)?,
            trigger_input: choice(trigger_key, self.trigger_input.as_ref(), &triggers)?,
            packet_delay: delay.unwrap_or(default.packet_delay),
        };
        settings.check().map_err(|error| bad_setting(&error))?;
        Ok(settings)
    }

    fn evk4(&self) -> Result<evk4::Settings, BadValue> {
        let biases = self.biases.iter().map(|(name, bias)| match *bias {
            Bias::Offset(offset) => Ok((name.clone(), offset)),
            Bias::CoarseFine([coarse, fine]) => {
                let remedy = "a bias of the EVK4 is one number, the offset to the factory's value";
                Err(BadValue::new(format!("camera.biases.{name}"), format!("[{coarse}, {fine}]"), remedy))
            }
        });
        let orders = [("top-down", RowOrder::TopDown), ("bottom-up", RowOrder::BottomUp)];
        let triggers = [("off", false), ("edges", true)];
        let settings = evk4::Settings {
            biases: biases.collect::<Result<_, _>>()?,
            roi: self.window(),
            masked_pixels: self.pixels(),
            row_order: choice("camera.row_order", self.row_order.as_ref(), &orders)?,
            rate_limit: self.rate_limit_events_per_s,
            anti_flicker_hz: self.anti_flicker_hz.map(|[low, high]| (low, high)),
            trigger_input: choice("camera.trigger_input", self.trigger_input.as_ref(), &triggers)?,
        };
        settings.check().map_err(|error| bad_setting(&error))?;
        Ok(settings)
    }

    fn window(&self) -> Option<Window> {
        self.roi.map(|[x, y, width, height]| Window { x, y, width, height })
    }

    fn pixels(&self) -> Vec<(u16, u16)> {
        self.masked_pixels.iter().map(|&[x, y]| (x, y)).collect()
    }
}
