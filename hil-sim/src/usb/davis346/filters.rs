//! The filters of the logic, in its order: window, single pixels, activity, refractory time.

use std::collections::HashMap;

use evfocus_core::Event;

/// The unit of the filters' times, microseconds.
const UNIT_US: i64 = 250;

/// What the filters remember: when each pixel last sent.
#[derive(Debug, Default)]
pub(super) struct Filters {
    last: HashMap<(u16, u16), i64>,
}

impl Filters {
    /// Whether `event` gets through; `get` reads a parameter of the pixels' module.
    pub(super) fn pass(&mut self, event: &Event, get: &impl Fn(u8) -> u32) -> bool {
        let (x, y) = (u32::from(event.x), u32::from(event.y));
        if !(get(41)..=get(43)).contains(&x) || !(get(42)..=get(44)).contains(&y) {
            return false;
        }
        if (0..8).any(|index| (get(11 + 2 * index), get(12 + 2 * index)) == (y, x)) {
            return false;
        }
        let within = |time: Option<&i64>, units: u32| {
            time.is_some_and(|&time| event.t.0 - time <= i64::from(units) * UNIT_US)
        };
        let is_active = get(31) == 0 || {
            let mut near =
                (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (dx, dy))).filter(|&at| at != (0, 0));
            near.any(|(dx, dy)| {
                let at = (event.x.wrapping_add_signed(dx), event.y.wrapping_add_signed(dy));
                within(self.last.get(&at), get(32))
            })
        };
        let is_rested = get(33) == 0 || !within(self.last.get(&(event.x, event.y)), get(34));
        self.last.insert((event.x, event.y), event.t.0);
        is_active && is_rested
    }
}
