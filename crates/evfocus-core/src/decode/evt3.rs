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
        self.framing.feed_slices(bytes, |words| state.words(words, &mut batch.events));
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
    fn words(&mut self, mut words: &[[u8; 2]], events: &mut Vec<Event>) {
        while let Some((&first, rest)) = words.split_first() {
            let word = u16::from_le_bytes(first);
            if word >> 12 != word_type::ADDR_X {
                self.word(word, events);
                words = rest;
                continue;
            }
            // Single events come in runs of one row and time, which are written without looking again.
            let is_single = |bytes: &&[u8; 2]| u16::from_le_bytes(**bytes) >> 12 == word_type::ADDR_X;
            let (singles, rest) = words.split_at(words.iter().take_while(is_single).count());
            self.singles(singles, events);
            words = rest;
        }
    }

    /// Any word but ADDR_X.
    fn word(&mut self, word: u16, events: &mut Vec<Event>) {
        match word >> 12 {
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

    fn singles(&mut self, words: &[[u8; 2]], events: &mut Vec<Event>) {
        let (Some(t), Row::At(y)) = (self.time.now(), self.row) else {
            self.drop(words.len());
            return;
        };
        let width = self.geometry.width;
        let column = |bytes: &[u8; 2]| u16::from_le_bytes(*bytes) & ADDRESS_MASK;
        let event = |bytes: &[u8; 2]| Event {
            t: CameraMicros(t),
            x: column(bytes),
            y,
            polarity: Polarity::from_on(u16::from_le_bytes(*bytes) & POLARITY_BIT != 0),
        };
        let outside = words.iter().filter(|bytes| column(bytes) >= width).count();
        if outside == 0 {
            events.extend(words.iter().map(event));
        } else {
            events.extend(words.iter().filter(|bytes| column(bytes) < width).map(event));
            self.damage.outside_sensor += outside as u64;
        }
    }

    fn vector(&mut self, valid: u16, pixels: u16, events: &mut Vec<Event>) {
        // Saturates on streams that are not a camera's: columns that far out are dropped anyhow.
        let next = self.base.map(|base| base.saturating_add(pixels));
        let base = core::mem::replace(&mut self.base, next);
        let (Some(base), Some(t), Row::At(y)) = (base, self.time.now(), self.row) else {
            self.drop(valid.count_ones() as usize);
            return;
        };
        let on_sensor = (1 << self.geometry.width.saturating_sub(base).min(pixels)) - 1;
        let inside = valid & on_sensor;
        self.damage.outside_sensor += u64::from((valid ^ inside).count_ones());
        // Each offset is written, and kept if its bit is set: a branch for each bit would be guessed wrong half of the time.
        let (mut offsets, mut count) = ([0_u8; 16], 0);
        for offset in 0..12_u8 {
            offsets[count & 0xF] = offset;
            count += usize::from(inside >> offset & 1);
        }
        let (t, polarity) = (CameraMicros(t), self.polarity);
        let valid_offsets = offsets.get(..count).unwrap_or_default();
        events.extend(valid_offsets.iter().map(|&offset| Event {
            t,
            x: base + u16::from(offset),
            y,
            polarity,
        }));
    }

    /// Events that cannot be placed.
    fn drop(&mut self, events: usize) {
        let events = events as u64;
        match (self.time.now(), self.row) {
            (None, _) => self.damage.events_before_time += events,
            (Some(_), Row::None | Row::At(_)) => self.damage.events_before_address += events,
            (Some(_), Row::OutsideSensor) => self.damage.outside_sensor += events,
        }
    }
}
