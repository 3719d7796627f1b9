//! How an EVK4 is to be set up.

use evfocus_core::Window;

use super::biases::{self, BiasError};
use super::{GEOMETRY, PIXEL_MASKS};
use crate::settings::SettingsError;

/// Which row of the picture the sensor's row 0 is, for windows and masks. The sources disagree: OpenEB does not turn rows round,
/// neuromorphic-drivers does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RowOrder {
    /// The topmost.
    #[default]
    TopDown,
    /// The lowest.
    BottomUp,
}

/// The settings. The default is fit for focusing: every filter passes everything on, and the event-rate controller drops
/// nothing.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Settings {
    /// Changed biases by name, as offsets to the factory's values.
    pub biases: Vec<(String, i32)>,
    /// Only pixels in this window send events.
    pub roi: Option<Window>,
    /// Pixels, column and row, that send no events; at most 64.
    pub masked_pixels: Vec<(u16, u16)>,
    /// How the sensor counts rows.
    pub row_order: RowOrder,
    /// Events a second above which the sensor drops some. It falsifies the event rate exactly where the picture is sharp.
    pub rate_limit: Option<u32>,
    /// Events that repeat at frequencies from the first to the second, Hz, are dropped: lamps on the mains, 100 or 120.
    pub anti_flicker_hz: Option<(u16, u16)>,
    /// Put edges at the trigger input into the stream.
    pub trigger_input: bool,
}

/// Range of the rate limit: one event in a period of 200 us, and what OpenEB allows.
pub(super) const RATE_LIMITS: (u32, u32) = (5_000, 3_200_000_000);

/// Range of the anti-flicker filter's frequencies, Hz, in OpenEB.
pub(super) const FLICKER_HZ: (u16, u16) = (50, 500);

impl Settings {
    /// Checks every value.
    ///
    /// # Errors
    /// [`SettingsError`] for the first that the camera does not have.
    pub fn check(&self) -> Result<(), SettingsError> {
        for (name, offset) in &self.biases {
            biases::check(name, *offset).map_err(|error| {
                let key = match &error {
                    BiasError::Unknown { .. } => "biases".to_owned(),
                    BiasError::OutOfRange { name, .. } => format!("biases.{name}"),
                };
                SettingsError::new(key, error.to_string())
            })?;
        }
        SettingsError::check_roi(self.roi, GEOMETRY)?;
        SettingsError::check_pixels(&self.masked_pixels, PIXEL_MASKS, GEOMETRY)?;
        let (lowest, highest) = FLICKER_HZ;
        if let Some((low, high)) = self.anti_flicker_hz
            && !(lowest <= low && low <= high && high <= highest)
        {
            let what = format!(
                "[{low}, {high}]; it must be a lower and a higher frequency from {lowest} to {highest} Hz"
            );
            return Err(SettingsError::new("anti_flicker_hz", what));
        }
        let (min, max) = RATE_LIMITS;
        match self.rate_limit.filter(|limit| *limit < min || *limit > max) {
            Some(limit) => {
                let what = format!("{limit} events/s; it must be from {min} to {max}");
                Err(SettingsError::new("rate_limit", what))
            }
            None => Ok(()),
        }
    }
}
