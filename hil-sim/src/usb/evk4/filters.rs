//! What the sensor keeps to itself: lines that are off, masked pixels, and what the event-rate controller drops.

use evfocus_core::Event;

/// What the controller remembers.
#[derive(Debug, Default)]
pub(super) struct Filters {
    period: i64,
    events: u32,
}

impl Filters {
    /// Whether `event` gets through; `get` reads a register.
    pub(super) fn pass(&mut self, event: &Event, get: &impl Fn(u32) -> u32) -> bool {
        let (x, y) = (u32::from(event.x), u32::from(event.y));
        let is_off = |first: u32, line: u32| get(first + line / 32 * 4) >> (line % 32) & 1 == 1;
        let by_lines = get(0x0004) & 1 << 1 != 0;
        if by_lines && (is_off(0x2000, x) || is_off(0x4000, y)) {
            return false;
        }
        // Masks are set from the first register on.
        let mut masks = (0..64).map(|index| get(0x9100 + 4 * index)).take_while(|mask| mask >> 31 == 1);
        if masks.any(|mask| mask == 1 << 31 | y << 16 | x) {
            return false;
        }
        self.is_within_rate(event, get)
    }

    fn is_within_rate(&mut self, event: &Event, get: &impl Fn(u32) -> u32) -> bool {
        let is_dropping = get(0x6050) & 1 == 1 && get(0x6000) & 3 == 1;
        let period = event.t.0 / i64::from(get(0x6008) & 0x3FF).max(1);
        if period != self.period {
            (self.period, self.events) = (period, 0);
        }
        self.events += 1;
        !is_dropping || self.events <= get(0x600C) & 0x3F_FFFF
    }
}
