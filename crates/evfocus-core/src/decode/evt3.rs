//! EVT 3.0: 16-bit words, little-endian, the type in bits 15 to 12 (Prophesee, "EVT 3.0 Format"; rules for time and for
//! damaged streams as in OpenEB's decoder, `hal/cpp/include/metavision/hal/decoders/evt3`).

mod counter;
mod time;

pub use counter::Evt3Counter;

use alloc::vec::Vec;

use super::TimeRule;
use super::framing::Framing;
use crate::damage::Damage;
use crate::event::{Event, EventBatch, Geometry, Polarity};
use crate::units::CameraMicros;
use time::Evt3Time;

/// The type of a word, bits 15 to 12.
pub mod word_type {
    /// Row of the events that follow, bits 10 to 0.
    pub const ADDR_Y: u16 = 0x0;
    /// One event: column in bits 10 to 0, polarity in bit 11.
    pub const ADDR_X: u16 = 0x2;
    /// Column and polarity of the vectors that follow.
    pub const VECT_BASE_X: u16 = 0x3;
    /// Twelve pixels from the base on, one bit each.
    pub const VECT_12: u16 = 0x4;
    /// Eight pixels from the base on, one bit each.
    pub const VECT_8: u16 = 0x5;
    /// Time bits 11 to 0.
    pub const TIME_LOW: u16 = 0x6;
    /// Four more bits of the word before.
    pub const CONTINUED_4: u16 = 0x7;
    /// Time bits 23 to 12.
    pub const TIME_HIGH: u16 = 0x8;
    /// Edge at an external input: value in bit 0, channel in bits 11 to 8.
    pub const EXT_TRIGGER: u16 = 0xA;
    /// Statistics and other words without events.
    pub const OTHERS: u16 = 0xE;
    /// Twelve more bits of the word before.
    pub const CONTINUED_12: u16 = 0xF;
}

/// Bits 10 to 0: a row or column.
const ADDRESS_MASK: u16 = 0x7FF;
/// Bit 11 of a column word: brighter.
pub const POLARITY_BIT: u16 = 0x800;
/// Bits 11 to 0: the payload of most words.
const PAYLOAD_MASK: u16 = 0xFFF;
/// Microseconds until the 24 bits of time wrap.
pub const TIME_PERIOD_US: i64 = 1 << 24;

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
    time: Evt3Time,
    /// Row of the events that follow.
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

    /// A decoder for a recording from a sensor of this size: time as sent.
    pub fn new(geometry: Geometry) -> Self {
        Self::with_origin(geometry, CameraMicros(0))
    }

    /// A decoder for a live camera with a sensor of this size: time never goes back.
    pub fn live(geometry: Geometry) -> Self {
        Self::with_time(geometry, Evt3Time::new(TimeRule::Ascending, 0))
    }

    /// As [`new`](Self::new), with `origin` added to all times.
    pub fn with_origin(geometry: Geometry, origin: CameraMicros) -> Self {
        Self::with_time(geometry, Evt3Time::new(TimeRule::AsSent, origin.0))
    }

    fn with_time(geometry: Geometry, time: Evt3Time) -> Self {
        let state = State {
            geometry,
            time,
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
        batch.reached = state.time.now().map(CameraMicros).or(batch.reached);
    }

    /// Says that the stream has ended, so that a partial word counts as damage.
    pub fn finish(&mut self) {
        self.state.damage.trailing_bytes += self.framing.finish();
    }

    /// What was found wrong so far.
    pub fn damage(&self) -> Damage {
        let time = &self.state.time;
        Damage { time_jumps: time.jumps, timestamp_resets: time.restarts, ..self.state.damage }
    }

    /// Edges at the external inputs so far.
    pub fn triggers(&self) -> u64 {
        self.state.triggers
    }
}

impl State {
    fn word(&mut self, word: u16, events: &mut Vec<Event>) {
        match word >> 12 {
            word_type::ADDR_X => self.single(word, events),
            word_type::TIME_LOW => self.time.low(word & PAYLOAD_MASK),
            word_type::ADDR_Y => self.row(word & ADDRESS_MASK),
            word_type::TIME_HIGH => self.time.high(word & PAYLOAD_MASK),
            word_type::VECT_BASE_X => {
                self.base = Some(word & ADDRESS_MASK);
                self.polarity = Polarity::from_on(word & POLARITY_BIT != 0);
            }
            word_type::VECT_12 => self.vector(word & PAYLOAD_MASK, 12, events),
            word_type::VECT_8 => self.vector(word & 0xFF, 8, events),
            word_type::EXT_TRIGGER => self.triggers += u64::from(self.time.now().is_some()),
            word_type::CONTINUED_4 | word_type::OTHERS | word_type::CONTINUED_12 => {}
            _ => self.damage.unknown_words += 1,
        }
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
            let events = u64::from(valid.count_ones());
            match self.time.now() {
                Some(_) => self.damage.events_before_address += events,
                None => self.damage.events_before_time += events,
            }
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
        match (self.time.now(), self.row) {
            (Some(t), Row::At(y)) if x < self.geometry.width => {
                events.push(Event { t: CameraMicros(t), x, y, polarity });
            }
            (None, _) => self.damage.events_before_time += 1,
            (Some(_), Row::None) => self.damage.events_before_address += 1,
            (Some(_), Row::At(_) | Row::OutsideSensor) => self.damage.outside_sensor += 1,
        }
    }
}
