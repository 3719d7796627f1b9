//! The words of the stream, by the rules of the logic's multiplexer.

use std::collections::VecDeque;

use evfocus_core::Event;

/// The link takes words in bursts of this many.
const BURST: usize = 8;
/// The 15 bits of a time word.
const TIME_BITS: u32 = 15;

/// Words on their way, and what was last said about time.
#[derive(Debug, Default)]
pub(super) struct Words {
    queue: VecDeque<u16>,
    /// Clock of the simulated camera at the device's time zero.
    origin_us: i64,
    /// Wraps told.
    wraps: i64,
    /// Low bits told last; zero is told by a wrap or a reset.
    low: u16,
    row: Option<u16>,
}

impl Words {
    pub(super) fn starting_at(now_us: i64) -> Self {
        Self { origin_us: now_us, ..Self::default() }
    }

    /// The host has reset time at `now_us` of the simulated camera's clock.
    pub(super) fn reset(&mut self, now_us: i64) {
        self.queue.push_back(0x0001);
        (self.origin_us, self.wraps, self.low, self.row) = (now_us, 0, 0, None);
    }

    /// The camera's clock has started anew and shows `now_us`.
    pub(super) fn restart(&mut self, now_us: i64) {
        self.reset(now_us - now_us.rem_euclid(1 << TIME_BITS));
    }

    /// What the device's clock shows when the simulated camera's shows `time_us`.
    pub(super) fn device_time(&self, time_us: i64) -> i64 {
        (time_us - self.origin_us).max(0)
    }

    /// One wrap word for each wrap until `time_us`; one for all if there are many, as after a time in which nobody read.
    pub(super) fn advance(&mut self, time_us: i64) {
        let wraps = self.device_time(time_us) >> TIME_BITS;
        let mut missing = wraps - self.wraps;
        if missing > 0 {
            (self.wraps, self.low, self.row) = (wraps, 0, None);
        }
        while missing > 0 {
            let told = missing.min(0xFFF);
            self.queue.push_back(0x7000 | told as u16);
            missing -= told;
        }
    }

    /// An event; where a filter takes it away, its row stays.
    pub(super) fn event(&mut self, event: &Event, passes: bool) {
        self.advance(event.t.0);
        let low = (self.device_time(event.t.0) & 0x7FFF) as u16;
        if low != self.low {
            self.queue.push_back(0x8000 | low);
            (self.low, self.row) = (low, None);
        }
        // The chip's axes are the picture's exchanged: rows of the chip are columns of the picture.
        if self.row != Some(event.x) {
            self.queue.push_back(0x1000 | event.x);
            self.row = Some(event.x);
        }
        if passes {
            let code = if event.polarity.is_on() { 0x3000 } else { 0x2000 };
            self.queue.push_back(code | event.y);
        }
    }

    /// Whole bursts, and one word more if the packet is due; `None` if that is nothing.
    pub(super) fn take_burst(&mut self, is_due: bool) -> Option<Vec<u8>> {
        let bursts = self.queue.len() / BURST * BURST;
        let count = if is_due { (bursts + 1).min(self.queue.len()) } else { bursts };
        (count > 0).then(|| self.queue.drain(..count).flat_map(u16::to_le_bytes).collect())
    }
}
