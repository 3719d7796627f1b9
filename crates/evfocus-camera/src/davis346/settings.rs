//! How a DAVIS346 is to be set up.

use std::time::Duration;

use evfocus_core::Window;

use super::biases::{self, BiasError, CoarseFine};
use super::{GEOMETRY, PIXEL_FILTERS};
use crate::settings::SettingsError;

/// Which signal at the external input is put into the stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TriggerInput {
    /// None.
    #[default]
    Off,
    /// Rising edges.
    Rising,
    /// Falling edges.
    Falling,
    /// Pulses of at least 10 us.
    Pulse,
}

/// In which coordinates the pixel filter takes its pixels. The sources disagree for logic 18: the logic's own code exchanges
/// the axes, and libcaer's automatic filter exchanges them once more.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum PixelFilterAxes {
    /// Column and row of the picture.
    #[default]
    Picture,
    /// Column and row of the chip, which are row and column of the picture.
    Chip,
}

/// The settings. The default is fit for focusing: nothing on the camera drops events because of what they are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Settings {
    /// Changed biases by name.
    pub biases: Vec<(String, CoarseFine)>,
    /// Only pixels in this window send events.
    pub roi: Option<Window>,
    /// Pixels, column and row, that send no events; at most 8.
    pub masked_pixels: Vec<(u16, u16)>,
    /// How the camera understands them.
    pub pixel_filter_axes: PixelFilterAxes,
    /// Drop events without a neighbour's within this time, 250 us to 1 s. It falsifies the event rate: sparse (blurred) pictures
    /// lose a larger share. The maker's software has it on, at 2 ms.
    pub activity_filter: Option<Duration>,
    /// Drop events of a pixel within this time after its last, 250 us to 1 s. It falsifies the event rate where pixels are fast.
    pub refractory_filter: Option<Duration>,
    /// The external input.
    pub trigger_input: TriggerInput,
    /// After what time a transfer that is not full is sent; 125 us to 10 ms.
    pub packet_delay: Duration,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            biases: Vec::new(),
            roi: None,
            masked_pixels: Vec::new(),
            pixel_filter_axes: PixelFilterAxes::default(),
            activity_filter: None,
            refractory_filter: None,
            trigger_input: TriggerInput::default(),
            packet_delay: Duration::from_millis(1),
        }
    }
}

/// The unit of the filters' times.
pub(super) const FILTER_UNIT: Duration = Duration::from_micros(250);
/// Longest time of a filter, in its units rounded down to a second.
const MAX_FILTER_TIME: Duration = Duration::from_secs(1);
/// Range of the delay of packets.
const PACKET_DELAYS: (Duration, Duration) = (Duration::from_micros(125), Duration::from_millis(10));

impl Settings {
    /// Checks every value.
    ///
    /// # Errors
    /// [`SettingsError`] for the first that the camera does not have.
    pub fn check(&self) -> Result<(), SettingsError> {
        for (name, value) in &self.biases {
            biases::check(name, *value).map_err(|error| {
                let key = match &error {
                    BiasError::Unknown { .. } => "biases".to_owned(),
                    BiasError::OutOfRange { name, .. } => format!("biases.{name}"),
                };
                SettingsError::new(key, error.to_string())
            })?;
        }
        SettingsError::check_roi(self.roi, GEOMETRY)?;
        SettingsError::check_pixels(&self.masked_pixels, PIXEL_FILTERS, GEOMETRY)?;
        let filters =
            [("activity_filter", self.activity_filter), ("refractory_filter", self.refractory_filter)];
        for (key, time) in filters {
            if let Some(time) = time {
                SettingsError::check_duration(key, time, (FILTER_UNIT, MAX_FILTER_TIME))?;
            }
        }
        SettingsError::check_duration("packet_delay", self.packet_delay, PACKET_DELAYS)
    }
}
