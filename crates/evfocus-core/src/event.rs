//! Events as decoders hand them over.

use crate::event_list::EventList;
use crate::units::{CameraMicros, HostMicros};

/// The sign of a brightness change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Polarity {
    /// The pixel became darker by one threshold.
    Off = 0,
    /// The pixel became brighter by one threshold.
    On = 1,
}

impl Polarity {
    /// `On` for `true`.
    pub fn from_on(on: bool) -> Self {
        if on { Self::On } else { Self::Off }
    }

    /// Whether this is `On`.
    pub fn is_on(self) -> bool {
        self == Self::On
    }
}

/// One brightness change at one pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Event {
    /// When, on the camera's clock.
    pub t: CameraMicros,
    /// Column, 0 at the left.
    pub x: u16,
    /// Row, 0 at the top.
    pub y: u16,
    /// Brighter or darker.
    pub polarity: Polarity,
}

/// The size of a sensor in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Geometry {
    /// Columns.
    pub width: u16,
    /// Rows.
    pub height: u16,
}

impl Geometry {
    /// Width times height.
    pub fn pixels(self) -> usize {
        usize::from(self.width) * usize::from(self.height)
    }

    /// Whether column `x`, row `y` is on the sensor.
    pub fn contains(self, x: u16, y: u16) -> bool {
        x < self.width && y < self.height
    }
}

/// A rectangle of pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Window {
    /// Its first column.
    pub x: u16,
    /// Its first row.
    pub y: u16,
    /// Columns.
    pub width: u16,
    /// Rows.
    pub height: u16,
}

impl Window {
    /// The whole of a sensor.
    pub fn whole(geometry: Geometry) -> Self {
        Self { x: 0, y: 0, width: geometry.width, height: geometry.height }
    }

    /// Column and row within the window of the sensor's column `x`, row `y`; `None` outside.
    pub fn place_of(self, x: u16, y: u16) -> Option<(u16, u16)> {
        // What lies before the window wraps round to beyond it.
        let (column, row) = (x.wrapping_sub(self.x), y.wrapping_sub(self.y));
        (column < self.width && row < self.height).then_some((column, row))
    }

    /// Whether it has pixels and all of them are on a sensor of `geometry`.
    pub fn fits(self, geometry: Geometry) -> bool {
        let ends_within = |start: u16, size: u16, limit: u16| {
            size > 0 && u32::from(start) + u32::from(size) <= u32::from(limit)
        };
        ends_within(self.x, self.width, geometry.width) && ends_within(self.y, self.height, geometry.height)
    }
}

/// Events that reached the host together. The batch is lent to the decoder, filled, consumed, and lent again, so that its
/// memory is allocated once.
#[derive(Debug, Clone, Default)]
pub struct EventBatch {
    /// In the order of their times, as the camera sent them.
    pub events: EventList,
    /// When the transfer that held them arrived.
    pub arrival: HostMicros,
    /// The camera time up to which this batch is complete, known even when nothing happened (the camera's own time words);
    /// `None` if the camera said nothing about time.
    pub reached: Option<CameraMicros>,
    /// Events that the camera, the link or the decoder is known to have lost since the batch before.
    pub lost: u64,
}

impl EventBatch {
    /// An empty batch with room for `capacity` events.
    pub fn with_capacity(capacity: usize) -> Self {
        Self { events: EventList::with_capacity(capacity), ..Self::default() }
    }

    /// Empties the batch and keeps its memory.
    pub fn clear(&mut self) {
        self.events.clear();
        self.reached = None;
        self.lost = 0;
    }
}
