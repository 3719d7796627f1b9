//! What comes before a connection carries transfers: the host asks what there is, and takes it.

use std::io::{self, Read, Write};

use evfocus_hal::usb::{UsbIdentity, UsbSpeed};

use super::super::descriptors::Description;
use super::UsbIpError;

/// The protocol's version, 1.1.1.
const VERSION: u16 = 0x0111;
const LIST: u16 = 0x8005;
const IMPORT: u16 = 0x8003;
/// An answer's code is its question's without this.
const QUESTION: u16 = 0x8000;
/// The only device, as hosts name it.
pub(super) const BUS_ID: &str = "1-1";
const PATH: &str = "/sys/devices/hil-sim/usb1/1-1";
/// Bus and device number; nobody looks at them again.
const BUS: u32 = 1;
const DEVICE: u32 = 1;

/// A camera that can be taken.
pub(super) struct Offer {
    pub(super) identity: UsbIdentity,
    pub(super) description: &'static Description,
}

/// Answers the host's question. `true`: it has taken the device, and transfers follow.
///
/// # Errors
/// The stream's; [`UsbIpError::Version`] and [`UsbIpError::UnknownCommand`] as invalid data.
pub(super) fn answer(stream: &mut (impl Read + Write), offer: Option<&Offer>) -> io::Result<bool> {
    let mut head = [0; 8];
    stream.read_exact(&mut head)?;
    let [v0, v1, c0, c1, ..] = head;
    let (version, code) = (u16::from_be_bytes([v0, v1]), u16::from_be_bytes([c0, c1]));
    if version != VERSION {
        return Err(io::Error::new(io::ErrorKind::InvalidData, UsbIpError::Version(version)));
    }
    match code {
        LIST => {
            let mut body = u32::from(offer.is_some()).to_be_bytes().to_vec();
            if let Some(offer) = offer {
                body.extend(offer.device());
                body.extend(offer.description.class);
                body.push(0);
            }
            reply(stream, code, 0, &body)?;
            Ok(false)
        }
        IMPORT => {
            let mut wanted = [0; 32];
            stream.read_exact(&mut wanted)?;
            let is_here = wanted.starts_with(&field::<4>(BUS_ID));
            match offer.filter(|_| is_here) {
                Some(offer) => reply(stream, code, 0, &offer.device()).map(|()| true),
                None => reply(stream, code, 1, &[]).map(|()| false),
            }
        }
        _ => Err(io::Error::new(io::ErrorKind::InvalidData, UsbIpError::UnknownCommand(u32::from(code)))),
    }
}

fn reply(stream: &mut impl Write, code: u16, status: u32, body: &[u8]) -> io::Result<()> {
    let [version, code] = [VERSION, code & !QUESTION].map(u16::to_be_bytes);
    stream.write_all(&[&version[..], &code, &status.to_be_bytes(), body].concat())
}

/// A text in a field of fixed length, filled up with zeros.
fn field<const N: usize>(text: &str) -> [u8; N] {
    let mut field = [0; N];
    for (slot, byte) in field.iter_mut().zip(text.bytes()) {
        *slot = byte;
    }
    field
}

impl Offer {
    /// The device as the protocol describes it.
    fn device(&self) -> Vec<u8> {
        let UsbIdentity { vendor, product, version, speed, .. } = self.identity;
        let speed: u32 = match speed {
            Some(UsbSpeed::Full) => 2,
            Some(UsbSpeed::High) | None => 3,
            Some(UsbSpeed::Super) => 5,
        };
        let mut device = field::<256>(PATH).to_vec();
        device.extend(field::<32>(BUS_ID));
        device.extend([BUS, DEVICE, speed].into_iter().flat_map(u32::to_be_bytes));
        device.extend([vendor, product, version].into_iter().flat_map(u16::to_be_bytes));
        // Class, subclass and protocol stand at the interface; not configured yet; one configuration, one interface.
        device.extend([0, 0, 0, 0, 1, 1]);
        device
    }
}
