//! The same with `neuromorphic-drivers`, used as its documentation shows.

use std::hint::black_box;

use neuromorphic_drivers::adapters::{davis346, evt3};
use neuromorphic_drivers::inivation_davis346::{ApsOrientation, ImuOrientation, ImuType};
use neuromorphic_types::PolarityEvent;

use crate::streams::{BIN_US, SENSOR};
use crate::{TRANSFER_BYTES, Work};

/// Counts into bins with the adapter's own counting.
pub struct Evt3Count {
    adapter: evt3::Adapter,
    end: u64,
}

impl Evt3Count {
    pub fn new() -> Self {
        Self { adapter: evt3_adapter(), end: u64::from(BIN_US) }
    }
}

impl Work for Evt3Count {
    fn begin(&mut self) {
        *self = Self::new();
    }

    fn transfer(&mut self, mut bytes: &[u8]) -> u64 {
        let mut total = 0;
        while !bytes.is_empty() {
            let (counts, taken) = self.adapter.events_lengths_until(bytes, self.end);
            total += black_box(counts.on + counts.off) as u64;
            bytes = &bytes[taken..];
            let width = u64::from(BIN_US);
            self.end = (self.adapter.current_t() / width + 1) * width;
        }
        total
    }
}

/// Stores events.
pub struct Evt3Decode {
    adapter: evt3::Adapter,
    events: Vec<PolarityEvent<u64, u16, u16>>,
}

impl Evt3Decode {
    pub fn new() -> Self {
        Self { adapter: evt3_adapter(), events: Vec::with_capacity(TRANSFER_BYTES * 6) }
    }
}

impl Work for Evt3Decode {
    fn begin(&mut self) {
        self.adapter = evt3_adapter();
    }

    fn transfer(&mut self, bytes: &[u8]) -> u64 {
        self.events.clear();
        self.adapter.convert(bytes, |event| self.events.push(event), |_| {});
        black_box(&self.events).len() as u64
    }
}

fn evt3_adapter() -> evt3::Adapter {
    evt3::Adapter::from_dimensions(SENSOR.width, SENSOR.height)
}

fn davis_adapter() -> davis346::Adapter {
    let aps = ApsOrientation { invert_xy: false, flip_x: false, flip_y: false };
    let imu = ImuOrientation { flip_x: false, flip_y: false, flip_z: false };
    davis346::Adapter::new(true, aps, imu, ImuType::None)
}

/// Counts into bins; the adapter does not count by itself, so this converts and stores nothing.
pub struct DavisCount {
    adapter: davis346::Adapter,
    bin: u64,
    open: u64,
}

impl DavisCount {
    pub fn new() -> Self {
        Self { adapter: davis_adapter(), bin: 0, open: 0 }
    }
}

impl Work for DavisCount {
    fn begin(&mut self) {
        *self = Self::new();
    }

    fn transfer(&mut self, bytes: &[u8]) -> u64 {
        let (bin, open) = (&mut self.bin, &mut self.open);
        let mut total = 0;
        let count = |event: PolarityEvent<u64, u16, u16>| {
            if event.t >= *bin {
                total += black_box(std::mem::take(open));
                let width = u64::from(BIN_US);
                *bin = (event.t / width + 1) * width;
            }
            *open += 1;
        };
        self.adapter.convert(bytes, count, |_| {}, |_| {}, |_| {});
        total + std::mem::take(open)
    }
}

/// Stores events.
pub struct DavisDecode {
    adapter: davis346::Adapter,
    events: Vec<PolarityEvent<u64, u16, u16>>,
}

impl DavisDecode {
    pub fn new() -> Self {
        Self { adapter: davis_adapter(), events: Vec::with_capacity(TRANSFER_BYTES) }
    }
}

impl Work for DavisDecode {
    fn begin(&mut self) {
        self.adapter = davis_adapter();
    }

    fn transfer(&mut self, bytes: &[u8]) -> u64 {
        self.events.clear();
        self.adapter.convert(bytes, |event| self.events.push(event), |_| {}, |_| {}, |_| {});
        black_box(&self.events).len() as u64
    }
}
