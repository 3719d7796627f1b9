//! Events by chance from the pixels that are not simulated: a full stream for little arithmetic.

use evfocus_core::{CameraMicros, Event, EventBatch, Polarity};

/// The pixels of the rows below the simulated ones, and how often any of them sends an event.
#[derive(Debug)]
pub(super) struct Background {
    events_per_s: u32,
    columns: u32,
    first_row: u32,
    rows: u32,
    random: u32,
    /// Events that are due and not yet whole, in millionths.
    due: u64,
    reached: Option<CameraMicros>,
    /// Those of the batch and ours.
    merged: Vec<Event>,
}

impl Background {
    /// Of a sensor with `size` columns and rows, of which the upper `simulated_rows` have pixels of their own.
    pub(super) fn new(events_per_s: u32, size: (u16, u16), simulated_rows: u16) -> Self {
        let (columns, rows) = (u32::from(size.0), u32::from(size.1.saturating_sub(simulated_rows)));
        Self {
            events_per_s: if rows == 0 { 0 } else { events_per_s },
            columns,
            first_row: u32::from(simulated_rows),
            rows,
            random: 1,
            due: 0,
            reached: None,
            merged: Vec::new(),
        }
    }

    /// Adds the events of the time that `batch` went on.
    pub(super) fn add(&mut self, batch: &mut EventBatch) {
        let Some(reached) = batch.reached else { return };
        let since = self.reached.replace(reached).unwrap_or(reached);
        let micros = (reached.0 - since.0).max(0);
        self.due += micros.unsigned_abs() * u64::from(self.events_per_s);
        let count = (self.due / 1_000_000) as i64;
        self.due %= 1_000_000;
        self.merged.clear();
        self.merged.extend(batch.events.iter());
        for index in 0..count {
            self.random ^= self.random << 13;
            self.random ^= self.random >> 17;
            self.random ^= self.random << 5;
            let random = self.random;
            self.merged.push(Event {
                t: CameraMicros(since.0 + 1 + micros * index / count),
                x: (((random & 0xFFFF) * self.columns) >> 16) as u16,
                y: (self.first_row + (((random >> 16) * self.rows) >> 16)) as u16,
                polarity: Polarity::from_on(random & 1 == 1),
            });
        }
        // Two runs in order: merging them is all that is left to do.
        self.merged.sort_by_key(|event| event.t);
        batch.events.clear();
        batch.lost += batch.events.append(self.merged.iter().copied());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn so_many_events_come_in_order_from_the_rows_below() {
        let mut background = Background::new(2_500, (346, 260), 72);
        let mut batch = EventBatch::with_capacity(16);
        let mut count = 0;
        for millisecond in 0..=2_000 {
            batch.clear();
            batch.reached = Some(CameraMicros(millisecond * 1_000));
            background.add(&mut batch);
            assert!(batch.events.iter().is_sorted_by_key(|event| event.t));
            assert!(batch.events.iter().all(|event| event.x < 346 && (72..260).contains(&event.y)));
            assert!(batch.events.iter().all(|event| event.t <= CameraMicros(millisecond * 1_000)));
            count += batch.events.len();
        }
        assert_eq!(count, 5_000);
    }
}
