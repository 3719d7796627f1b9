//! Parameters of the simulated sensors.

use std::time::Duration;

use evfocus_core::Geometry;

use super::patches::PatchNoise;
use super::rate_cap::RateCap;
use super::response::Logarithm;
use crate::ConfigError;
use crate::names::named;

/// Which camera the sensor is that of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum CameraModel {
    /// iniVation DAVIS346: 346 x 260, pitch 18.5 um.
    Davis346,
    /// Prophesee/Sony IMX636, as in the EVK4: 1280 x 720, pitch 4.86 um.
    Imx636,
}

named!(CameraModel, "camera model", { Davis346 => "davis346", Imx636 => "imx636" });

impl CameraModel {
    /// How many times smaller the pixels are than the DAVIS346's: the same lens blurs over that many times more of them.
    pub(crate) fn pitch_ratio(self) -> f64 {
        match self {
            Self::Davis346 => 1.0,
            Self::Imx636 => 18.5 / 4.86,
        }
    }
}

/// How much light there is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Light {
    /// More than 100 lux.
    Light,
    /// About 1 lux: slow and noisy pixels.
    Dark,
}

named!(Light, "light", { Light => "light", Dark => "dark" });

/// A sensor in a certain light. Intensities are in DN, 0 (black) to 255 (white). The presets follow the table "Suggested
/// presets" of sensor-and-optics, section 1.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorConfig {
    /// Model name that the camera reports.
    pub model: String,
    /// Pixels.
    pub geometry: Geometry,
    /// Rise of the natural logarithm of the intensity that makes an ON event.
    pub on_threshold: f64,
    /// Fall that makes an OFF event, as a positive number.
    pub off_threshold: f64,
    /// Standard deviation of both thresholds between pixels, fixed for each pixel; none goes below 0.01.
    pub threshold_mismatch: f64,
    /// Standard deviation by which both thresholds of a pixel differ from one event to the next, as in IEBCS. Default 0.
    pub threshold_jitter: f64,
    /// The logarithm. Default linear below 20 DN.
    pub logarithm: Logarithm,
    /// Cut-off frequency of a white pixel, Hz; other pixels have (DN + dark) / (255 + dark) of it.
    pub cutoff_hz: f64,
    /// That "dark": the DN to which the bandwidth falls. Default 20.
    pub cutoff_dark_dn: f64,
    /// Cut-off of a second low-pass behind the photoreceptor, the same for all pixels, Hz. Default none: a first-order pixel.
    pub source_follower_hz: Option<f64>,
    /// Shortest time between two events of a pixel.
    pub refractory: Duration,
    /// ON events per second of a pixel in constant light, by leakage.
    pub leak_hz: f64,
    /// Standard deviation of the leakage between pixels, decades.
    pub leak_spread_decades: f64,
    /// Noise events per second of a black pixel, both polarities together. They leave the pixel's memory as it is: what
    /// one noise event moves, its counterpart moves back.
    pub shot_noise_black_hz: f64,
    /// The same of a white pixel; linear in between.
    pub shot_noise_white_hz: f64,
    /// Noise that neighbours share. Default none.
    pub patch_noise: Option<PatchNoise>,
    /// Number of pixels that fire by themselves.
    pub hot_pixels: u32,
    /// Events per second of each of them.
    pub hot_pixel_hz: f64,
    /// From the pixel's crossing to its time stamp.
    pub latency: Duration,
    /// Standard deviation of the latency.
    pub jitter: Duration,
    /// The event-rate controller. Default off, as the devices come.
    pub rate_cap: Option<RateCap>,
    /// Events per second that the read-out takes; the time stamps of what waits are those of its read-out.
    pub readout_events_per_s: f64,
    /// Events that may wait for the read-out; what comes beyond is lost, and counted.
    pub readout_queue: u32,
    /// Step of the time stamps.
    pub time_resolution: Duration,
}

impl SensorConfig {
    /// The sensor of `model` in `light`.
    pub fn preset(model: CameraModel, light: Light) -> Self {
        let davis_light = Self {
            model: "DAVIS346 (simulated)".to_owned(),
            geometry: Geometry { width: 346, height: 260 },
            on_threshold: 0.2,
            off_threshold: 0.2,
            threshold_mismatch: 0.03,
            threshold_jitter: 0.0,
            logarithm: Logarithm::LinearBelow(20.0),
            cutoff_hz: 250.0,
            cutoff_dark_dn: 20.0,
            source_follower_hz: None,
            refractory: Duration::from_micros(500),
            leak_hz: 0.1,
            leak_spread_decades: 0.1,
            shot_noise_black_hz: 0.05,
            shot_noise_white_hz: 0.01,
            patch_noise: None,
            hot_pixels: 0,
            hot_pixel_hz: 300.0,
            latency: Duration::from_micros(50),
            jitter: Duration::from_micros(20),
            rate_cap: None,
            readout_events_per_s: 12e6,
            readout_queue: 4096,
            time_resolution: Duration::from_micros(1),
        };
        let imx_light = Self {
            model: "IMX636 (simulated)".to_owned(),
            geometry: Geometry { width: 1280, height: 720 },
            on_threshold: 0.25,
            off_threshold: 0.25,
            threshold_mismatch: 0.025,
            refractory: Duration::from_millis(1),
            leak_hz: 0.02,
            shot_noise_black_hz: 0.02,
            shot_noise_white_hz: 0.02,
            latency: Duration::from_micros(80),
            // 1.6 Gbit/s of USB at 4 bytes an event.
            readout_events_per_s: 50e6,
            readout_queue: 65_536,
            ..davis_light.clone()
        };
        match (model, light) {
            (CameraModel::Davis346, Light::Light) => davis_light,
            (CameraModel::Davis346, Light::Dark) => davis_light.darkened(0.05, 5.0),
            (CameraModel::Imx636, Light::Light) => imx_light,
            // Not in the table: the DAVIS346's step from light to dark, applied to the IMX636.
            (CameraModel::Imx636, Light::Dark) => imx_light.darkened(0.04, 3.0),
        }
    }

    /// Events per second that come out at most: what the read-out takes, or the rate cap lets pass.
    pub(crate) fn rate_ceiling(&self) -> f64 {
        let cap = self.rate_cap.map_or(f64::INFINITY, RateCap::events_per_s);
        self.readout_events_per_s.min(cap).max(1.0)
    }

    fn darkened(self, threshold_mismatch: f64, shot_noise_black_hz: f64) -> Self {
        Self {
            threshold_mismatch,
            cutoff_hz: 30.0,
            shot_noise_black_hz,
            shot_noise_white_hz: 1.0,
            latency: Duration::from_micros(600),
            jitter: Duration::from_micros(150),
            ..self
        }
    }

    pub(crate) fn validate(&self) -> Result<(), ConfigError> {
        let (width, height) = (f64::from(self.geometry.width), f64::from(self.geometry.height));
        ConfigError::check("sensor.geometry.width", width, 8.0, 4096.0)?;
        ConfigError::check("sensor.geometry.height", height, 8.0, 4096.0)?;
        ConfigError::check("sensor.on_threshold", self.on_threshold, 0.02, 5.0)?;
        ConfigError::check("sensor.off_threshold", self.off_threshold, 0.02, 5.0)?;
        ConfigError::check("sensor.threshold_mismatch", self.threshold_mismatch, 0.0, 1.0)?;
        ConfigError::check("sensor.threshold_jitter", self.threshold_jitter, 0.0, 1.0)?;
        self.logarithm.validate()?;
        ConfigError::check("sensor.cutoff_hz", self.cutoff_hz, 0.1, 1e6)?;
        ConfigError::check("sensor.cutoff_dark_dn", self.cutoff_dark_dn, 0.1, 1e5)?;
        ConfigError::check("sensor.source_follower_hz", self.source_follower_hz.unwrap_or(1.0), 0.1, 1e6)?;
        ConfigError::check("sensor.refractory", self.refractory.as_secs_f64(), 0.0, 1.0)?;
        ConfigError::check("sensor.leak_hz", self.leak_hz, 0.0, 1000.0)?;
        ConfigError::check("sensor.leak_spread_decades", self.leak_spread_decades, 0.0, 2.0)?;
        ConfigError::check("sensor.shot_noise_black_hz", self.shot_noise_black_hz, 0.0, 1000.0)?;
        ConfigError::check("sensor.shot_noise_white_hz", self.shot_noise_white_hz, 0.0, 1000.0)?;
        self.patch_noise.map_or(Ok(()), PatchNoise::validate)?;
        self.rate_cap.map_or(Ok(()), RateCap::validate)?;
        ConfigError::check("sensor.hot_pixels", f64::from(self.hot_pixels), 0.0, width * height)?;
        ConfigError::check("sensor.hot_pixel_hz", self.hot_pixel_hz, 0.001, 1e6)?;
        ConfigError::check("sensor.latency", self.latency.as_secs_f64(), 0.0, 1.0)?;
        ConfigError::check("sensor.jitter", self.jitter.as_secs_f64(), 0.0, 0.1)?;
        ConfigError::check("sensor.readout_events_per_s", self.readout_events_per_s, 1.0, 1e12)?;
        ConfigError::check("sensor.time_resolution", self.time_resolution.as_secs_f64(), 1e-6, 1.0)
    }
}

impl Default for SensorConfig {
    fn default() -> Self {
        Self::preset(CameraModel::Davis346, Light::Light)
    }
}
