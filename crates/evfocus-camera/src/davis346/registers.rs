//! The parameters of a DAVIS346's logic 18, by module. Names and numbers as in libcaer's `davis.h`.

/// Vendor request of the FX3's firmware that reads or writes one parameter: value is the module, index the parameter, data a
/// big-endian `u32`.
pub(super) const PARAMETER_REQUEST: u8 = 0xBF;

/// A parameter's place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Parameter {
    /// The module.
    pub(super) module: u8,
    /// The parameter within the module.
    pub(super) address: u8,
}

const fn parameter(module: u8, address: u8) -> Parameter {
    Parameter { module, address }
}

/// The multiplexer: time stamps and the merging of what the others send.
pub(super) mod mux {
    use super::{Parameter, parameter};
    pub(crate) const RUN: Parameter = parameter(0, 0);
    pub(crate) const TIMESTAMP_RUN: Parameter = parameter(0, 1);
    pub(crate) const TIMESTAMP_RESET: Parameter = parameter(0, 2);
    /// Power of the chip's bias generator.
    pub(crate) const RUN_CHIP: Parameter = parameter(0, 3);
    pub(crate) const DROP_EXTERNAL_ON_STALL: Parameter = parameter(0, 4);
    pub(crate) const DROP_DVS_ON_STALL: Parameter = parameter(0, 5);
    pub(crate) const HAS_STATISTICS: Parameter = parameter(0, 80);
    /// Events dropped because the host did not read, 64 bits, the high word first.
    pub(crate) const DVS_DROPPED: Parameter = parameter(0, 83);
}

/// The pixels that send events.
pub(super) mod dvs {
    use super::{Parameter, parameter};
    pub(crate) const COLUMNS: Parameter = parameter(1, 0);
    pub(crate) const ROWS: Parameter = parameter(1, 1);
    /// Bit 2: columns and rows of the chip are rows and columns of the picture.
    pub(crate) const ORIENTATION: Parameter = parameter(1, 2);
    pub(crate) const RUN: Parameter = parameter(1, 3);
    pub(crate) const WAIT_ON_STALL: Parameter = parameter(1, 4);
    pub(crate) const EXTERNAL_AER: Parameter = parameter(1, 5);
    pub(crate) const HAS_PIXEL_FILTER: Parameter = parameter(1, 10);
    /// Row of the first filtered pixel; its column and the seven others follow.
    pub(crate) const PIXEL_FILTER_0_ROW: Parameter = parameter(1, 11);
    pub(crate) const HAS_ACTIVITY_FILTER: Parameter = parameter(1, 30);
    pub(crate) const ACTIVITY_FILTER: Parameter = parameter(1, 31);
    /// In units of 250 us, 0 to 4095.
    pub(crate) const ACTIVITY_FILTER_TIME: Parameter = parameter(1, 32);
    pub(crate) const REFRACTORY_FILTER: Parameter = parameter(1, 33);
    /// In units of 250 us, 0 to 4095.
    pub(crate) const REFRACTORY_FILTER_TIME: Parameter = parameter(1, 34);
    pub(crate) const HAS_ROI_FILTER: Parameter = parameter(1, 40);
    pub(crate) const ROI_START_COLUMN: Parameter = parameter(1, 41);
    pub(crate) const ROI_START_ROW: Parameter = parameter(1, 42);
    pub(crate) const ROI_END_COLUMN: Parameter = parameter(1, 43);
    pub(crate) const ROI_END_ROW: Parameter = parameter(1, 44);
    pub(crate) const HAS_SKIP_FILTER: Parameter = parameter(1, 50);
    pub(crate) const SKIP_FILTER: Parameter = parameter(1, 51);
    pub(crate) const SKIP_EVERY: Parameter = parameter(1, 52);
    pub(crate) const HAS_POLARITY_FILTER: Parameter = parameter(1, 60);
    pub(crate) const POLARITY_FLATTEN: Parameter = parameter(1, 61);
    pub(crate) const POLARITY_SUPPRESS: Parameter = parameter(1, 62);
    pub(crate) const POLARITY_SUPPRESS_TYPE: Parameter = parameter(1, 63);
}

/// The frames; this driver leaves them off.
pub(super) mod aps {
    use super::{Parameter, parameter};
    pub(crate) const RUN: Parameter = parameter(2, 4);
}

/// The inertial unit; this driver leaves it off.
pub(super) mod imu {
    use super::{Parameter, parameter};
    pub(crate) const RUN_ACCELEROMETER: Parameter = parameter(3, 2);
    pub(crate) const RUN_GYROSCOPE: Parameter = parameter(3, 3);
    pub(crate) const RUN_TEMPERATURE: Parameter = parameter(3, 4);
}

/// The external input.
pub(super) mod external {
    use super::{Parameter, parameter};
    pub(crate) const RUN_DETECTOR: Parameter = parameter(4, 0);
    pub(crate) const DETECT_RISING: Parameter = parameter(4, 1);
    pub(crate) const DETECT_FALLING: Parameter = parameter(4, 2);
    pub(crate) const DETECT_PULSES: Parameter = parameter(4, 3);
    pub(crate) const PULSE_POLARITY: Parameter = parameter(4, 4);
    /// In cycles of the logic clock.
    pub(crate) const PULSE_LENGTH: Parameter = parameter(4, 5);
    pub(crate) const HAS_GENERATOR: Parameter = parameter(4, 10);
    pub(crate) const RUN_GENERATOR: Parameter = parameter(4, 11);
}

/// The module of biases and of the chip's configuration.
pub(super) const CHIP_MODULE: u8 = 5;

/// What the logic says of itself.
pub(super) mod system {
    use super::{Parameter, parameter};
    pub(crate) const LOGIC_VERSION: Parameter = parameter(6, 0);
    pub(crate) const CHIP: Parameter = parameter(6, 1);
    /// MHz.
    pub(crate) const LOGIC_CLOCK: Parameter = parameter(6, 3);
    /// MHz.
    pub(crate) const USB_CLOCK: Parameter = parameter(6, 5);
    /// By how much all clocks are off, per mille.
    pub(crate) const CLOCK_DEVIATION: Parameter = parameter(6, 6);
    pub(crate) const LOGIC_PATCH: Parameter = parameter(6, 7);
}

/// The link.
pub(super) mod usb {
    use super::{Parameter, parameter};
    pub(crate) const RUN: Parameter = parameter(9, 0);
    /// After how many cycles of the USB clock a packet that is not full is sent.
    pub(crate) const EARLY_PACKET_DELAY: Parameter = parameter(9, 1);
}
