//! An event in eight bytes.

#![expect(
    clippy::inline_always,
    reason = "what is to use the vector instructions of a decoder must be inlined into it"
)]

use crate::event::{Event, Polarity};
use crate::units::CameraMicros;

/// As many as the cameras' formats have.
const ADDRESS_BITS: u32 = 11;
/// Between column and row, where EVT 3.0 has it.
const POLARITY_SHIFT: u32 = ADDRESS_BITS;
const ADDRESS_MASK: u64 = (1 << ADDRESS_BITS) - 1;
/// The farthest that a time may be from its list's origin, in the past and in the future: 12.7 days.
const LONGEST_US: i64 = 1 << (63 - PackedEvent::TIME_SHIFT);

/// The largest column and row that a list of events can hold. No event camera comes near it.
pub const LARGEST_ADDRESS: u16 = ADDRESS_MASK as u16;

/// An event of a list: from the lowest bit 11 bits of column, 1 of polarity, 11 of row, 41 of signed microseconds since its origin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(transparent)]
pub(crate) struct PackedEvent(u64);

impl PackedEvent {
    /// Bits of the column.
    pub(crate) const COLUMN: u64 = ADDRESS_MASK;
    /// Bits of the row, and the lowest of them.
    pub(crate) const ROW: u64 = ADDRESS_MASK << Self::ROW_SHIFT;
    pub(crate) const ROW_SHIFT: u32 = POLARITY_SHIFT + 1;
    /// Bits of the time, and the lowest of them.
    pub(crate) const TIME: u64 = u64::MAX << Self::TIME_SHIFT;
    pub(crate) const TIME_SHIFT: u32 = Self::ROW_SHIFT + ADDRESS_BITS;

    /// An event `since` the origin, whose address is yet to be filled in.
    #[inline(always)]
    pub(crate) fn at(since: SinceOrigin) -> Self {
        Self((since.0 as u64) << Self::TIME_SHIFT)
    }

    /// Only the bits `keep` of it; for the others `bits`, added to those of `base`.
    #[inline(always)]
    pub(crate) fn changed(self, keep: u64, bits: u64, base: Self) -> Self {
        Self(self.0 & keep | bits.wrapping_add(base.0 & !keep))
    }

    /// Whether its time is earlier.
    #[inline(always)]
    pub(crate) fn is_before(self, other: Self) -> bool {
        self.since_us() < other.since_us()
    }

    /// Its row.
    #[inline(always)]
    pub(crate) fn row(self) -> u16 {
        (self.0 >> Self::ROW_SHIFT & ADDRESS_MASK) as u16
    }

    /// Its column.
    #[inline(always)]
    pub(crate) fn column(self) -> u16 {
        (self.0 & ADDRESS_MASK) as u16
    }

    /// In this row (at most [`LARGEST_ADDRESS`]), which must not have been filled in before.
    #[inline(always)]
    pub(crate) fn in_row(self, y: u16) -> Self {
        Self(self.0 | u64::from(y) << Self::ROW_SHIFT)
    }

    /// In this column (at most [`LARGEST_ADDRESS`]), which must not have been filled in before.
    #[inline(always)]
    pub(crate) fn in_column(self, x: u16) -> Self {
        Self(self.0 | u64::from(x))
    }

    /// Brighter, if `on`; must not have been filled in before.
    #[inline(always)]
    pub(crate) fn brighter(self, on: bool) -> Self {
        Self(self.0 | u64::from(on) << POLARITY_SHIFT)
    }

    #[inline]
    pub(crate) fn of(event: &Event, origin: CameraMicros) -> Result<Self, DoesNotFit> {
        let &Event { t, x, y, polarity } = event;
        if x > LARGEST_ADDRESS || y > LARGEST_ADDRESS {
            return Err(DoesNotFit::Address { x, y });
        }
        let too_far = DoesNotFit::Time { time_us: t.0, origin_us: origin.0 };
        let since = SinceOrigin::of(t, origin).ok_or(too_far)?;
        Ok(Self::at(since).in_row(y).in_column(x).brighter(polarity.is_on()))
    }

    #[inline(always)]
    pub(crate) fn since_us(self) -> i64 {
        self.0 as i64 >> Self::TIME_SHIFT
    }

    #[inline(always)]
    pub(crate) fn is_on(self) -> bool {
        self.0 >> POLARITY_SHIFT & 1 == 1
    }

    #[inline(always)]
    pub(crate) fn unpack(self, origin: CameraMicros) -> Event {
        Event {
            // Wraps back to what it was packed from.
            t: CameraMicros(origin.0.wrapping_add(self.since_us())),
            x: self.column(),
            y: self.row(),
            polarity: Polarity::from_on(self.is_on()),
        }
    }
}

/// A time that fits a list, microseconds since the list's origin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct SinceOrigin(i64);

impl SinceOrigin {
    #[inline]
    pub(crate) fn of(time: CameraMicros, origin: CameraMicros) -> Option<Self> {
        let since = time.0.checked_sub(origin.0)?;
        (-LONGEST_US..LONGEST_US).contains(&since).then_some(Self(since))
    }
}

/// An event that a list cannot hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum DoesNotFit {
    /// No event camera has so many pixels.
    #[error("column {x}, row {y}: events are kept up to column and row {LARGEST_ADDRESS}")]
    Address {
        /// Column of the event.
        x: u16,
        /// Row of the event.
        y: u16,
    },
    /// It has to go into another list.
    #[error("{time_us} us: a list that begins at {origin_us} us keeps events up to 12.7 days from there")]
    Time {
        /// Time of the event, microseconds.
        time_us: i64,
        /// Time that the list counts from, microseconds.
        origin_us: i64,
    },
}
