//! Events as EVT 3.0 words (Prophesee, "EVT 3.0 Format").

use std::borrow::Borrow;

use evfocus_core::decode::Evt3Decoder;
use evfocus_core::decode::evt3::{POLARITY_BIT, TIME_PERIOD_US, word_type};
use evfocus_core::{CameraMicros, Event, Geometry, Polarity};

use super::EncodeError;

/// Pixels that one vector of three words (12, 12 and 8) covers.
const VECTOR_PIXELS: u16 = 32;
/// A vector takes a base and three words; up to so many events are shorter one by one.
const VECTOR_WORDS: u32 = 4;
/// Real sensors repeat TIME_HIGH this often; so does the encoder while there are events.
const TIME_HIGH_REPEAT_SHIFT: u32 = 4;

/// Writes events as EVT 3.0 words, as a sensor would: TIME_HIGH repeated at least in every 16 us that have events and once per
/// 4096 us of silence (half a kilobyte a second), vectors where they are shorter. Nothing is lost: times, order and addresses
/// come back as they were.
///
/// Times are written from the origin, [`origin`](Self::origin), on: the first event's time rounded down to a multiple of
/// 2^24 us, which is what the 24 bits of the format can hold. A camera wraps in the same way.
#[derive(Debug, Clone)]
pub struct Evt3Encoder {
    geometry: Geometry,
    origin: Option<i64>,
    last_time: i64,
    /// Units of 4096 us since the origin, as last written; `None` before the first.
    high: Option<i64>,
    /// Units of 16 us in which TIME_HIGH was last written.
    repeated: i64,
    low: Option<u16>,
    row: Option<u16>,
    run: Option<Run>,
}

/// Events of one time, row and polarity in ascending columns, not yet written.
#[derive(Debug, Clone, Copy)]
struct Run {
    base: u16,
    polarity: Polarity,
    /// Bit i is the pixel at column `base + i`.
    valid: u32,
}

impl Evt3Encoder {
    /// The longest silence that can be written, in microseconds (19 hours, for which it takes 33 MB).
    pub const MAX_GAP_US: i64 = 1 << 36;

    /// An encoder for a sensor of this size.
    ///
    /// # Errors
    /// [`EncodeError::SensorTooLarge`] for more than 2048 columns or rows.
    pub fn new(geometry: Geometry) -> Result<Self, EncodeError> {
        let max = Evt3Decoder::MAX_GEOMETRY;
        if geometry.width > max.width || geometry.height > max.height {
            return Err(EncodeError::SensorTooLarge { geometry, max });
        }
        Ok(Self {
            geometry,
            origin: None,
            last_time: 0,
            high: None,
            repeated: 0,
            low: None,
            row: None,
            run: None,
        })
    }

    /// What has to be added to the times that a decoder reads; `None` before the first event.
    pub fn origin(&self) -> Option<CameraMicros> {
        self.origin.map(CameraMicros)
    }

    /// Appends the words for `events` to `out`.
    ///
    /// # Errors
    /// An event that cannot be written; those before it have been, and the encoder can go on with others.
    pub fn encode(
        &mut self,
        events: impl IntoIterator<Item: Borrow<Event>>,
        out: &mut Vec<u8>,
    ) -> Result<(), EncodeError> {
        let result = events.into_iter().try_for_each(|event| self.event(event.borrow(), out));
        self.flush_run(out);
        result
    }

    /// Appends the words that tell that time has reached `time` without an event; no later event may come before it.
    ///
    /// # Errors
    /// As [`encode`](Self::encode).
    pub fn advance(&mut self, time: CameraMicros, out: &mut Vec<u8>) -> Result<(), EncodeError> {
        self.tell_time(time.0, out)
    }

    fn event(&mut self, event: &Event, out: &mut Vec<u8>) -> Result<(), EncodeError> {
        if !self.geometry.contains(event.x, event.y) {
            return Err(EncodeError::OutsideSensor { event: *event, geometry: self.geometry });
        }
        if self.high.is_some() && event.t.0 == self.last_time && self.row == Some(event.y) {
            if self.extend_run(event) {
                return Ok(());
            }
            self.flush_run(out);
        } else {
            self.flush_run(out);
            self.tell_time(event.t.0, out)?;
            if self.row != Some(event.y) {
                self.row = Some(event.y);
                put(out, word_type::ADDR_Y, event.y);
            }
        }
        self.run = Some(Run { base: event.x, polarity: event.polarity, valid: 1 });
        Ok(())
    }

    /// Adds the event to the run if the run can hold it without a change of order.
    fn extend_run(&mut self, event: &Event) -> bool {
        let Some(run) = &mut self.run else { return false };
        let Some(offset) = event.x.checked_sub(run.base) else { return false };
        let newest = run.valid.checked_ilog2().unwrap_or(0);
        if offset >= VECTOR_PIXELS || u32::from(offset) <= newest || run.polarity != event.polarity {
            return false;
        }
        run.valid |= 1 << offset;
        true
    }

    fn flush_run(&mut self, out: &mut Vec<u8>) {
        let Some(run) = self.run.take() else { return };
        let polarity = if run.polarity.is_on() { POLARITY_BIT } else { 0 };
        // A vector must not reach beyond the sensor, even with pixels that are not valid.
        let fits = run.base + VECTOR_PIXELS <= self.geometry.width;
        if run.valid.count_ones() > VECTOR_WORDS && fits {
            put(out, word_type::VECT_BASE_X, run.base | polarity);
            put(out, word_type::VECT_12, (run.valid & 0xFFF) as u16);
            put(out, word_type::VECT_12, ((run.valid >> 12) & 0xFFF) as u16);
            put(out, word_type::VECT_8, (run.valid >> 24) as u16);
            return;
        }
        let mut valid = run.valid;
        while valid != 0 {
            put(out, word_type::ADDR_X, (run.base + valid.trailing_zeros() as u16) | polarity);
            valid &= valid - 1;
        }
    }

    fn tell_time(&mut self, time: i64, out: &mut Vec<u8>) -> Result<(), EncodeError> {
        let origin =
            self.origin.unwrap_or_else(|| time.div_euclid(TIME_PERIOD_US).saturating_mul(TIME_PERIOD_US));
        let out_of_reach = EncodeError::TimeOutOfReach { time };
        let relative = time.checked_sub(origin).ok_or(out_of_reach)?;
        let (high, low) = (relative >> 12, (relative & 0xFFF) as u16);
        if self.origin.is_some() {
            if time < self.last_time {
                return Err(EncodeError::TimeReversal { time, last: self.last_time });
            }
            let gap_us = time.checked_sub(self.last_time).ok_or(out_of_reach)?;
            if gap_us > Self::MAX_GAP_US {
                return Err(EncodeError::GapTooLong { gap_us });
            }
        }
        self.origin = Some(origin);
        self.last_time = time;
        let repeated = relative >> TIME_HIGH_REPEAT_SHIFT;
        match self.high {
            Some(last) if last == high && self.repeated == repeated => {}
            // Each step in between is written too, so that a reader can tell silence from loss.
            Some(last) if last < high => ((last + 1)..=high).for_each(|high| put_time_high(out, high)),
            Some(_) | None => put_time_high(out, high),
        }
        if self.high != Some(high) {
            self.low = None;
        }
        self.high = Some(high);
        self.repeated = repeated;
        if self.low != Some(low) {
            self.low = Some(low);
            put(out, word_type::TIME_LOW, low);
        }
        Ok(())
    }
}

fn put_time_high(out: &mut Vec<u8>, high: i64) {
    put(out, word_type::TIME_HIGH, (high & 0xFFF) as u16);
}

fn put(out: &mut Vec<u8>, kind: u16, payload: u16) {
    out.extend_from_slice(&(kind << 12 | payload).to_le_bytes());
}
