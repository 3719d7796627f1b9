//! Setting the camera up, starting and stopping it.

use std::ops::RangeInclusive;
use std::time::Duration;

use evfocus_core::Window;
use evfocus_hal::usb::UsbTransport;
use evfocus_hal::{DeviceError, DeviceErrorKind};

use super::registers::{CHIP_MODULE, Parameter, aps, dvs, external, imu, mux, system, usb};
use super::settings::{FILTER_UNIT, PixelFilterAxes, Settings, TriggerInput};
use super::{DATA_ENDPOINT, Davis346, GEOMETRY, PIXEL_FILTERS};
use crate::error::{transfer_error, wrong_version};

/// The logic that this driver was written for, and the first of its patches.
const LOGIC_VERSION: u32 = 18;
const LOGIC_PATCH: u32 = 1;
/// Chips of the DAVIS346 family: A, B, C.
const CHIPS: [u32; 3] = [4, 5, 9];
/// Bit of the orientation that says that the chip's columns are the picture's rows.
const AXES_EXCHANGED: u32 = 1 << 2;

/// The logic's buffers run empty.
const DRAIN: Duration = Duration::from_millis(100);
/// Before the chip gets power.
const BEFORE_POWER: Duration = Duration::from_millis(10);
/// The biases settle.
const SETTLE: Duration = Duration::from_millis(200);
/// Between the link's start and the pixels'.
const BEFORE_PIXELS: Duration = Duration::from_millis(50);
/// Clocks that boards have or might have, and by how many per mille they might be off.
const CLOCKS_MHZ: RangeInclusive<u32> = 1..=1000;
const CLOCK_DEVIATIONS: RangeInclusive<u32> = 500..=2000;
/// Shortest pulse at the external input, microseconds.
const PULSE_US: u64 = 10;

/// Everything that runs, in the order in which it is stopped.
const RUNNING: [Parameter; 10] = [
    dvs::RUN,
    aps::RUN,
    imu::RUN_ACCELEROMETER,
    imu::RUN_GYROSCOPE,
    imu::RUN_TEMPERATURE,
    external::RUN_DETECTOR,
    mux::RUN,
    mux::TIMESTAMP_RUN,
    usb::RUN,
    mux::RUN_CHIP,
];

/// `duration` in units of 250 us, as the filters count.
fn filter_units(duration: Duration) -> u32 {
    (duration.as_micros() / FILTER_UNIT.as_micros()) as u32
}

impl<T: UsbTransport> Davis346<T> {
    /// From an unknown state to one in which [`run`](Self::run) starts the stream.
    pub(super) fn set_up(&mut self, settings: &Settings) -> Result<(), DeviceError> {
        self.check_logic()?;
        let deviation = self.get_within(system::CLOCK_DEVIATION, CLOCK_DEVIATIONS)?;
        let logic_mhz = self.get_within(system::LOGIC_CLOCK, CLOCKS_MHZ)?;
        let usb_mhz = self.get_within(system::USB_CLOCK, CLOCKS_MHZ)?;
        self.check_sensor()?;
        let cycles = |mhz: u64, micros: u64| ((micros * mhz * deviation + 500) / 1000) as u32;
        self.quiet()?;
        if self.get(external::HAS_GENERATOR)? != 0 {
            self.set(external::RUN_GENERATOR, 0)?;
        }
        self.wait(DRAIN);
        self.transport
            .clear_halt(DATA_ENDPOINT)
            .map_err(|error| transfer_error(error, &self.name, "clearing the data endpoint"))?;
        for (address, word) in super::biases::words(&settings.biases) {
            self.set(Parameter { module: CHIP_MODULE, address }, u32::from(word))?;
        }
        self.set_filters(settings)?;
        self.set(mux::TIMESTAMP_RESET, 0)?;
        self.set(mux::DROP_EXTERNAL_ON_STALL, 1)?;
        self.set(mux::DROP_DVS_ON_STALL, 1)?;
        self.set(dvs::WAIT_ON_STALL, 0)?;
        self.set(dvs::EXTERNAL_AER, 0)?;
        self.set_trigger(settings.trigger_input, cycles(logic_mhz, PULSE_US))?;
        let delay_us = settings.packet_delay.as_micros() as u64;
        self.set(usb::EARLY_PACKET_DELAY, cycles(usb_mhz, delay_us))
    }

    fn check_logic(&mut self) -> Result<(), DeviceError> {
        let (version, patch) = (self.get(system::LOGIC_VERSION)?, self.get(system::LOGIC_PATCH)?);
        if version == LOGIC_VERSION && patch >= LOGIC_PATCH {
            return Ok(());
        }
        let (found, needed) = (format!("{version}.{patch}"), format!("{LOGIC_VERSION}.{LOGIC_PATCH}"));
        Err(wrong_version(&self.name, "logic", &found, &needed, "change it with the maker's flashing tool"))
    }

    /// A number that the logic tells of itself, which cycles are counted from.
    fn get_within(&mut self, parameter: Parameter, sane: RangeInclusive<u32>) -> Result<u64, DeviceError> {
        let value = self.get(parameter)?;
        if sane.contains(&value) {
            return Ok(u64::from(value));
        }
        let (Parameter { module, address }, (low, high)) = (parameter, (sane.start(), sane.end()));
        let what =
            format!("parameter {address} of module {module} is {value}; it must be from {low} to {high}");
        Err(self.error(DeviceErrorKind::Protocol, what))
    }

    fn check_sensor(&mut self) -> Result<(), DeviceError> {
        let chip = self.get(system::CHIP)?;
        let (columns, rows) = (self.get(dvs::COLUMNS)?, self.get(dvs::ROWS)?);
        let exchanged = self.get(dvs::ORIENTATION)? & AXES_EXCHANGED != 0;
        let size = (columns, rows, exchanged);
        if CHIPS.contains(&chip) && size == (u32::from(GEOMETRY.height), u32::from(GEOMETRY.width), true) {
            return Ok(());
        }
        let what = format!(
            "its chip is number {chip} with {columns} columns and {rows} rows; a DAVIS346 is number 4, 5 or 9 with 260 and 346, \
             axes exchanged"
        );
        Err(self.error(DeviceErrorKind::Protocol, what))
    }

    fn set_filters(&mut self, settings: &Settings) -> Result<(), DeviceError> {
        if self.get(dvs::HAS_PIXEL_FILTER)? != 0 {
            self.mask_pixels(settings)?;
        } else if !settings.masked_pixels.is_empty() {
            return Err(self.lacks("pixel filter", "masked_pixels"));
        }
        if self.get(dvs::HAS_ACTIVITY_FILTER)? != 0 {
            // A time that means something even if another program switches the filter on.
            let default = Duration::from_millis(2);
            self.set(dvs::ACTIVITY_FILTER, u32::from(settings.activity_filter.is_some()))?;
            let time = settings.activity_filter.unwrap_or(default);
            self.set(dvs::ACTIVITY_FILTER_TIME, filter_units(time))?;
            self.set(dvs::REFRACTORY_FILTER, u32::from(settings.refractory_filter.is_some()))?;
            let time = settings.refractory_filter.unwrap_or(FILTER_UNIT);
            self.set(dvs::REFRACTORY_FILTER_TIME, filter_units(time))?;
        } else if settings.activity_filter.or(settings.refractory_filter).is_some() {
            return Err(self.lacks("activity and refractory filter", "activity_filter and refractory_filter"));
        }
        if self.get(dvs::HAS_ROI_FILTER)? != 0 {
            let Window { x, y, width, height } = settings.roi.unwrap_or(Window::whole(GEOMETRY));
            self.set(dvs::ROI_START_COLUMN, u32::from(x))?;
            self.set(dvs::ROI_START_ROW, u32::from(y))?;
            // Ends are part of the window.
            self.set(dvs::ROI_END_COLUMN, u32::from(x + width - 1))?;
            self.set(dvs::ROI_END_ROW, u32::from(y + height - 1))?;
        } else if settings.roi.is_some() {
            return Err(self.lacks("window", "roi"));
        }
        if self.get(dvs::HAS_SKIP_FILTER)? != 0 {
            self.set(dvs::SKIP_FILTER, 0)?;
            self.set(dvs::SKIP_EVERY, 0)?;
        }
        if self.get(dvs::HAS_POLARITY_FILTER)? != 0 {
            self.set(dvs::POLARITY_FLATTEN, 0)?;
            self.set(dvs::POLARITY_SUPPRESS, 0)?;
            self.set(dvs::POLARITY_SUPPRESS_TYPE, 0)?;
        }
        Ok(())
    }

    fn lacks(&self, filter: &str, key: &str) -> DeviceError {
        let what = format!("its logic has no {filter}; take {key} out of the configuration");
        self.error(DeviceErrorKind::OutOfRange, what)
    }

    fn mask_pixels(&mut self, settings: &Settings) -> Result<(), DeviceError> {
        // A place that no pixel has switches a filter off.
        let nowhere = (GEOMETRY.width, GEOMETRY.height);
        for index in 0..PIXEL_FILTERS {
            let (x, y) = settings.masked_pixels.get(index).copied().unwrap_or(nowhere);
            let (row, column) = match settings.pixel_filter_axes {
                PixelFilterAxes::Picture => (y, x),
                PixelFilterAxes::Chip => (x, y),
            };
            let address = dvs::PIXEL_FILTER_0_ROW.address + 2 * index as u8;
            let of = |address| Parameter { address, ..dvs::PIXEL_FILTER_0_ROW };
            self.set(of(address), u32::from(row))?;
            self.set(of(address + 1), u32::from(column))?;
        }
        Ok(())
    }

    fn set_trigger(&mut self, input: TriggerInput, pulse_cycles: u32) -> Result<(), DeviceError> {
        self.set(external::DETECT_RISING, u32::from(input == TriggerInput::Rising))?;
        self.set(external::DETECT_FALLING, u32::from(input == TriggerInput::Falling))?;
        self.set(external::DETECT_PULSES, u32::from(input == TriggerInput::Pulse))?;
        self.set(external::PULSE_POLARITY, 1)?;
        self.set(external::PULSE_LENGTH, pulse_cycles)
    }

    /// Starts the stream; its transfers must be queued.
    pub(super) fn run(&mut self) -> Result<(), DeviceError> {
        self.wait(BEFORE_POWER);
        self.set(mux::RUN_CHIP, 1)?;
        self.wait(SETTLE);
        self.set(usb::RUN, 1)?;
        self.set(mux::TIMESTAMP_RUN, 1)?;
        self.set(mux::RUN, 1)?;
        self.wait(BEFORE_PIXELS);
        self.set(dvs::RUN, 1)?;
        self.set(external::RUN_DETECTOR, u32::from(self.trigger_input != TriggerInput::Off))
    }

    /// Stops everything that runs.
    fn quiet(&mut self) -> Result<(), DeviceError> {
        RUNNING.into_iter().try_for_each(|parameter| self.set(parameter, 0))
    }

    /// Stops everything, then takes the transfers back.
    pub(super) fn halt(&mut self) -> Result<(), DeviceError> {
        let quiet = self.quiet();
        let cancelled = self.transport.stop_stream();
        quiet?;
        cancelled.map_err(|error| transfer_error(error, &self.name, "taking the transfers back"))
    }
}
