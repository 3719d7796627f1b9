//! What a stream has carried, so that another program can be asked whether it got the same.

use evfocus_core::Event;

/// Sums over the first events of a stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Tally {
    /// How many events.
    pub events: u64,
    /// Those of them that are ON.
    pub on: u64,
    /// Sum of their columns.
    pub x: u64,
    /// Sum of their rows.
    pub y: u64,
    /// Sum of their times since the first of them, microseconds.
    pub t_us: u64,
}

/// The sums at 2, 4, 8 and so on events, since the stream began or the host reset the device's time.
#[derive(Debug, Default)]
pub(super) struct Tallies {
    now: Tally,
    first_us: i64,
    kept: Vec<Tally>,
}

impl Tallies {
    /// An event has been put into the stream, with this device time.
    pub(super) fn add(&mut self, event: &Event, time_us: i64) {
        let now = &mut self.now;
        if now.events == 0 {
            self.first_us = time_us;
        }
        now.events += 1;
        now.on += u64::from(event.polarity.is_on());
        now.x += u64::from(event.x);
        now.y += u64::from(event.y);
        now.t_us += (time_us - self.first_us).unsigned_abs();
        if now.events >= 2 && now.events.is_power_of_two() {
            self.kept.push(*now);
        }
    }

    pub(super) fn kept(&self) -> &[Tally] {
        &self.kept
    }
}
