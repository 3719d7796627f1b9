//! EVT 2.0: 32-bit words, little-endian, the type in bits 31 to 28 (Prophesee, "EVT 2.0 Format"; the wrap as in OpenEB).

use super::framing::Framing;
use crate::damage::Damage;
use crate::event::{Event, EventBatch, Geometry, Polarity};
use crate::event_list::EventList;
use crate::units::CameraMicros;

/// The type of a word, bits 31 to 28.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum WordType {
    /// The pixel became darker: time bits 5 to 0 in 27 to 22, column in 21 to 11, row in 10 to 0.
    CdOff,
    /// The pixel became brighter.
    CdOn,
    /// Time bits 33 to 6.
    TimeHigh,
    /// Edge at an external input.
    ExtTrigger,
    /// Statistics, inertial data, continuations: no events.
    NoEvents,
    /// Not defined.
    Unknown,
}

impl WordType {
    fn of(word: u32) -> Self {
        match word >> 28 {
            0x0 => Self::CdOff,
            0x1 => Self::CdOn,
            0x8 => Self::TimeHigh,
            0xA => Self::ExtTrigger,
            0xD..=0xF => Self::NoEvents,
            _ => Self::Unknown,
        }
    }
}

/// Microseconds until the 34 bits of time wrap.
const TIME_PERIOD_US: i64 = 1 << 34;
/// A time that falls by nearly the whole period has wrapped; by less, it has gone back. OpenEB allows 10 ms.
const WRAP_THRESHOLD_US: i64 = TIME_PERIOD_US - 64 - 10_000;
/// Bits 10 to 0: a row or column.
const ADDRESS_MASK: u32 = 0x7FF;
/// Bits 5 to 0: the fine time.
const FINE_TIME_MASK: u32 = 0x3F;

/// Decodes EVT 2.0 words into events. Decoding starts at the first TIME_HIGH.
#[derive(Debug, Clone)]
pub struct Evt2Decoder {
    framing: Framing<4>,
    state: State,
}

#[derive(Debug, Clone)]
struct State {
    geometry: Geometry,
    /// Time bits 33 to 6 in place, wraps and origin added; `None` before the first TIME_HIGH.
    coarse: Option<i64>,
    /// Time bits 33 to 6 in place, as the camera sent them.
    sent: i64,
    period_start: i64,
    triggers: u64,
    damage: Damage,
}

impl Evt2Decoder {
    /// What the format can address: 11 bits each way. For streams whose sensor is unknown.
    pub const MAX_GEOMETRY: Geometry = Geometry { width: 2048, height: 2048 };

    /// A decoder for a sensor of this size, with `origin` added to all times.
    pub fn with_origin(geometry: Geometry, origin: CameraMicros) -> Self {
        let state = State {
            geometry,
            coarse: None,
            sent: 0,
            period_start: origin.0,
            triggers: 0,
            damage: Damage::default(),
        };
        Self { framing: Framing::new(), state }
    }

    /// Appends the events in `bytes` to the batch and sets [`EventBatch::reached`]; at most one event per word.
    pub fn decode(&mut self, bytes: &[u8], batch: &mut EventBatch) {
        let state = &mut self.state;
        let lost = |damage: &Damage| damage.outside_sensor + damage.too_far_in_time;
        let lost_before = lost(&state.damage);
        self.framing.feed(bytes, |word| state.word(u32::from_le_bytes(word), &mut batch.events));
        batch.lost += lost(&state.damage) - lost_before;
        batch.reached = state.coarse.map(CameraMicros).or(batch.reached);
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
    fn word(&mut self, word: u32, events: &mut EventList) {
        match WordType::of(word) {
            WordType::CdOff => self.change(word, Polarity::Off, events),
            WordType::CdOn => self.change(word, Polarity::On, events),
            WordType::TimeHigh => self.time_high(i64::from(word & 0x0FFF_FFFF) << 6),
            WordType::ExtTrigger => self.triggers += u64::from(self.coarse.is_some()),
            WordType::NoEvents => {}
            WordType::Unknown => self.damage.unknown_words += 1,
        }
    }

    fn time_high(&mut self, sent: i64) {
        if self.coarse.is_some() && self.sent - sent >= WRAP_THRESHOLD_US {
            self.period_start = self.period_start.saturating_add(TIME_PERIOD_US);
        }
        self.sent = sent;
        self.coarse = Some(self.period_start.saturating_add(sent));
    }

    fn change(&mut self, word: u32, polarity: Polarity, events: &mut EventList) {
        let Some(coarse) = self.coarse else {
            self.damage.events_before_time += 1;
            return;
        };
        let (x, y) = (((word >> 11) & ADDRESS_MASK) as u16, (word & ADDRESS_MASK) as u16);
        if !self.geometry.contains(x, y) {
            self.damage.outside_sensor += 1;
            return;
        }
        let t = coarse.saturating_add(i64::from((word >> 22) & FINE_TIME_MASK));
        let kept = events.push(Event { t: CameraMicros(t), x, y, polarity });
        self.damage.too_far_in_time += u64::from(kept.is_err());
    }
}
