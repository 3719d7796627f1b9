//! `[lens]`: which lens, where it is attached, and what its protocol does not tell.

mod drivers;

use evfocus_core::{LensPosition, LensRange, LensSpeed};
use evfocus_hal::{LensClass, LensInfo};
use evfocus_lens::firmata::{self, FirmataConfig};
use evfocus_lens::grbl::{self, GrblConfig};
use evfocus_lens::indi::{self, IndiConfig};
use evfocus_lens::labjack::{self, LabJackConfig};
use evfocus_lens::moonlite::{self, MoonLiteConfig};
use evfocus_lens::optotune::{self, OptotuneConfig};
use hil_sim::wire::Protocol;
use serde::Deserialize;

use super::BadValue;
pub use drivers::{
    DriveSection, FirmataSection, GrblSection, IndiSection, LabJackSection, MoonLiteSection, OptotuneSection,
    SettingSection,
};

/// The port that stands for the emulated controller before the simulated rig's lens.
const EMULATED: &str = "emulated";

/// A lens that the host steers is steered at least this often.
const SLOWEST_STEERING_MS: f64 = 10.0;

/// `[lens]`
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LensSection {
    /// `simulated` or the name of a driver.
    pub backend: String,
    /// The serial port, for drivers that use one; `emulated`: a model of the device, before the simulated rig's lens.
    pub port: Option<String>,
    /// `host:port`, for drivers that use TCP; `emulated` as for `port`.
    pub address: Option<String>,
    /// The lowest position the lens may be sent to, counts; absent: the lens's own.
    pub min_counts: Option<f64>,
    /// The highest; absent: the lens's own.
    pub max_counts: Option<f64>,
    /// How often the lens is asked where it is, milliseconds; 0.5 to 1000.
    pub poll_ms: f64,
    /// Play between what the lens reports and the glass, counts; 0 to 1e6. Absent: as it was calibrated, else 0.
    pub backlash_counts: Option<f64>,
    /// For `moonlite`.
    pub moonlite: MoonLiteSection,
    /// For `optotune`.
    pub optotune: OptotuneSection,
    /// For `grbl`.
    pub grbl: GrblSection,
    /// For `firmata`.
    pub firmata: FirmataSection,
    /// For `labjack`.
    pub labjack: LabJackSection,
    /// Motor and potentiometer, for `firmata` and `labjack`.
    pub drive: DriveSection,
    /// For `indi`.
    pub indi: IndiSection,
}

impl Default for LensSection {
    fn default() -> Self {
        Self {
            backend: "simulated".to_owned(),
            port: None,
            address: None,
            min_counts: None,
            max_counts: None,
            poll_ms: 2.0,
            backlash_counts: None,
            moonlite: MoonLiteSection::default(),
            optotune: OptotuneSection::default(),
            grbl: GrblSection::default(),
            firmata: FirmataSection::default(),
            labjack: LabJackSection::default(),
            drive: DriveSection::default(),
            indi: IndiSection::default(),
        }
    }
}

/// Which lens, checked.
#[derive(Debug, Clone, PartialEq)]
pub enum LensBackend {
    /// That of the simulated rig, without a protocol between.
    Simulated,
    /// One that a driver talks to.
    Driver {
        /// The driver and its settings.
        driver: LensDriver,
        /// Where the lens is attached.
        place: LensPlace,
    },
}

/// A driver and its settings.
#[derive(Debug, Clone, PartialEq)]
pub enum LensDriver {
    /// MoonLite focusers.
    MoonLite(MoonLiteConfig),
    /// Optotune's Lens Driver 4.
    Optotune(OptotuneConfig),
    /// A GRBL controller.
    Grbl(GrblConfig),
    /// A Firmata board, a motor and a potentiometer.
    Firmata(FirmataConfig),
    /// A LabJack, a motor and a potentiometer.
    LabJack(LabJackConfig),
    /// A focuser of an INDI server.
    Indi(IndiConfig),
}

/// Where a lens is attached.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum LensPlace {
    /// Nowhere: a model of the controller, before the simulated rig's lens.
    Emulated,
    /// A serial port.
    Serial {
        /// The device file.
        path: String,
        /// Bits per second.
        baud: u32,
    },
    /// A TCP address, `host:port`.
    Tcp(String),
}

impl LensSection {
    /// The section, checked.
    pub(super) fn backend(&self) -> Result<LensBackend, BadValue> {
        self.check_limits()?;
        if self.backend == "simulated" {
            for (key, place) in [("lens.port", &self.port), ("lens.address", &self.address)] {
                if let Some(place) = place {
                    return Err(BadValue::new(
                        key,
                        place,
                        "the simulated lens is attached nowhere; leave it out",
                    ));
                }
            }
            return Ok(LensBackend::Simulated);
        }
        let protocol: Protocol = self.backend.parse().map_err(|error: hil_sim::NameError| {
            BadValue::new(
                "lens.backend",
                &self.backend,
                format!("choose one of: simulated, {}", error.choices),
            )
        })?;
        let (driver, place) = match protocol {
            Protocol::MoonLite => {
                let config =
                    self.moonlite.config(self.range(0.0, f64::from(moonlite::protocol::HIGHEST))?)?;
                (LensDriver::MoonLite(config), self.serial(moonlite::BAUD)?)
            }
            Protocol::Optotune => {
                (LensDriver::Optotune(self.optotune.config()?), self.serial(optotune::BAUD)?)
            }
            Protocol::Grbl => {
                (LensDriver::Grbl(self.grbl.config(self.range(-1e7, 1e7)?)?), self.serial(grbl::BAUD)?)
            }
            Protocol::Firmata => {
                let config = self.firmata.config(self.steered_range()?, &self.drive)?;
                (LensDriver::Firmata(config), self.serial(firmata::BAUD)?)
            }
            Protocol::LabJack => {
                let config = self.labjack.config(self.steered_range()?, &self.drive)?;
                (LensDriver::LabJack(config), self.tcp(labjack::PORT)?)
            }
            Protocol::Indi => (LensDriver::Indi(self.indi.config()?), self.tcp(indi::PORT)?),
        };
        Ok(LensBackend::Driver { driver, place })
    }

    fn check_limits(&self) -> Result<(), BadValue> {
        let (min, max) = (self.min_counts, self.max_counts);
        for (key, limit) in [("lens.min_counts", min), ("lens.max_counts", max)] {
            if let Some(value) = limit.filter(|value| !value.is_finite()) {
                return Err(BadValue::new(key, value, "it must be a number of lens counts"));
            }
        }
        match (min, max) {
            (Some(min), Some(max)) if min >= max => Err(BadValue::new(
                "lens.min_counts",
                min,
                format!("it must lie below lens.max_counts, {max}"),
            )),
            (Some(_) | None, Some(_) | None) => Ok(()),
        }
    }

    /// The range, for a protocol that knows no limits; both ends within `lowest` and `highest`.
    fn range(&self, lowest: f64, highest: f64) -> Result<LensRange, BadValue> {
        let end = |key, limit: Option<f64>| {
            let missing = || {
                BadValue::new(key, "missing", format!("{} knows no limits of its own; give it", self.backend))
            };
            BadValue::check(key, limit.ok_or_else(missing)?, lowest, highest)
        };
        let min = end("lens.min_counts", self.min_counts)?;
        let max = end("lens.max_counts", self.max_counts)?;
        LensRange::new(LensPosition(min), LensPosition(max))
            .map_err(|error| BadValue::new("lens.min_counts", min, error.to_string()))
    }

    /// The range of a lens that the host steers, step by step with each poll.
    fn steered_range(&self) -> Result<LensRange, BadValue> {
        if self.poll_ms > SLOWEST_STEERING_MS {
            let remedy =
                format!("{} steers the lens with each poll; at most {SLOWEST_STEERING_MS}", self.backend);
            return Err(BadValue::new("lens.poll_ms", self.poll_ms, remedy));
        }
        self.range(-1e6, 1e6)
    }

    fn tcp(&self, port: u16) -> Result<LensPlace, BadValue> {
        if let Some(port) = &self.port {
            let remedy = format!("{} is reached over TCP; give lens.address instead", self.backend);
            return Err(BadValue::new("lens.port", port, remedy));
        }
        match self.address.as_deref() {
            Some(EMULATED) => Ok(LensPlace::Emulated),
            Some(address)
                if address
                    .rsplit_once(':')
                    .is_some_and(|(host, port)| !host.is_empty() && port.parse::<u16>().is_ok()) =>
            {
                Ok(LensPlace::Tcp(address.to_owned()))
            }
            given => {
                let remedy = format!("give host:port, for example \"localhost:{port}\"; or \"emulated\"");
                Err(BadValue::new("lens.address", given.unwrap_or("missing"), remedy))
            }
        }
    }

    fn serial(&self, baud: u32) -> Result<LensPlace, BadValue> {
        if let Some(address) = &self.address {
            let remedy = format!("{} is on a serial port; give lens.port instead", self.backend);
            return Err(BadValue::new("lens.address", address, remedy));
        }
        match self.port.as_deref() {
            Some(EMULATED) => Ok(LensPlace::Emulated),
            Some(path) if !path.is_empty() => Ok(LensPlace::Serial { path: path.to_owned(), baud }),
            Some(_) | None => {
                let remedy =
                    "give the serial port, best by a name that stays: ls /dev/serial/by-id; or \"emulated\"";
                Err(BadValue::new("lens.port", "missing", remedy))
            }
        }
    }
}

impl LensBackend {
    /// The name in the configuration.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Simulated => "simulated",
            Self::Driver { driver, .. } => driver.protocol().name(),
        }
    }

    /// Where the lens is attached, for people.
    pub fn location(&self) -> &str {
        match self {
            Self::Simulated => "simulated",
            Self::Driver { place: LensPlace::Emulated, .. } => EMULATED,
            Self::Driver { place: LensPlace::Serial { path: place, .. } | LensPlace::Tcp(place), .. } => {
                place
            }
        }
    }

    /// Whether it is neither simulated nor emulated.
    pub fn is_hardware(&self) -> bool {
        matches!(self, Self::Driver { place: LensPlace::Serial { .. } | LensPlace::Tcp(_), .. })
    }

    /// What the lens will say of itself, where that is known without asking it.
    pub(super) fn expected(&self, rig: &hil_sim::RigConfig) -> Option<LensInfo> {
        match self {
            Self::Simulated => {
                Some(info(LensClass::Positioner, rig.lens.range, rig.lens.max_speed, rig.lens.needs_homing))
            }
            Self::Driver { driver, .. } => driver.expected(),
        }
    }

    /// What the simulated rig's lens must be like, for the emulated controller before it.
    pub(super) fn emulated(&self) -> Option<LensInfo> {
        match self {
            Self::Driver { driver, place: LensPlace::Emulated } => driver.expected(),
            Self::Simulated | Self::Driver { .. } => None,
        }
    }
}

impl LensDriver {
    /// The protocol that the driver speaks.
    pub fn protocol(&self) -> Protocol {
        match self {
            Self::MoonLite(_) => Protocol::MoonLite,
            Self::Optotune(_) => Protocol::Optotune,
            Self::Grbl(_) => Protocol::Grbl,
            Self::Firmata(_) => Protocol::Firmata,
            Self::LabJack(_) => Protocol::LabJack,
            Self::Indi(_) => Protocol::Indi,
        }
    }

    fn expected(&self) -> Option<LensInfo> {
        match self {
            Self::MoonLite(config) => {
                Some(info(LensClass::Positioner, config.range, config.max_speed, false))
            }
            Self::Firmata(FirmataConfig { drive, .. }) | Self::LabJack(LabJackConfig { drive, .. }) => {
                Some(info(LensClass::RateDrive, drive.range, drive.max_speed, false))
            }
            // Their ranges or speeds are their own.
            Self::Optotune(_) | Self::Grbl(_) | Self::Indi(_) => None,
        }
    }
}

/// What matters of a lens before it is there.
fn info(class: LensClass, range: LensRange, max_speed: LensSpeed, needs_homing: bool) -> LensInfo {
    LensInfo {
        model: String::new(),
        serial: String::new(),
        range,
        class,
        max_speed,
        speed_is_share: false,
        needs_homing,
    }
}
