//! Setting the sensor up.

use evfocus_core::Window;
use evfocus_hal::DeviceError;
use evfocus_hal::usb::{UsbError, UsbTransport};

use super::registers::{
    BIAS_WORD, CHIP_ID, CHIP_ID_IMX636, CHIP_VARIANT, CHIP_VARIANT_MASK, PIPELINE_CONTROL, PIPELINE_EVT21,
    PIXEL_MASK, PIXEL_MASK_VALID, ROI_COLUMNS, ROI_CTRL, ROI_ROWS, STC_BYPASS, STC_CONTROL, TRIGGER_CONTROL,
    TRIGGER_ENABLE, afk, erc, roi_ctrl,
};
use super::sequences::{DESTROY, INIT, STOP};
use super::settings::{RowOrder, Settings};
use super::{DATA_ENDPOINT, DRAIN_TIME, Evk4, GEOMETRY, PIXEL_MASKS, biases, board};

/// The event-rate controller counts in periods of this many microseconds.
const REFERENCE_PERIOD_US: u32 = 200;
/// Events in a period when nothing is dropped; the register's largest value.
const NO_LIMIT: u32 = 640_000;
/// Registers in one message: the board's messages have 1024 bytes.
const WORDS_PER_WRITE: usize = 128;
/// Bits above the rows that there are in the last word of rows: always off.
const ROWS_BEYOND: u32 = 0xFFFF_0000;

impl<T: UsbTransport> Evk4<T> {
    /// From an unknown state to one in which the start sequence starts the stream.
    pub(super) fn set_up(&mut self, settings: &Settings) -> Result<(), DeviceError> {
        let id = self.get(CHIP_ID)?;
        let variant = self.get(CHIP_VARIANT)? & CHIP_VARIANT_MASK;
        if id != CHIP_ID_IMX636 || variant != 0 {
            let what = format!(
                "its sensor is number {id:#010x}, variant {variant}; an IMX636 is {CHIP_ID_IMX636:#010x}, variant 0"
            );
            return Err(self.protocol_error(what));
        }
        self.run(&STOP)?;
        self.run(&DESTROY)?;
        self.run(&INIT)?;
        self.set_bits(PIPELINE_CONTROL, 0, PIPELINE_EVT21)?;
        self.set_anti_flicker(settings.anti_flicker_hz)?;
        self.set_bits(STC_CONTROL, STC_BYPASS, STC_BYPASS)?;
        self.set_rate_control(settings.rate_limit)?;
        let trigger = if settings.trigger_input { TRIGGER_ENABLE } else { 0 };
        self.set_bits(TRIGGER_CONTROL, trigger, TRIGGER_ENABLE)?;
        self.drain()?;
        for (name, offset) in &settings.biases {
            let Some(bias) = biases::find(name) else { continue };
            let factory = self.get(bias.address)?;
            self.put(bias.address, &[BIAS_WORD | biases::value(factory, *offset)])?;
        }
        self.set_roi(settings)?;
        self.set_masks(settings)
    }

    /// Reads and throws away what an earlier owner has left in the board.
    fn drain(&mut self) -> Result<(), DeviceError> {
        let mut waste = vec![0; 16 * 1024];
        let end = self.clock.now() + DRAIN_TIME;
        while self.clock.now() < end {
            match self.transport.bulk_in(DATA_ENDPOINT, &mut waste, end.since(self.clock.now())) {
                Ok(0) | Err(UsbError::TimedOut | UsbError::Stalled) => return Ok(()),
                Ok(_) => {}
                Err(error) => return Err(self.usb_error(error, "emptying the data endpoint")),
            }
        }
        Ok(())
    }

    /// The anti-flicker filter, in OpenEB's order; `None`: it passes everything on.
    fn set_anti_flicker(&mut self, frequencies_hz: Option<(u16, u16)>) -> Result<(), DeviceError> {
        self.put(afk::CONTROL, &[afk::BYPASSED])?;
        let Some((low, high)) = frequencies_hz else { return Ok(()) };
        if self.get(afk::INITIALIZATION)? & afk::READY == 0 {
            let what = "its anti-flicker filter does not get ready; leave anti_flicker_hz out";
            return Err(self.protocol_error(what.to_owned()));
        }
        self.set_bits(afk::INVALIDATION, afk::WAIT_TIME, afk::WAIT_TIME_MASK)?;
        // 50 Hz, the lowest, just fits into 8 bits.
        let period = |hz: u16| (1_000_000 / u32::from(hz)) >> 7;
        self.put(afk::FILTER_PERIOD, &[afk::HALF_DARK | period(low) << 8 | period(high)])?;
        self.set_bits(afk::PARAM, 0, afk::INVERT)?;
        self.put(afk::CONTROL, &[afk::DROPPING])
    }

    /// The event-rate controller, in OpenEB's order. Without a limit it counts, and drops nothing.
    fn set_rate_control(&mut self, limit: Option<u32>) -> Result<(), DeviceError> {
        let per_period = |limit| (u64::from(limit) * u64::from(REFERENCE_PERIOD_US) / 1_000_000) as u32;
        self.set_bits(erc::CONTROL, 0, erc::CONTROL_MASK)?;
        self.set_bits(erc::IN_DROP_RATE_CONTROL, 1, 1)?;
        self.put(erc::REFERENCE_PERIOD, &[REFERENCE_PERIOD_US])?;
        self.put(erc::TARGET_EVENT_RATE, &[limit.map_or(NO_LIMIT, per_period)])?;
        self.set_bits(erc::ENABLE, erc::ENABLED, erc::ENABLE_MASK)?;
        self.put(erc::TABLE_ACCESS, &[1])?;
        self.put(erc::WEIGHT_TABLE, &[erc::WEIGHT; erc::WEIGHT_TABLE_WORDS])?;
        self.put(erc::TABLE_ACCESS, &[0])?;
        let table: Vec<u32> = (0..erc::DROP_TABLE_WORDS).map(|i| ((2 * i + 1) << 16) | (2 * i)).collect();
        self.put(erc::DROP_TABLE, &table)?;
        self.set_bits(erc::TIME_DROPPING, u32::from(limit.is_some()), 1)?;
        self.set_bits(erc::COLUMN_DROPPING, 0, 1)?;
        self.set_bits(erc::ROW_DROPPING, 0, 1)?;
        self.set_bits(erc::CONTROL, erc::CONFIGURED, erc::CONTROL_MASK)
    }

    fn set_roi(&mut self, settings: &Settings) -> Result<(), DeviceError> {
        let roi = settings.roi.unwrap_or(Window::whole(GEOMETRY));
        let columns = off_lines(roi.x, roi.width, GEOMETRY.width);
        let first_row = sensor_row(settings.row_order, roi.y, roi.height);
        let mut rows = off_lines(first_row, roi.height, GEOMETRY.height);
        if let Some(last) = rows.last_mut() {
            *last |= ROWS_BEYOND;
        }
        self.put(ROI_COLUMNS, &columns)?;
        self.put(ROI_ROWS, &rows)?;
        let bits = roi_ctrl::ENABLE | roi_ctrl::EITHER_LINE | roi_ctrl::SHADOW_TRIGGER;
        self.set_bits(ROI_CTRL, bits, bits)
    }

    fn set_masks(&mut self, settings: &Settings) -> Result<(), DeviceError> {
        let of = |&(x, y): &(u16, u16)| {
            PIXEL_MASK_VALID | u32::from(sensor_row(settings.row_order, y, 1)) << 16 | u32::from(x)
        };
        let mut masks: Vec<u32> = settings.masked_pixels.iter().map(of).collect();
        masks.resize(PIXEL_MASKS, 0);
        self.put(PIXEL_MASK, &masks)
    }

    /// Writes registers from `address` on, as many messages as it takes.
    fn put(&mut self, address: u32, values: &[u32]) -> Result<(), DeviceError> {
        for (index, part) in values.chunks(WORDS_PER_WRITE).enumerate() {
            let address = address + (index * WORDS_PER_WRITE * 4) as u32;
            board::write(&mut self.transport, address, part)
                .map_err(|error| self.board_error(error, &format!("writing register {address:#06x}")))?;
        }
        Ok(())
    }

    fn get(&mut self, address: u32) -> Result<u32, DeviceError> {
        board::read(&mut self.transport, address)
            .map_err(|error| self.board_error(error, &format!("reading register {address:#06x}")))
    }

    fn set_bits(&mut self, address: u32, value: u32, mask: u32) -> Result<(), DeviceError> {
        board::write_bits(&mut self.transport, address, value, mask)
            .map_err(|error| self.board_error(error, &format!("writing register {address:#06x}")))
    }
}

/// The sensor's first row of `height` rows that begin at the picture's row `y`.
fn sensor_row(order: RowOrder, y: u16, height: u16) -> u16 {
    match order {
        RowOrder::TopDown => y,
        RowOrder::BottomUp => GEOMETRY.height - y - height,
    }
}

/// One bit for each of `lines` lines, set where the line is not among the `count` from `first` on.
fn off_lines(first: u16, count: u16, lines: u16) -> Vec<u32> {
    let mut words = vec![u32::MAX; usize::from(lines).div_ceil(32)];
    for line in first..first + count {
        if let Some(word) = words.get_mut(usize::from(line / 32)) {
            *word &= !(1 << (line % 32));
        }
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_the_window_are_on() {
        let words = off_lines(30, 4, 720);
        assert_eq!((words.len(), words[0], words[1], words[2]), (23, !(3 << 30), !3, u32::MAX));
        assert_eq!(off_lines(0, 1280, 1280), [0; 40]);
        assert_eq!(off_lines(0, 720, 720)[22] | ROWS_BEYOND, ROWS_BEYOND);
    }

    #[test]
    fn rows_may_count_from_below() {
        assert_eq!(sensor_row(RowOrder::TopDown, 10, 5), 10);
        assert_eq!(sensor_row(RowOrder::BottomUp, 10, 5), 705);
        assert_eq!(sensor_row(RowOrder::BottomUp, 0, 720), 0);
    }
}
