//! The registers of the IMX636 that this driver names (OpenEB, `imx636_registermap.h`); the sequences have many more.

/// Region of interest and pixel reset.
pub(super) const ROI_CTRL: u32 = 0x0004;
/// The sensor's number.
pub(super) const CHIP_ID: u32 = 0x0014;
/// What [`CHIP_ID`] reads on an IMX636.
pub(super) const CHIP_ID_IMX636: u32 = 0xA040_1806;
/// Must read zero in its two low bits on an IMX636.
pub(super) const CHIP_VARIANT: u32 = 0xF128;
/// Mask of [`CHIP_VARIANT`].
pub(super) const CHIP_VARIANT_MASK: u32 = 3;

/// Bits of [`ROI_CTRL`].
pub(super) mod roi_ctrl {
    /// The lines' registers count.
    pub(crate) const ENABLE: u32 = 1 << 1;
    /// Takes the lines' registers over.
    pub(crate) const SHADOW_TRIGGER: u32 = 1 << 5;
    /// A pixel is off if its column or its row is.
    pub(crate) const EITHER_LINE: u32 = 1 << 6;
}

/// Forty words, one bit a column; 0: the column is used.
pub(super) const ROI_COLUMNS: u32 = 0x2000;
/// Twenty-three words, one bit a row; 0: the row is used.
pub(super) const ROI_ROWS: u32 = 0x4000;

/// A bias's word is this with the value in the low byte.
pub(super) const BIAS_WORD: u32 = 0x11A1_0000;

/// The event-rate controller, 0x6000 to 0x6FFF.
pub(super) mod erc {
    /// Bits 1 and 0: 0 while it is being configured, 1 afterwards.
    pub(crate) const CONTROL: u32 = 0x6000;
    pub(crate) const CONTROL_MASK: u32 = 3;
    pub(crate) const CONFIGURED: u32 = 1;
    /// Bit 0: the queue in which events wait.
    pub(crate) const IN_DROP_RATE_CONTROL: u32 = 0x6004;
    /// Microseconds, 10 bits.
    pub(crate) const REFERENCE_PERIOD: u32 = 0x6008;
    /// Events in a period, 22 bits.
    pub(crate) const TARGET_EVENT_RATE: u32 = 0x600C;
    /// Bits 2 to 0.
    pub(crate) const ENABLE: u32 = 0x6028;
    pub(crate) const ENABLE_MASK: u32 = 7;
    pub(crate) const ENABLED: u32 = 3;
    /// 1 while the first table is written.
    pub(crate) const TABLE_ACCESS: u32 = 0x602C;
    /// Bit 0 each: dropping by time, columns, rows.
    pub(crate) const TIME_DROPPING: u32 = 0x6050;
    pub(crate) const COLUMN_DROPPING: u32 = 0x6060;
    pub(crate) const ROW_DROPPING: u32 = 0x6070;
    /// A table of 256 words: twice their index, and one more in the high half.
    pub(crate) const DROP_TABLE: u32 = 0x6400;
    pub(crate) const DROP_TABLE_WORDS: u32 = 256;
    /// A table of 230 equal words.
    pub(crate) const WEIGHT_TABLE: u32 = 0x6800;
    pub(crate) const WEIGHT_TABLE_WORDS: usize = 230;
    pub(crate) const WEIGHT: u32 = 0x0808_0808;
}

/// Bit 10: edges at the trigger input are put into the stream.
pub(super) const TRIGGER_CONTROL: u32 = 0x7004;
/// See [`TRIGGER_CONTROL`].
pub(super) const TRIGGER_ENABLE: u32 = 1 << 10;
/// Bit 1: 0 for EVT 3.0.
pub(super) const PIPELINE_CONTROL: u32 = 0x7000;
/// See [`PIPELINE_CONTROL`].
pub(super) const PIPELINE_EVT21: u32 = 1 << 1;

/// Sixty-four registers: a pixel that sends no events each.
pub(super) const PIXEL_MASK: u32 = 0x9100;
/// The mask is in use.
pub(super) const PIXEL_MASK_VALID: u32 = 1 << 31;

/// The anti-flicker filter, AFK.
pub(crate) mod afk {
    /// [`BYPASSED`] while it is set up.
    pub(crate) const CONTROL: u32 = 0xC000;
    /// It passes everything on.
    pub(crate) const BYPASSED: u32 = 0b101;
    /// It drops events that flicker.
    pub(crate) const DROPPING: u32 = 0b001;
    /// Bit 6: it drops all others instead.
    pub(crate) const PARAM: u32 = 0xC004;
    /// See [`PARAM`].
    pub(crate) const INVERT: u32 = 1 << 6;
    /// Bits 7 to 0: shortest period that is taken for flicker, bits 15 to 8: longest, both in 128 us; bits 19 to 16: 16 times the part of
    /// the period that is dark.
    pub(crate) const FILTER_PERIOD: u32 = 0xC008;
    /// Half of the period.
    pub(crate) const HALF_DARK: u32 = 8 << 16;
    /// Bits 11 to 0: how long to wait before old periods are forgotten.
    pub(crate) const INVALIDATION: u32 = 0xC0C0;
    /// See [`INVALIDATION`].
    pub(crate) const WAIT_TIME_MASK: u32 = 0xFFF;
    /// What OpenEB waits.
    pub(crate) const WAIT_TIME: u32 = 1630;
    /// Bit 2: its memory is ready.
    pub(crate) const INITIALIZATION: u32 = 0xC0C4;
    /// See [`INITIALIZATION`].
    pub(crate) const READY: u32 = 1 << 2;
}
/// The noise filters (trail, and contrast in space and time).
pub(super) const STC_CONTROL: u32 = 0xD000;
/// They pass everything on.
pub(super) const STC_BYPASS: u32 = 1 << 2;
