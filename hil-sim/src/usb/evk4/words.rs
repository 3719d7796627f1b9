//! The EVT 3.0 words of the stream, with the sensor's habits: TIME_HIGH every 16 us whatever happens, counts of the event-rate
//! controller about every 200 us, vectors for runs of pixels in a row.

use std::collections::VecDeque;

use evfocus_core::{Event, Polarity};

/// TIME_HIGH comes this often.
const TIME_HIGH_US: i64 = 16;
/// The event-rate controller tells its counts about every 200 us: with every twelfth TIME_HIGH.
const COUNTS_US: i64 = 12 * TIME_HIGH_US;
/// Pixels of a vector: twelve, twelve and eight.
const VECTOR: u16 = 32;
/// The sensor's columns.
const WIDTH: u16 = 1280;
/// A vector takes four words, so shorter runs go one by one.
const SHORTEST_RUN: u32 = 5;

/// Words on their way, and what was last said.
#[derive(Debug, Default)]
pub(super) struct Words {
    queue: VecDeque<u16>,
    /// Clock of the simulated camera at the device's time zero.
    origin_us: i64,
    /// Device time up to which everything is told.
    told_us: i64,
    /// Whether the stream's first TIME_HIGH is out.
    begun: bool,
    low: Option<u16>,
    row: Option<u16>,
    run: Option<Run>,
    /// Events since the last counts.
    events: u32,
}

/// Pixels of one row, time and polarity, not yet written: bit i is column base + i.
#[derive(Debug, Clone, Copy)]
struct Run {
    base: u16,
    polarity: Polarity,
    valid: u32,
}

impl Words {
    pub(super) fn starting_at(now_us: i64) -> Self {
        Self { origin_us: now_us, ..Self::default() }
    }

    /// Device time up to which everything is told.
    pub(super) fn told(&self) -> i64 {
        self.told_us
    }

    fn put(&mut self, kind: u16, payload: u16) {
        self.queue.push_back(kind << 12 | payload & 0xFFF);
    }

    /// Tells the time up to `time_us` of the simulated camera's clock. If that goes back, the clock has started anew.
    pub(super) fn advance(&mut self, time_us: i64) {
        let mut time = time_us - self.origin_us;
        if time < self.told_us {
            self.end_run();
            (self.origin_us, self.told_us, self.low, self.begun) = (time_us, 0, None, false);
            time = 0;
        }
        if time == self.told_us && self.begun {
            return;
        }
        self.end_run();
        let mut next = if self.begun { (self.told_us / TIME_HIGH_US + 1) * TIME_HIGH_US } else { 0 };
        while next <= time {
            self.put(0x8, (next >> 12) as u16);
            if next % (1 << 12) == 0 {
                self.low = None;
            }
            if next % COUNTS_US == 0 {
                self.counts();
            }
            next += TIME_HIGH_US;
        }
        (self.told_us, self.begun) = (time, true);
    }

    /// Events before and after the event-rate controller, 28 bits each.
    fn counts(&mut self) {
        let events = std::mem::take(&mut self.events);
        for kind in [0x014, 0x016] {
            self.put(0xE, kind);
            self.put(0xF, events as u16);
            self.put(0xF, (events >> 12) as u16);
            self.put(0x7, (events >> 24) as u16 & 0xF);
        }
    }

    /// An event at the time told last.
    pub(super) fn event(&mut self, event: &Event) {
        self.events += 1;
        let low = (self.told_us & 0xFFF) as u16;
        if self.low != Some(low) {
            self.end_run();
            self.put(0x6, low);
            self.low = Some(low);
        }
        if self.row != Some(event.y) {
            self.end_run();
            self.put(0x0, event.y);
            self.row = Some(event.y);
        }
        if let Some(run) = &mut self.run {
            let offset = event.x.wrapping_sub(run.base);
            let is_next = offset < VECTOR && run.valid >> offset == 0;
            if is_next && run.polarity == event.polarity {
                run.valid |= 1 << offset;
                return;
            }
        }
        self.end_run();
        self.run = Some(Run { base: event.x, polarity: event.polarity, valid: 1 });
    }

    /// Writes the run.
    pub(super) fn end_run(&mut self) {
        let Some(Run { base, polarity, mut valid }) = self.run.take() else { return };
        let on = u16::from(polarity.is_on()) << 11;
        if valid.count_ones() >= SHORTEST_RUN && base + VECTOR <= WIDTH {
            self.put(0x3, on | base);
            self.put(0x4, valid as u16);
            self.put(0x4, (valid >> 12) as u16);
            self.put(0x5, (valid >> 24) as u16);
            return;
        }
        while valid != 0 {
            self.put(0x2, on | (base + valid.trailing_zeros() as u16));
            valid &= valid - 1;
        }
    }

    /// The next packet of at most `most` words.
    pub(super) fn take(&mut self, most: usize) -> Option<Vec<u8>> {
        let count = self.queue.len().min(most);
        (count > 0).then(|| self.queue.drain(..count).flat_map(u16::to_le_bytes).collect())
    }
}
