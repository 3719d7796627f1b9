//! A DAVIS346: the registers of its logic and its vendor requests.
//!
//! Values that no source states are those of the logic's published ancestors: clocks, sizes, orientation.

mod filters;
mod words;

use std::collections::BTreeMap;

use evfocus_core::{CameraMicros, EventBatch};
use evfocus_hal::usb::{UsbError, UsbIdentity, UsbSpeed, VendorRequest};

use super::UsbFaults;
use super::descriptors::{Description, Endpoint, Kind};
use super::device::Device;
use super::tally::{Tallies, Tally};
use filters::Filters;
use words::Words;

/// Module and parameter of what the logic tells and does not let one write, with the values told.
const TOLD: [((u8, u8), u32); 21] = [
    // Statistics of what was dropped.
    ((0, 80), 1),
    // The pixels: columns, rows, axes exchanged; pixel, activity, window, skip and polarity filter, statistics.
    ((1, 0), 260),
    ((1, 1), 346),
    ((1, 2), 4),
    ((1, 10), 1),
    ((1, 30), 1),
    ((1, 40), 1),
    ((1, 50), 1),
    ((1, 60), 1),
    ((1, 80), 0),
    // The frames, of which none are sent: columns, rows, axes exchanged, global shutter.
    ((2, 0), 260),
    ((2, 1), 346),
    ((2, 2), 4),
    ((2, 6), 1),
    // The external input's generator.
    ((4, 10), 1),
    // Logic, chip B, time-stamp master, clocks of logic, converter and link in MHz.
    ((6, 0), 18),
    ((6, 1), 5),
    ((6, 2), 1),
    ((6, 3), 125),
    ((6, 4), 30),
    ((6, 5), 80),
];
/// Clocks are off by this many per mille; the patch of the logic.
const CLOCK_DEVIATION: ((u8, u8), u32) = ((6, 6), 1008);
const PATCH: ((u8, u8), u32) = ((6, 7), 1);
/// Words dropped because nobody read them: the high word, then the low one.
const DROPPED: (u8, u8) = (0, 83);

/// Data, and the firmware's messages for its makers, of which there are none.
const ENDPOINTS: [Endpoint; 2] = [
    Endpoint { address: 0x82, kind: Kind::Bulk, burst: 16 },
    Endpoint { address: 0x81, kind: Kind::Interrupt, burst: 1 },
];
const DESCRIPTION: Description = Description {
    manufacturer: "iniVation",
    product: "DAVIS346",
    class: [0xFF, 0, 0],
    endpoints: &ENDPOINTS,
};

/// An emulated DAVIS346.
#[derive(Debug)]
pub(super) struct Davis346 {
    serial: String,
    registers: BTreeMap<(u8, u8), u32>,
    words: Words,
    filters: Filters,
    tallies: Tallies,
    /// When the device last sent a packet that was not full.
    packet_sent_us: i64,
    newest_us: i64,
    dropped: u64,
}

impl Davis346 {
    pub(super) fn new(seed: u64) -> Self {
        let told = TOLD.into_iter().chain([CLOCK_DEVIATION, PATCH]);
        Self {
            serial: format!("{:08}", seed % 100_000_000),
            registers: told.collect(),
            words: Words::default(),
            filters: Filters::default(),
            tallies: Tallies::default(),
            packet_sent_us: 0,
            newest_us: 0,
            dropped: 0,
        }
    }

    fn get(&self, module: u8, parameter: u8) -> u32 {
        match (module, parameter) {
            DROPPED => (self.dropped >> 32) as u32,
            (0, 84) => self.dropped as u32,
            place => self.registers.get(&place).copied().unwrap_or(0),
        }
    }

    fn is_set(&self, module: u8, parameter: u8) -> bool {
        self.get(module, parameter) & 1 == 1
    }

    fn set(&mut self, module: u8, parameter: u8, value: u32) {
        let is_told =
            TOLD.iter().chain(&[CLOCK_DEVIATION, PATCH]).any(|(place, _)| *place == (module, parameter));
        if is_told {
            return;
        }
        let resets = (module, parameter) == (0, 2) && value == 1 && !self.is_set(0, 2);
        self.registers.insert((module, parameter), value);
        if resets {
            self.words.reset(self.newest_us);
            self.tallies = Tallies::default();
        }
    }

    /// Microseconds after which a packet that is not full is sent.
    fn packet_delay_us(&self) -> i64 {
        let (cycles, mhz) = (u64::from(self.get(9, 1)), u64::from(self.get(6, 5)));
        let deviation = u64::from(self.get(6, 6)).max(1);
        (cycles * 1000 / (mhz * deviation).max(1)) as i64
    }
}

impl Device for Davis346 {
    fn identity(&self, faults: &UsbFaults) -> UsbIdentity {
        UsbIdentity {
            vendor: 0x152A,
            product: 0x841A,
            version: faults.firmware.map_or(6, |firmware| firmware as u16),
            serial: self.serial.clone(),
            speed: Some(UsbSpeed::Super),
        }
    }

    fn description(&self) -> &'static Description {
        &DESCRIPTION
    }

    fn control_in(
        &mut self,
        request: VendorRequest,
        answer: &mut [u8],
        faults: &UsbFaults,
    ) -> Result<usize, UsbError> {
        let VendorRequest { request: 0xBF, value, index } = request else { return Err(UsbError::Stalled) };
        let told = match faults.told {
            Some((module, parameter, told))
                if (u16::from(module), parameter) == (value, u32::from(index)) =>
            {
                told
            }
            Some(_) | None => self.get(value as u8, index as u8),
        };
        for (slot, byte) in answer.iter_mut().zip(told.to_be_bytes()) {
            *slot = byte;
        }
        Ok(answer.len().min(4))
    }

    fn control_out(&mut self, request: VendorRequest, data: &[u8]) -> Result<(), UsbError> {
        let VendorRequest { request, value, index } = request;
        match (request, data) {
            (0xBF, &[a, b, c, d]) => self.set(value as u8, index as u8, u32::from_be_bytes([a, b, c, d])),
            (0xC2, entries) if entries.len() == usize::from(value) * 6 => {
                for &[module, parameter, a, b, c, d] in entries.as_chunks::<6>().0 {
                    self.set(module, parameter, u32::from_be_bytes([a, b, c, d]));
                }
            }
            // The maker's newest library sends these when it opens a camera; what they mean is not known.
            (0xB1 | 0xC6, []) => {}
            _ => return Err(UsbError::Stalled),
        }
        Ok(())
    }

    fn bulk_out(&mut self, _: u8, _: &[u8], _: &UsbFaults) -> Result<(), UsbError> {
        Err(UsbError::Stalled)
    }

    fn answer(&mut self, _: u8) -> Option<Vec<u8>> {
        None
    }

    fn data_endpoint(&self) -> u8 {
        0x82
    }

    fn is_running(&self) -> bool {
        // The multiplexer, its time stamps, and the link.
        self.is_set(0, 0) && self.is_set(0, 1) && self.is_set(9, 0)
    }

    fn begin(&mut self, now: CameraMicros) {
        self.words = Words::starting_at(now.0);
        self.filters = Filters::default();
        self.tallies = Tallies::default();
        self.newest_us = now.0;
        self.packet_sent_us = now.0;
    }

    fn send(&mut self, batch: &EventBatch) {
        let pixels_run = self.is_set(1, 3) && self.is_set(0, 3);
        for event in batch.events.iter() {
            if event.t.0 < self.newest_us {
                self.words.restart(event.t.0);
                self.packet_sent_us = event.t.0;
            }
            self.newest_us = event.t.0;
            if pixels_run {
                let registers = &self.registers;
                let get = |parameter| registers.get(&(1, parameter)).copied().unwrap_or(0);
                let passes = self.filters.pass(&event, &get);
                self.words.event(&event, passes);
                if passes {
                    self.tallies.add(&event, self.words.device_time(event.t.0));
                }
            }
        }
        if let Some(reached) = batch.reached {
            if reached.0 < self.newest_us {
                self.words.restart(reached.0);
                self.packet_sent_us = reached.0;
            }
            self.newest_us = reached.0;
            self.words.advance(reached.0);
        }
    }

    fn packet(&mut self) -> Option<Vec<u8>> {
        // Whole bursts go out at once; the timer lets one further word through and ends the packet with it.
        let is_due = self.newest_us - self.packet_sent_us >= self.packet_delay_us();
        let packet = self.words.take_burst(is_due)?;
        self.packet_sent_us = self.newest_us;
        Some(packet)
    }

    fn overflow(&mut self, batch: &EventBatch) {
        self.dropped += batch.events.len() as u64;
        if let Some(reached) = batch.reached {
            self.newest_us = reached.0;
        }
    }

    fn tallies(&self) -> &[Tally] {
        self.tallies.kept()
    }

    fn register(&self, module: u8, address: u32) -> u32 {
        self.get(module, address as u8)
    }
}
