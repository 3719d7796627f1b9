//! What a camera's event-rate controller says of itself: how many events came from the pixels, and how many it let pass. OTHERS words
//! announce the counts, CONTINUED words hold them (OpenEB's names; one of each every 200 us from an IMX636).

/// Events before the controller.
const EVENTS_IN: u16 = 0x014;
/// Events after it.
const EVENTS_OUT: u16 = 0x016;
/// Bits of a count: two words of twelve and one of four.
const COUNT_BITS: u32 = 28;

/// Puts the counts together.
#[derive(Debug, Clone, Default)]
pub(super) struct RateControl {
    /// Which count is being told, the part of it that is known, and how many bits that has.
    open: Option<(u16, u32, u32)>,
    events_in: Option<u32>,
}

impl RateControl {
    /// An OTHERS word.
    pub(super) fn announce(&mut self, what: u16) {
        self.open = matches!(what, EVENTS_IN | EVENTS_OUT).then_some((what, 0, 0));
    }

    /// A CONTINUED word of so many `bits`. Returns how many events are now known to have been dropped.
    pub(super) fn go_on(&mut self, payload: u16, bits: u32) -> u64 {
        let Some((what, count, known)) = self.open.take() else { return 0 };
        let count = count | u32::from(payload) << known;
        let known = known + bits;
        if known < COUNT_BITS {
            self.open = Some((what, count, known));
            return 0;
        }
        if what == EVENTS_IN {
            self.events_in = Some(count);
            return 0;
        }
        let events_in = self.events_in.take().unwrap_or(count);
        u64::from(events_in.saturating_sub(count))
    }
}
