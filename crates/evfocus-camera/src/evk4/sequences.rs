//! The sensor's sequences, as OpenEB's IMX636 driver has them (`imx636_evk3_issd.h`). Most registers are reserved and have no name.
//!
//! OpenEB opens with stop, destroy, init; then start and stop as often as wanted; then destroy.

use std::time::Duration;

/// A step of a sequence.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Step {
    /// Write a register.
    Write(u32, u32),
    /// Write the bits of the mask (the last number), keep the others.
    WriteBits(u32, u32, u32),
    /// Wait.
    Wait(Duration),
}

const fn wait_us(micros: u64) -> Step {
    Step::Wait(Duration::from_micros(micros))
}

use Step::{Write, WriteBits};

/// Stops the stream: pixels held in reset, output off, time base off.
#[rustfmt::skip]
pub(super) const STOP: [Step; 7] = [
    WriteBits(0x0000_0004, 0xF000_5042, 0x0000_0400), // roi_ctrl
    Write(0x0000_002C, 0x0022_C324),
    Write(0x0000_9028, 0x0000_0002), // ro/ro_ctrl
    wait_us(1_000),
    WriteBits(0x0000_9008, 0x0000_0644, 0x0000_0001), // ro/time_base_ctrl
    Write(0x0000_B000, 0x0000_02F8), // mipi_csi/mipi_control
    wait_us(300),
];

/// Switches the sensor off.
#[rustfmt::skip]
pub(super) const DESTROY: [Step; 27] = [
    Write(0x0000_0070, 0x0040_0008),
    Write(0x0000_006C, 0x0EE4_7114),
    wait_us(500),
    Write(0x0000_A00C, 0x0002_0400),
    wait_us(500),
    Write(0x0000_A010, 0x0000_8068),
    wait_us(200),
    Write(0x0000_1104, 0x0000_0000),
    wait_us(200),
    Write(0x0000_A020, 0x0000_0050),
    wait_us(200),
    Write(0x0000_A004, 0x000B_0500),
    wait_us(200),
    Write(0x0000_A008, 0x0000_2404),
    wait_us(200),
    Write(0x0000_A000, 0x000B_0500),
    Write(0x0000_B044, 0x0000_0000),
    Write(0x0000_B004, 0x0000_000A),
    Write(0x0000_B040, 0x0000_000E),
    Write(0x0000_B0C8, 0x0000_0000),
    Write(0x0000_B040, 0x0000_0006),
    Write(0x0000_B040, 0x0000_0004),
    Write(0x0000_0000, 0x4F00_6442),
    Write(0x0000_0000, 0x0F00_6442),
    Write(0x0000_00B8, 0x0000_0401),
    Write(0x0000_00B8, 0x0000_0400),
    Write(0x0000_B07C, 0x0000_0000),
];

/// Switches the sensor on and readies it. Takes 2.5 s, most of it for resets.
#[rustfmt::skip]
pub(super) const INIT: [Step; 81] = [
    Write(0x0000_001C, 0x0000_0001),
    wait_us(1_000_000),
    Write(0x0040_0004, 0x0000_0001),
    wait_us(500_000),
    Write(0x0040_0004, 0x0000_0000),
    wait_us(1_000_000),
    Write(0x0000_B000, 0x0000_0158), // mipi_csi/mipi_control
    wait_us(300),
    Write(0x0000_B044, 0x0000_0000),
    Write(0x0000_B004, 0x0000_000A),
    Write(0x0000_B040, 0x0000_0000),
    Write(0x0000_B0C8, 0x0000_0000),
    Write(0x0000_B040, 0x0000_0000),
    Write(0x0000_B040, 0x0000_0000),
    Write(0x0000_0000, 0x4F00_6442),
    Write(0x0000_0000, 0x0F00_6442),
    Write(0x0000_00B8, 0x0000_0400),
    Write(0x0000_00B8, 0x0000_0400),
    Write(0x0000_B07C, 0x0000_0000),
    Write(0x0000_B074, 0x0000_0002),
    Write(0x0000_B078, 0x0000_00A0),
    Write(0x0000_00C0, 0x0000_0110),
    Write(0x0000_00C0, 0x0000_0210),
    Write(0x0000_B120, 0x0000_0001),
    Write(0x0000_E120, 0x0000_0000),
    Write(0x0000_B068, 0x0000_0004),
    Write(0x0000_B07C, 0x0000_0001),
    wait_us(10),
    Write(0x0000_B07C, 0x0000_0003),
    wait_us(1_000),
    Write(0x0000_00B8, 0x0000_0401),
    Write(0x0000_00B8, 0x0000_0409),
    Write(0x0000_0000, 0x4F00_6442),
    Write(0x0000_0000, 0x4F00_644A),
    Write(0x0000_B080, 0x0000_0077),
    Write(0x0000_B084, 0x0000_000F),
    Write(0x0000_B088, 0x0000_0037),
    Write(0x0000_B08C, 0x0000_0037),
    Write(0x0000_B090, 0x0000_00DF),
    Write(0x0000_B094, 0x0000_0057),
    Write(0x0000_B098, 0x0000_0037),
    Write(0x0000_B09C, 0x0000_0067),
    Write(0x0000_B0A0, 0x0000_0037),
    Write(0x0000_B0A4, 0x0000_002F),
    Write(0x0000_B0AC, 0x0000_0028),
    Write(0x0000_B0CC, 0x0000_0001),
    Write(0x0000_B000, 0x0000_02F8), // mipi_csi/mipi_control
    Write(0x0000_B004, 0x0000_008A),
    Write(0x0000_B01C, 0x0000_0030),
    Write(0x0000_B020, 0x0000_2000), // mipi_csi/mipi_packet_size
    Write(0x0000_B02C, 0x0000_00FF), // mipi_csi/mipi_line_blanking
    Write(0x0000_B030, 0x0000_3E80), // mipi_csi/mipi_frame_blanking
    Write(0x0000_B028, 0x0000_0FA0), // mipi_csi/mipi_frame_period
    Write(0x0000_A000, 0x000B_0501),
    wait_us(200),
    Write(0x0000_A008, 0x0000_2405),
    wait_us(200),
    Write(0x0000_A004, 0x000B_0501),
    wait_us(200),
    Write(0x0000_A020, 0x0000_0150),
    wait_us(200),
    Write(0x0000_B040, 0x0000_0007),
    Write(0x0000_B064, 0x0000_0006),
    Write(0x0000_B040, 0x0000_000F),
    wait_us(100),
    Write(0x0000_B004, 0x0000_008A),
    wait_us(200),
    Write(0x0000_B0C8, 0x0000_0003),
    wait_us(200),
    Write(0x0000_B044, 0x0000_0001),
    Write(0x0000_B000, 0x0000_02F9), // mipi_csi/mipi_control
    Write(0x0000_7008, 0x0000_0001),
    Write(0x0000_7000, 0x0007_0001), // edf/pipeline_control
    Write(0x0000_8000, 0x0001_E085),
    Write(0x0000_9008, 0x0000_0644), // ro/time_base_ctrl
    Write(0x0000_0004, 0xF000_5042), // roi_ctrl
    Write(0x0000_0018, 0x0000_0200), // spare0
    Write(0x0000_1014, 0x11A1_504D), // bias/bias_diff
    Write(0x0000_9004, 0x0000_0000), // ro/ro_fsm_ctrl
    wait_us(1_000),
    Write(0x0000_9000, 0x0000_0200), // ro/readout_ctrl
];

/// Starts the stream: link, output, time base, and the pixels last.
#[rustfmt::skip]
pub(super) const START: [Step; 5] = [
    Write(0x0000_B000, 0x0000_02F9), // mipi_csi/mipi_control
    Write(0x0000_9028, 0x0000_0000), // ro/ro_ctrl
    WriteBits(0x0000_9008, 0x0000_0645, 0x0000_0001), // ro/time_base_ctrl
    Write(0x0000_002C, 0x0022_C724),
    WriteBits(0x0000_0004, 0xF000_5442, 0x0000_0400), // roi_ctrl
];
