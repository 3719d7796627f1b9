//! The 16-bit words of a DAVIS346's USB stream, little-endian (iniVation's logic for the FX3 boards; rules as in libcaer's
//! `davis_common`): bit 15 marks a time, else bits 14 to 12 say what bits 11 to 0 are.

mod counter;
mod time;

pub use counter::DavisWordCounter;

use super::TimeRule;
use super::framing::Framing;
use super::runs::{Kind, decode_run};
use super::vectorized::{TakeWords, take_words};
use crate::damage::Damage;
use crate::event::{Event, EventBatch, Geometry, Polarity};
use crate::event_list::EventList;
use crate::packed_event::PackedEvent;
use crate::units::CameraMicros;
use time::{DavisTime, TIME_PERIOD_US};

/// One word, taken apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Word {
    /// Low 15 bits of the microsecond counter.
    Time(u16),
    /// A signal without an address.
    Special(u16),
    /// Row register, for the DAVIS346 the column of the picture: its axes are exchanged.
    Row(u16),
    /// Column register, for the DAVIS346 the row of the picture, with the polarity.
    Column(u16, Polarity),
    /// Samples of the frame converter, of the inertial unit, of the exposure.
    NoEvents,
    /// So many times 2^15 us have passed since the last wrap.
    Wrap(u16),
}

/// Bits 14 to 0 of a time word.
const TIME_MASK: u16 = 0x7FFF;
/// Bits 11 to 0: what a word's code is about.
const DATA_MASK: u16 = 0x0FFF;
/// Of a column word: brighter.
const POLARITY_BIT: u16 = 0x1000;
/// Bits 15 to 13 of a column word.
const COLUMN_KIND: u16 = 1;

/// The special words that matter here; the others belong to frames and the inertial unit.
mod special {
    pub(super) const RESERVED: u16 = 0;
    pub(super) const TIMESTAMP_RESET: u16 = 1;
    pub(super) const EXTERNAL_FALLING: u16 = 2;
    pub(super) const EXTERNAL_PULSE: u16 = 4;
    pub(super) const LAST: u16 = 17;
}

impl Word {
    fn of(word: u16) -> Self {
        if word & 0x8000 != 0 {
            return Self::Time(word & TIME_MASK);
        }
        let data = word & DATA_MASK;
        match word >> 12 {
            0 => Self::Special(data),
            1 => Self::Row(data),
            2 | 3 => Self::Column(data, Polarity::from_on(word & POLARITY_BIT != 0)),
            7 => Self::Wrap(data),
            _ => Self::NoEvents,
        }
    }
}

/// Decodes the words of a DAVIS346 into events; frames and inertial data are passed over.
#[derive(Debug, Clone)]
pub struct DavisWordDecoder {
    framing: Framing<2>,
    state: State,
}

#[derive(Debug, Clone)]
struct State {
    time: DavisTime,
    /// Picture column of the events that follow.
    column: Column,
    triggers: u64,
    damage: Damage,
}

#[derive(Debug, Clone, Copy)]
enum Column {
    None,
    At(u16),
    /// The column before would be a guess.
    OutsideSensor,
}

impl DavisWordDecoder {
    /// The sensor of the DAVIS346.
    pub const GEOMETRY: Geometry = Geometry { width: 346, height: 260 };
    /// The most events that a word of two bytes can hold.
    pub const MAX_EVENTS_PER_WORD: usize = 1;

    /// A decoder for a recording. Times count from the camera's last timestamp reset; one in mid-stream starts them from zero
    /// again, as the camera does.
    pub fn new() -> Self {
        Self::with_time(DavisTime::new(TimeRule::AsSent))
    }

    /// A decoder for a live camera: time never goes back.
    pub fn live() -> Self {
        Self::with_time(DavisTime::new(TimeRule::Ascending))
    }

    fn with_time(time: DavisTime) -> Self {
        let state = State { time, column: Column::None, triggers: 0, damage: Damage::default() };
        Self { framing: Framing::new(), state }
    }

    /// Appends the events in `bytes` to the batch and sets [`EventBatch::reached`]; at most one event per word.
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

    /// Edges and pulses at the external input so far.
    pub fn triggers(&self) -> u64 {
        self.state.triggers
    }
}

impl Default for DavisWordDecoder {
    fn default() -> Self {
        Self::new()
    }
}

/// What may stand between events.
const KINDS: [Kind; 16] = {
    let mut kinds = [Kind::OTHER; 16];
    kinds[1] = Kind::column(DATA_MASK, DavisWordDecoder::GEOMETRY.width);
    let mut upper_bits = 8;
    while upper_bits < 16 {
        kinds[upper_bits] = Kind::time(TIME_MASK);
        upper_bits += 1;
    }
    kinds
};

impl TakeWords<EventList> for State {
    #[inline(always)]
    fn take_words(&mut self, mut words: &[[u8; 2]], events: &mut EventList) {
        while let Some((&first, rest)) = words.split_first() {
            let taken = self.columns(words, events);
            if taken == 0 {
                self.word(Word::of(u16::from_le_bytes(first)), events);
                words = rest;
            } else {
                words = words.get(taken..).unwrap_or_default();
            }
        }
    }
}

impl State {
    #[inline(always)]
    fn word(&mut self, word: Word, events: &mut EventList) {
        match word {
            Word::Time(low) => self.time.low(low),
            Word::Row(row) => self.row(row),
            Word::Column(y, polarity) => self.column(y, polarity, events),
            Word::Special(signal) => self.special(signal),
            Word::NoEvents => {}
            Word::Wrap(times) => self.time.wrap(times),
        }
    }

    /// Events that a batch must tell of: those before the first time are not missed by anybody.
    fn lost(&self) -> u64 {
        self.damage.events_before_address + self.damage.outside_sensor + self.damage.too_far_in_time
    }

    fn special(&mut self, signal: u16) {
        match signal {
            special::TIMESTAMP_RESET => self.time.reset(),
            special::EXTERNAL_FALLING..=special::EXTERNAL_PULSE => self.triggers += 1,
            special::RESERVED => self.damage.unknown_words += 1,
            signal if signal > special::LAST => self.damage.unknown_words += 1,
            _ => {}
        }
    }

    fn row(&mut self, row: u16) {
        let exists = row < DavisWordDecoder::GEOMETRY.width;
        self.column = if exists { Column::At(row) } else { Column::OutsideSensor };
    }

    /// The words at the front, as long as there are but events, their rows and times. Returns how many.
    #[inline(always)]
    fn columns(&mut self, words: &[[u8; 2]], events: &mut EventList) -> usize {
        let (Some(now), Column::At(x)) = (self.time.now(), self.column) else { return 0 };
        let times = events.since_origin_and_coarse(CameraMicros(now), self.time.wraps_us(), TIME_PERIOD_US);
        let Some((since, wraps)) = times else { return 0 };
        let height = DavisWordDecoder::GEOMETRY.height;
        let is_event = |word: u16| (word >> 13 == COLUMN_KIND) & (word & DATA_MASK < height);
        let event = |shared: PackedEvent, word: u16| {
            shared.in_row(word & DATA_MASK).brighter(word & POLARITY_BIT != 0)
        };
        let mut shared = PackedEvent::at(since).in_column(x);
        let wraps = PackedEvent::at(wraps);
        let taken = decode_run(words, &KINDS, is_event, event, (&mut shared, wraps), events);
        self.column = Column::At(shared.column());
        self.time.advance_to(events.time_of(shared).0);
        taken
    }

    /// One event by itself.
    fn column(&mut self, y: u16, polarity: Polarity, events: &mut EventList) {
        let (Some(t), Column::At(x)) = (self.time.now(), self.column) else {
            self.drop(1);
            return;
        };
        if y >= DavisWordDecoder::GEOMETRY.height {
            self.damage.outside_sensor += 1;
            return;
        }
        let kept = events.push(Event { t: CameraMicros(t), x, y, polarity });
        self.damage.too_far_in_time += u64::from(kept.is_err());
    }

    /// Events that cannot be placed.
    fn drop(&mut self, events: u64) {
        match (self.time.now(), self.column) {
            (None, _) => self.damage.events_before_time += events,
            (Some(_), Column::None | Column::At(_)) => self.damage.events_before_address += events,
            (Some(_), Column::OutsideSensor) => self.damage.outside_sensor += events,
        }
    }
}

/// Whether `bytes`, the start of a file, could be nothing but DAVIS346 words: every word is one that the camera sends, all
/// addresses exist, time never goes back between wraps, and there are events. Chance passes this for no more than a few words.
pub fn looks_like_davis_words(bytes: &[u8]) -> bool {
    let mut last_time = 0;
    let (mut times, mut events) = (0, 0);
    for &word in bytes.as_chunks::<2>().0 {
        match Word::of(u16::from_le_bytes(word)) {
            Word::Time(time) if time < last_time => return false,
            Word::Time(time) => {
                last_time = time;
                times += 1;
            }
            Word::Wrap(0) | Word::Special(special::RESERVED) => return false,
            Word::Wrap(_) | Word::Special(special::TIMESTAMP_RESET) => last_time = 0,
            Word::Special(signal) if signal > special::LAST => return false,
            Word::Row(row) if row >= DavisWordDecoder::GEOMETRY.width => return false,
            Word::Column(column, _) if column >= DavisWordDecoder::GEOMETRY.height => return false,
            Word::Column(..) => events += 1,
            Word::Row(_) | Word::Special(_) | Word::NoEvents => {}
        }
    }
    times > 0 && events > 0
}
