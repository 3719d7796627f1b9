//! EVT 3.0: 16-bit words, little-endian, the type in bits 15 to 12 (Prophesee, "EVT 3.0 Format"; rules for time and for
//! damaged streams as in OpenEB's decoder, `hal/cpp/include/metavision/hal/decoders/evt3`).

mod counter;
mod rate_control;
mod time;

pub use counter::Evt3Counter;

use super::TimeRule;
use super::framing::Framing;
use super::runs::{Kind, decode_run};
use super::vectorized::{TakeWords, take_words};
use crate::damage::Damage;
use crate::event::{Event, EventBatch, Geometry, Polarity};
use crate::event_list::EventList;
use crate::packed_event::PackedEvent;
use crate::units::CameraMicros;
use rate_control::RateControl;
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
/// Microseconds of a coarse unit of time: until TIME_LOW wraps.
const FINE_PERIOD_US: i64 = 1 << 12;
/// Microseconds until the 24 bits of time wrap.
pub const TIME_PERIOD_US: i64 = 1 << 24;

/// Where the bits of the lowest twelve are that are set: four bits for each, the lowest first.
#[inline]
fn packed_offsets(valid: u16) -> u64 {
    let (low, high) = (usize::from(valid & 0xFF), usize::from(valid >> 8 & 0xF));
    // The places of bits 8 to 11 lie eight higher.
    let high_offsets = u64::from(OFFSETS[high]) + 0x8888;
    u64::from(OFFSETS[low]) | high_offsets << (4 * low.count_ones())
}

/// [`packed_offsets`] of each byte.
const OFFSETS: [u32; 256] = {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let (mut bit, mut shift) = (0, 0);
        while bit < 8 {
            if byte >> bit & 1 == 1 {
                table[byte] |= bit << shift;
                shift += 4;
            }
            bit += 1;
        }
        byte += 1;
    }
    table
};

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
    kinds: [Kind; 16],
    time: Evt3Time,
    /// Row of the events that follow.
    row: Row,
    /// Column of the next vector's first pixel.
    base: Option<u16>,
    /// Polarity of the vectors that follow.
    base_is_on: bool,
    triggers: u64,
    rate_control: RateControl,
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
            kinds: kinds(geometry),
            time,
            row: Row::None,
            base: None,
            base_is_on: false,
            triggers: 0,
            rate_control: RateControl::default(),
            damage: Damage::default(),
        };
        Self { framing: Framing::new(), state }
    }

    /// Appends the events in `bytes` to the batch, in the order of the stream, and sets [`EventBatch::reached`]. Events
    /// dropped for their address are added to [`EventBatch::lost`]. At most [`MAX_EVENTS_PER_BYTE`](Self::MAX_EVENTS_PER_BYTE)
    /// events per byte are appended.
    pub fn decode(&mut self, bytes: &[u8], batch: &mut EventBatch) {
        let state = &mut self.state;
        let lost = state.lost();
        self.framing.feed_slices(bytes, |words| take_words(state, words, &mut batch.events));
        batch.lost += state.lost() - lost;
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

/// What may stand between single events.
fn kinds(geometry: Geometry) -> [Kind; 16] {
    let mut kinds = [Kind::OTHER; 16];
    kinds[usize::from(word_type::ADDR_Y)] = Kind::row(ADDRESS_MASK, geometry.height);
    kinds[usize::from(word_type::TIME_LOW)] = Kind::time(PAYLOAD_MASK);
    kinds
}

impl TakeWords<EventList> for State {
    #[inline(always)]
    fn take_words(&mut self, mut words: &[[u8; 2]], events: &mut EventList) {
        while let Some((&first, rest)) = words.split_first() {
            let word = u16::from_le_bytes(first);
            let taken = if word >> 12 == word_type::ADDR_X { self.singles(words, events) } else { 0 };
            if taken == 0 {
                self.word(word, events);
                words = rest;
            } else {
                words = words.get(taken..).unwrap_or_default();
            }
        }
    }
}

impl State {
    #[inline(always)]
    fn word(&mut self, word: u16, events: &mut EventList) {
        match word >> 12 {
            word_type::TIME_LOW => self.time.low(word & PAYLOAD_MASK),
            word_type::ADDR_Y => self.row(word & ADDRESS_MASK),
            word_type::ADDR_X => self.single(word, events),
            word_type::TIME_HIGH => self.time.high(word & PAYLOAD_MASK),
            word_type::VECT_BASE_X => {
                self.base = Some(word & ADDRESS_MASK);
                self.base_is_on = word & POLARITY_BIT != 0;
            }
            word_type::VECT_12 => self.vector(word & PAYLOAD_MASK, 12, events),
            word_type::VECT_8 => self.vector(word & 0xFF, 8, events),
            word_type::EXT_TRIGGER => self.triggers += u64::from(self.time.now().is_some()),
            word_type::OTHERS => self.rate_control.announce(word & PAYLOAD_MASK),
            word_type::CONTINUED_4 => self.continued(word & 0xF, 4),
            word_type::CONTINUED_12 => self.continued(word & PAYLOAD_MASK, 12),
            _ => self.damage.unknown_words += 1,
        }
    }

    fn continued(&mut self, payload: u16, bits: u32) {
        self.damage.dropped_by_camera += self.rate_control.go_on(payload, bits);
    }

    /// Events that a batch must tell of: those before the first time are not missed by anybody.
    fn lost(&self) -> u64 {
        let damage = &self.damage;
        damage.events_before_address
            + damage.outside_sensor
            + damage.too_far_in_time
            + damage.dropped_by_camera
    }

    fn row(&mut self, y: u16) {
        self.row = if y < self.geometry.height { Row::At(y) } else { Row::OutsideSensor };
    }

    /// The words at the front, as long as there are but single events, their rows and times. Returns how many.
    #[inline(always)]
    fn singles(&mut self, words: &[[u8; 2]], events: &mut EventList) -> usize {
        let (Some(now), Row::At(row)) = (self.time.now(), self.row) else { return 0 };
        let coarse_us = self.time.coarse().1;
        let times = events.since_origin_and_coarse(CameraMicros(now), coarse_us, FINE_PERIOD_US);
        let Some((since, coarse)) = times else { return 0 };
        let width = self.geometry.width;
        let is_event = |word: u16| (word >> 12 == word_type::ADDR_X) & (word & ADDRESS_MASK < width);
        let event = |shared: PackedEvent, word: u16| {
            shared.in_column(word & ADDRESS_MASK).brighter(word & POLARITY_BIT != 0)
        };
        let mut shared = PackedEvent::at(since).in_row(row);
        let coarse = PackedEvent::at(coarse);
        let taken = decode_run(words, &self.kinds, is_event, event, (&mut shared, coarse), events);
        self.row = Row::At(shared.row());
        self.time.advance_to(events.time_of(shared).0);
        taken
    }

    /// One event by itself.
    fn single(&mut self, word: u16, events: &mut EventList) {
        let (Some(t), Row::At(y)) = (self.time.now(), self.row) else {
            self.drop(1);
            return;
        };
        let x = word & ADDRESS_MASK;
        if x >= self.geometry.width {
            self.damage.outside_sensor += 1;
            return;
        }
        let polarity = Polarity::from_on(word & POLARITY_BIT != 0);
        let kept = events.push(Event { t: CameraMicros(t), x, y, polarity });
        self.damage.too_far_in_time += u64::from(kept.is_err());
    }

    #[inline(always)]
    fn vector(&mut self, valid: u16, pixels: u16, events: &mut EventList) {
        // Saturates on streams that are not a camera's: columns that far out are dropped anyhow.
        let next = self.base.map(|base| base.saturating_add(pixels));
        let base = core::mem::replace(&mut self.base, next);
        let (Some(base), Some(now), Row::At(row)) = (base, self.time.now(), self.row) else {
            self.drop(valid.count_ones() as usize);
            return;
        };
        let on_sensor = (1 << self.geometry.width.saturating_sub(base).min(pixels)) - 1;
        let inside = valid & on_sensor;
        let count = inside.count_ones() as usize;
        self.damage.outside_sensor += u64::from((valid ^ inside).count_ones());
        let Some(since) = events.since_origin(CameraMicros(now)) else {
            self.damage.too_far_in_time += count as u64;
            return;
        };
        // Twelve events are written, and as many kept as there are bits: a branch for each bit would be guessed wrong half of the time.
        let shared = PackedEvent::at(since).in_row(row).brighter(self.base_is_on);
        let offsets = packed_offsets(inside);
        let twelve = core::array::from_fn::<_, 12, _>(|place| {
            shared.in_column(base.wrapping_add((offsets >> (4 * place) & 0xF) as u16) & ADDRESS_MASK)
        });
        events.append_packed(twelve, count);
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
