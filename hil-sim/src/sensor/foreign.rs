//! The pixel models of other simulators, so that nothing is fitted to ours alone. Their parameters are those of the table in
//! sensor-and-optics, section 1, read from v2e at cac6384 and IEBCS at 8fdab5c; size and time stamps are the DAVIS346's.

use std::time::Duration;

use super::config::{CameraModel, Light, SensorConfig};
use super::response::Logarithm;

impl SensorConfig {
    /// Pixels like those of v2e: linear below 20 DN, bandwidth in proportion to (DN + 20), fixed mismatch, neither latency nor
    /// read-out. In light its command line's defaults, in the dark its "noisy" set.
    pub fn v2e_like(light: Light) -> Self {
        let clear = Self {
            model: "v2e-like (simulated)".to_owned(),
            cutoff_hz: 300.0,
            refractory: Duration::from_micros(500),
            leak_hz: 0.01,
            shot_noise_black_hz: 0.001,
            shot_noise_white_hz: 0.000_25,
            ..Self::preset(CameraModel::Davis346, Light::Light).without_read_out()
        };
        match light {
            Light::Light => clear,
            Light::Dark => Self {
                threshold_mismatch: 0.05,
                cutoff_hz: 30.0,
                leak_hz: 0.1,
                shot_noise_black_hz: 5.0,
                shot_noise_white_hz: 1.25,
                ..clear
            },
        }
    }

    /// Pixels like those of IEBCS: ln (I + 1) with I in lux, a time constant of 40 us x 1000 / (I + 1), thresholds redrawn at
    /// every event, latency and jitter. White is 161 lux in light and 10 lux in the dark: at 1 lux this logarithm leaves less
    /// than a threshold of nearly every contrast. The noise is that of its histogram for 161 lux, and between that and the
    /// one for 0.1 lux (13 Hz a pixel) on logarithmic scales. Its jitter does not grow with the time constant here.
    pub fn iebcs_like(light: Light) -> Self {
        let lux = match light {
            Light::Light => 161.0,
            Light::Dark => 10.0,
        };
        // One lux, DN.
        let one_lux = 255.0 / lux;
        let time_constant = 40e-6 * 1000.0 / (lux + 1.0);
        let clear = Self {
            model: "IEBCS-like (simulated)".to_owned(),
            threshold_mismatch: 0.0,
            threshold_jitter: 0.02,
            logarithm: Logarithm::Offset(one_lux),
            cutoff_hz: 1.0 / (std::f64::consts::TAU * time_constant),
            cutoff_dark_dn: one_lux,
            refractory: Duration::from_micros(100),
            // A third of the pixels at 0.1 Hz; a few OFF events.
            leak_hz: 0.034,
            leak_spread_decades: 0.3,
            shot_noise_black_hz: 0.001,
            shot_noise_white_hz: 0.001,
            ..Self::preset(CameraModel::Davis346, Light::Light).without_read_out()
        };
        let timed = Self { latency: Duration::from_micros(100), jitter: Duration::from_micros(10), ..clear };
        match light {
            Light::Light => timed,
            Light::Dark => Self { shot_noise_black_hz: 0.3, shot_noise_white_hz: 0.3, ..timed },
        }
    }

    fn without_read_out(self) -> Self {
        Self {
            latency: Duration::ZERO,
            jitter: Duration::ZERO,
            readout_events_per_s: 1e9,
            readout_queue: 1_000_000,
            ..self
        }
    }
}
