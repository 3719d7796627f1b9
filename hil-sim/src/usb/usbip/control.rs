//! Requests on endpoint 0: those of the standard, and the device's own.

use evfocus_hal::usb::{UsbError, UsbIdentity, VendorRequest};

use super::super::descriptors::{Description, descriptor};
use super::super::link::Link;

/// Standard requests (USB 2.0 chapter 9.4, USB 3.2 chapter 9.4).
const GET_STATUS: u8 = 0;
const CLEAR_FEATURE: u8 = 1;
const SET_FEATURE: u8 = 3;
const SET_ADDRESS: u8 = 5;
const GET_DESCRIPTOR: u8 = 6;
const GET_CONFIGURATION: u8 = 8;
const SET_CONFIGURATION: u8 = 9;
const GET_INTERFACE: u8 = 10;
const SET_INTERFACE: u8 = 11;
const SET_SEL: u8 = 48;
const SET_ISOCHRONOUS_DELAY: u8 = 49;
/// The feature of an endpoint that refuses.
const ENDPOINT_HALT: u16 = 0;
/// A device's own requests, to the device, by direction.
const VENDOR_OUT: u8 = 0x40;
const VENDOR_IN: u8 = 0xC0;

/// A request.
#[derive(Debug, Clone, Copy)]
pub(super) struct Setup {
    kind: u8,
    request: u8,
    value: u16,
    index: u16,
    length: u16,
}

impl From<[u8; 8]> for Setup {
    fn from([kind, request, v0, v1, i0, i1, l0, l1]: [u8; 8]) -> Self {
        let [value, index, length] = [[v0, v1], [i0, i1], [l0, l1]].map(u16::from_le_bytes);
        Self { kind, request, value, index, length }
    }
}

/// The state that standard requests change and ask for.
#[derive(Debug, Default)]
pub(super) struct Endpoint0 {
    configuration: u8,
}

impl Endpoint0 {
    /// The answer to a request that came with `data`; empty for one that has none.
    pub(super) fn respond(
        &mut self,
        setup: Setup,
        data: &[u8],
        link: &mut Link,
        identity: &UsbIdentity,
        description: &Description,
    ) -> Result<Vec<u8>, UsbError> {
        let Setup { kind, request, value, index, length } = setup;
        let own = VendorRequest { request, value, index };
        let mut answer = match (kind, request) {
            (VENDOR_IN, _) => {
                let mut answer = vec![0; usize::from(length)];
                let got = link.control_in(own, &mut answer)?;
                answer.truncate(got);
                answer
            }
            (VENDOR_OUT, _) => {
                link.control_out(own, data.get(..usize::from(length)).unwrap_or(data))?;
                Vec::new()
            }
            (0x80, GET_DESCRIPTOR) => {
                let [index, kind] = value.to_le_bytes();
                descriptor(kind, index, identity, description).ok_or(UsbError::Stalled)?
            }
            (0x80 | 0x81, GET_STATUS) => vec![0, 0],
            (0x82, GET_STATUS) => vec![u8::from(link.is_halted(index as u8)), 0],
            (0x02, CLEAR_FEATURE) if value == ENDPOINT_HALT => {
                link.set_halt(index as u8, false)?;
                Vec::new()
            }
            (0x02, SET_FEATURE) if value == ENDPOINT_HALT => {
                link.set_halt(index as u8, true)?;
                Vec::new()
            }
            (0x80, GET_CONFIGURATION) => vec![self.configuration],
            (0x00, SET_CONFIGURATION) if value <= 1 => {
                self.configuration = value as u8;
                Vec::new()
            }
            (0x81, GET_INTERFACE) if index == 0 => vec![0],
            (0x01, SET_INTERFACE) if (value, index) == (0, 0) => Vec::new(),
            // Addresses are the host controller's affair here, and there is no power to save.
            (0x00, SET_ADDRESS | CLEAR_FEATURE | SET_FEATURE | SET_SEL | SET_ISOCHRONOUS_DELAY)
            | (0x01, CLEAR_FEATURE | SET_FEATURE) => Vec::new(),
            _ => return Err(UsbError::Stalled),
        };
        answer.truncate(usize::from(length));
        Ok(answer)
    }
}
