//! An EVK4: its board's messages and the registers of its sensor.

mod filters;
mod power_up;
mod words;

use std::collections::{BTreeMap, VecDeque};

use evfocus_core::{CameraMicros, EventBatch};
use evfocus_hal::usb::{UsbError, UsbIdentity, UsbSpeed, VendorRequest};

use super::UsbFaults;
use super::descriptors::{Description, Endpoint, Kind};
use super::device::Device;
use super::tally::{Tallies, Tally};
use filters::Filters;
use power_up::POWER_UP;
use words::Words;

/// Endpoints: requests, answers, data.
const REQUESTS: u8 = 0x02;
const ANSWERS: u8 = 0x82;
const DATA: u8 = 0x81;
/// The firmware's release, 3.9.0.
const RELEASE: u32 = 0x3_0900;
/// Unix time at which it was built.
const BUILD_DATE: u64 = 1_650_000_000;
/// Added to the property of a request that failed; alone: not known.
const FAILED: u32 = 0x8000_0000;
/// An error number like Linux's for a message that makes no sense.
const EINVAL: u32 = 22;
/// The link's packets.
const PACKET_BYTES: usize = 8192;

/// The host takes them by their order: answers, requests, data.
const ENDPOINTS: [Endpoint; 3] = [
    Endpoint { address: ANSWERS, kind: Kind::Bulk, burst: 1 },
    Endpoint { address: REQUESTS, kind: Kind::Bulk, burst: 1 },
    Endpoint { address: DATA, kind: Kind::Bulk, burst: 16 },
];
const DESCRIPTION: Description =
    Description { manufacturer: "Prophesee", product: "EVK4", class: [0xFF, 0x19, 0], endpoints: &ENDPOINTS };

/// An emulated EVK4.
#[derive(Debug)]
pub(super) struct Evk4 {
    serial: u32,
    registers: BTreeMap<u32, u32>,
    answers: VecDeque<Vec<u8>>,
    words: Words,
    filters: Filters,
    tallies: Tallies,
}

impl Evk4 {
    pub(super) fn new(seed: u64) -> Self {
        Self {
            serial: seed as u32,
            registers: POWER_UP.into_iter().collect(),
            answers: VecDeque::new(),
            words: Words::default(),
            filters: Filters::default(),
            tallies: Tallies::default(),
        }
    }

    fn get(&self, address: u32) -> u32 {
        let value = self.registers.get(&address).copied().unwrap_or(0);
        match address {
            // The window is taken over at once; so is a measurement done.
            0x0034 => value | (value & 1) << 1,
            0x0050 => value | (self.get(0x004C) >> 2 & 1) << 11 | 0x180,
            // The light meter's result is there, and the anti-flicker filter is ready.
            0x0010 => value | 1 << 29,
            0xC0C4 => value | 1 << 2,
            _ => value,
        }
    }

    fn put(&mut self, address: u32, value: u32) {
        let told = [0x0010, 0x0014, 0x0050, 0xF128];
        if !told.contains(&address) {
            self.registers.insert(address, value);
        }
    }

    /// The payload of the answer to `payload` about `property`, or an error number.
    fn respond(
        &mut self,
        property: u32,
        payload: &[u32],
        faults: &UsbFaults,
    ) -> Option<Result<Vec<u8>, u32>> {
        let of = |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<_>>();
        let named = |text: &[u8]| [&0_u32.to_le_bytes(), text].concat();
        Some(Ok(match (property, payload) {
            (0x71, []) => of(&[0]),
            (0x72, []) => u64::from(self.serial).to_le_bytes().to_vec(),
            (0x79, []) => of(&[faults.firmware.unwrap_or(RELEASE)]),
            (0x7A, []) => BUILD_DATE.to_le_bytes().to_vec(),
            (0x1_0000, []) => of(&[1]),
            (0x1_0001, [0]) => named(b"EVK4\0"),
            (0x1_0003, [0]) => named(b"psee,ccam5_imx636\0psee,ccam5_gen42\0"),
            (0x1_0102, &[0, address, count]) if count <= 250 => {
                let read = |address| match faults.told {
                    Some((_, place, told)) if place == address => told,
                    Some(_) | None => self.get(address),
                };
                let values = (0..count).map(|index| read(address.wrapping_add(4 * index)));
                of(&[0, address].into_iter().chain(values).collect::<Vec<_>>())
            }
            (0x4001_0102, &[0, address, ref values @ ..]) => {
                for (index, &value) in (0..).zip(values) {
                    self.put(address.wrapping_add(4 * index), value);
                }
                of(&[0, address])
            }
            (0x71..=0x7A | 0x1_0000..=0x1_0003 | 0x1_0102 | 0x4001_0102, _) => return Some(Err(EINVAL)),
            _ => return None,
        }))
    }
}

/// A message as it goes over the wire.
fn message(property: u32, payload: &[u8]) -> Vec<u8> {
    [&property.to_le_bytes(), &(payload.len() as u32).to_le_bytes(), payload].concat()
}

impl Device for Evk4 {
    fn identity(&self, _: &UsbFaults) -> UsbIdentity {
        UsbIdentity {
            vendor: 0x04B4,
            product: 0x00F5,
            version: 0x0309,
            serial: String::new(),
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
        _: &UsbFaults,
    ) -> Result<usize, UsbError> {
        let VendorRequest { request: 0x72, value: 0, index: 0 } = request else {
            return Err(UsbError::Stalled);
        };
        for (slot, byte) in answer.iter_mut().zip([0x31, 0x00]) {
            *slot = byte;
        }
        Ok(answer.len().min(2))
    }

    fn control_out(&mut self, _: VendorRequest, _: &[u8]) -> Result<(), UsbError> {
        Err(UsbError::Stalled)
    }

    fn bulk_out(&mut self, endpoint: u8, data: &[u8], faults: &UsbFaults) -> Result<(), UsbError> {
        if endpoint != REQUESTS {
            return Err(UsbError::Stalled);
        }
        let words: Vec<u32> = data.as_chunks::<4>().0.iter().map(|&word| u32::from_le_bytes(word)).collect();
        let answer = match words.as_slice() {
            [property, size, payload @ ..] if *size as usize == payload.len() * 4 => {
                match self.respond(*property, payload, faults) {
                    Some(Ok(answer)) => message(*property, &answer),
                    Some(Err(number)) => message(property | FAILED, &number.to_le_bytes()),
                    None => message(FAILED, &[]),
                }
            }
            _ => message(FAILED, &[]),
        };
        self.answers.push_back(answer);
        Ok(())
    }

    fn answer(&mut self, endpoint: u8) -> Option<Vec<u8>> {
        if endpoint == ANSWERS { self.answers.pop_front() } else { None }
    }

    fn data_endpoint(&self) -> u8 {
        DATA
    }

    fn is_running(&self) -> bool {
        let is_set = |address, bit: u32| self.get(address) >> bit & 1 == 1;
        // Link, output not disabled, time base, pixels released.
        is_set(0xB000, 0) && !is_set(0x9028, 1) && is_set(0x9008, 0) && is_set(0x0004, 10)
    }

    fn begin(&mut self, now: CameraMicros) {
        self.words = Words::starting_at(now.0);
        self.filters = Filters::default();
        self.tallies = Tallies::default();
    }

    fn send(&mut self, batch: &EventBatch) {
        for event in batch.events.iter() {
            let registers = &self.registers;
            let get = |address| registers.get(&address).copied().unwrap_or(0);
            self.words.advance(event.t.0);
            if self.filters.pass(&event, &get) {
                self.words.event(&event);
                self.tallies.add(&event, self.words.told());
            }
        }
        self.words.end_run();
        if let Some(reached) = batch.reached {
            self.words.advance(reached.0);
        }
    }

    fn packet(&mut self) -> Option<Vec<u8>> {
        self.words.take(PACKET_BYTES / 2)
    }

    fn overflow(&mut self, _: &EventBatch) {}

    fn tallies(&self) -> &[Tally] {
        self.tallies.kept()
    }

    fn register(&self, _: u8, address: u32) -> u32 {
        self.get(address)
    }
}
