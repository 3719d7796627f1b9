//! EVT 3.0: 16-bit words, little-endian, the type in bits 15 to 12 (Prophesee, "EVT 3.0 Format"; rules for time and for
//! damaged streams as in OpenEB's decoder, `hal/cpp/include/metavision/hal/decoders/evt3`).

use evfocus_core::{CameraMicros, Event, EventBatch, Geometry, Polarity};

use super::framing::Framing;
use crate::Damage;

/// The type of a word, bits 15 to 12.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum WordType {
    /// Row of the events that follow, bits 10 to 0.
    AddrY,
    /// One event: column in bits 10 to 0, polarity in bit 11.
    AddrX,
    /// Column and polarity of the vectors that follow.
    VectBaseX,
    /// Twelve pixels from the base on, one bit each.
    Vect12,
    /// Eight pixels from the base on, one bit each.
    Vect8,
    /// Time bits 11 to 0.
    TimeLow,
    /// Time bits 23 to 12.
    TimeHigh,
    /// Edge at an external input.
    ExtTrigger,
    /// Four, or twelve, more bits of the word before; statistics and other words without events.
    NoEvents,
    /// Not defined.
    Unknown,
}

impl WordType {
    pub(crate) const ADDR_Y: u16 = 0x0;
    pub(crate) const ADDR_X: u16 = 0x2;
    pub(crate) const VECT_BASE_X: u16 = 0x3;
    pub(crate) const VECT_12: u16 = 0x4;
    pub(crate) const VECT_8: u16 = 0x5;
    pub(crate) const TIME_LOW: u16 = 0x6;
    const CONTINUED_4: u16 = 0x7;
    pub(crate) const TIME_HIGH: u16 = 0x8;
    const EXT_TRIGGER: u16 = 0xA;
    const OTHERS: u16 = 0xE;
    const CONTINUED_12: u16 = 0xF;

    fn of(word: u16) -> Self {
        match word >> 12 {
            Self::ADDR_Y => Self::AddrY,
            Self::ADDR_X => Self::AddrX,
            Self::VECT_BASE_X => Self::VectBaseX,
            Self::VECT_12 => Self::Vect12,
            Self::VECT_8 => Self::Vect8,
            Self::TIME_LOW => Self::TimeLow,
            Self::TIME_HIGH => Self::TimeHigh,
            Self::EXT_TRIGGER => Self::ExtTrigger,
            Self::CONTINUED_4 | Self::OTHERS | Self::CONTINUED_12 => Self::NoEvents,
            _ => Self::Unknown,
        }
    }
}

/// Bits 10 to 0: a row or column.
const ADDRESS_MASK: u16 = 0x7FF;
/// Bit 11 of a column word: brighter.
pub(crate) const POLARITY_BIT: u16 = 0x800;
/// Bits 11 to 0: the payload of most words.
const PAYLOAD_MASK: u16 = 0xFFF;
/// Microseconds until the 24 bits of time wrap.
pub(crate) const TIME_PERIOD_US: i64 = 1 << 24;
/// A coarse time that falls by at least half its period has wrapped; by less, it has gone back (OpenEB's rule).
const WRAP_THRESHOLD: i32 = 2048;

/// Decodes EVT 3.0 words into events.
///
/// Decoding starts at the first TIME_HIGH. Events before a row or a vector base are dropped; so are events in rows or
/// columns that the sensor does not have. All that is dropped is counted.
#[derive(Debug, Clone)]
pub struct Evt3Decoder {
    framing: Framing<2>,
    state: State,
}

#[derive(Debug, Clone)]
struct State {
    geometry: Geometry,
    /// Time of the last time word, `None` before the first TIME_HIGH.
    time: Option<i64>,
    /// Added to the camera's 24 bits: the origin, and a period for each wrap.
    period_start: i64,
    high: u16,
    /// Row of the events that follow, `None` before the first and after one that the sensor does not have.
    row: Row,
    /// Column of the next vector's first pixel.
    base: Option<u16>,
    polarity: Polarity,
    triggers: u64,
    damage: Damage,
}

#[derive(Debug, Clone, Copy)]
enum Row {
    None,
    At(u16),
    OutsideSensor,
}

impl Evt3Decoder {
    /// The most events that a byte can hold: a vector of twelve in a word of two bytes.
    pub const MAX_EVENTS_PER_BYTE: usize = 6;
    /// What the format can address: 11 bits each way. For streams whose sensor is unknown.
    pub const MAX_GEOMETRY: Geometry = Geometry { width: 2048, height: 2048 };

    /// A decoder for a sensor of this size.
    pub fn new(geometry: Geometry) -> Self {
        Self::with_origin(geometry, CameraMicros(0))
    }

    /// As [`new`](Self::new), with `origin` added to all times.
    pub fn with_origin(geometry: Geometry, origin: CameraMicros) -> Self {
        let state = State {
            geometry,
            time: None,
            period_start: origin.0,
            high: 0,
            row: Row::None,
            base: None,
            polarity: Polarity::Off,
            triggers: 0,
            damage: Damage::default(),
        };
        Self { framing: Framing::new(), state }
    }

    /// Appends the events in `bytes` to the batch, in the order of the stream, and sets [`EventBatch::reached`]. Events
    /// dropped for their address are added to [`EventBatch::lost`]. At most [`MAX_EVENTS_PER_BYTE`](Self::MAX_EVENTS_PER_BYTE)
    /// events per byte are appended.
    pub fn decode(&mut self, bytes: &[u8], batch: &mut EventBatch) {
        let state = &mut self.state;
        let dropped = state.damage.events_before_address + state.damage.outside_sensor;
        self.framing.feed(bytes, |word| state.word(u16::from_le_bytes(word), &mut batch.events));
        batch.lost += state.damage.events_before_address + state.damage.outside_sensor - dropped;
        batch.reached = state.time.map(CameraMicros).or(batch.reached);
    }

    /// Says that the stream has ended, so that a partial word counts as damage.
    pub fn finish(&mut self) {
        self.state.damage.trailing_bytes += self.framing.finish();
    }

    /// What was found wrong so far.
    pub fn damage(&self) -> Damage {
        self.state.damage
    }

    /// Edges at the external inputs so far.
    pub fn triggers(&self) -> u64 {
        self.state.triggers
    }
}

impl State {
    fn word(&mut self, word: u16, events: &mut Vec<Event>) {
        match WordType::of(word) {
            WordType::AddrX => self.single(word, events),
            WordType::TimeLow => self.time_low(word & PAYLOAD_MASK),
            WordType::AddrY => self.row(word & ADDRESS_MASK),
            WordType::TimeHigh => self.time_high(word & PAYLOAD_MASK),
            WordType::VectBaseX => {
                self.base = Some(word & ADDRESS_MASK);
                self.polarity = Polarity::from_on(word & POLARITY_BIT != 0);
            }
            WordType::Vect12 => self.vector(word & PAYLOAD_MASK, 12, events),
            WordType::Vect8 => self.vector(word & 0xFF, 8, events),
            WordType::ExtTrigger => self.triggers += u64::from(self.time.is_some()),
            WordType::NoEvents => {}
            WordType::Unknown => self.damage.unknown_words += 1,
        }
    }

    fn time_low(&mut self, low: u16) {
        if self.time.is_some() {
            self.set_time(low);
        }
    }

    fn time_high(&mut self, high: u16) {
        if self.time.is_none() {
            self.high = high;
            self.set_time(0);
            return;
        }
        if high == self.high {
            // The camera repeats its coarse time every 16 us; the fine time stays.
            return;
        }
        let fall = i32::from(self.high) - i32::from(high);
        if fall >= WRAP_THRESHOLD {
            self.period_start = self.period_start.saturating_add(TIME_PERIOD_US);
        }
        if high != (self.high + 1) & PAYLOAD_MASK {
            self.damage.time_jumps += 1;
        }
        self.high = high;
        self.set_time(0);
    }

    fn set_time(&mut self, low: u16) {
        self.time = Some(self.period_start.saturating_add(i64::from(self.high) << 12 | i64::from(low)));
    }

    fn row(&mut self, y: u16) {
        self.row = if y < self.geometry.height { Row::At(y) } else { Row::OutsideSensor };
    }

    fn single(&mut self, word: u16, events: &mut Vec<Event>) {
        let polarity = Polarity::from_on(word & POLARITY_BIT != 0);
        self.emit(word & ADDRESS_MASK, polarity, events);
    }

    fn vector(&mut self, mut valid: u16, pixels: u16, events: &mut Vec<Event>) {
        let Some(base) = self.base else {
            self.damage.events_before_address += u64::from(valid.count_ones());
            return;
        };
        while valid != 0 {
            let offset = valid.trailing_zeros() as u16;
            valid &= valid - 1;
            self.emit(base.saturating_add(offset), self.polarity, events);
        }
        // Saturates on streams that are not a camera's: columns that far out are dropped anyhow.
        self.base = Some(base.saturating_add(pixels));
    }

    #[inline]
    fn emit(&mut self, x: u16, polarity: Polarity, events: &mut Vec<Event>) {
        match (self.time, self.row) {
            (Some(t), Row::At(y)) if x < self.geometry.width => {
                events.push(Event { t: CameraMicros(t), x, y, polarity });
            }
            (None, _) => self.damage.events_before_time += 1,
            (Some(_), Row::None) => self.damage.events_before_address += 1,
            (Some(_), Row::At(_) | Row::OutsideSensor) => self.damage.outside_sensor += 1,
        }
    }
}
