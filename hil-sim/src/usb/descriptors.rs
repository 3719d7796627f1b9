//! What a device says of itself on endpoint 0: the descriptors of USB 2.0 chapter 9 and USB 3.2 chapter 9.6.

use evfocus_hal::usb::{UsbIdentity, UsbSpeed};

/// Kinds of descriptors, as a host asks for them.
const DEVICE: u8 = 1;
const CONFIGURATION: u8 = 2;
const STRING: u8 = 3;
const INTERFACE: u8 = 4;
const ENDPOINT: u8 = 5;
const OBJECT_STORE: u8 = 15;
const CAPABILITY: u8 = 16;
const COMPANION: u8 = 48;
/// Strings: manufacturer, product, serial number. String 0 is the list of languages: English.
const MANUFACTURER: u8 = 1;
const PRODUCT: u8 = 2;
const SERIAL: u8 = 3;
const ENGLISH: [u8; 2] = 0x0409_u16.to_le_bytes();
/// Powered by the bus.
const BUS_POWERED: u8 = 0x80;
/// Milliamperes that the cameras may take.
const CURRENT_MA: u16 = 400;

/// How an endpoint transfers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Bulk = 2,
    Interrupt = 3,
}

/// An endpoint of the only interface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Endpoint {
    /// With the direction in bit 7.
    pub(super) address: u8,
    pub(super) kind: Kind,
    /// Packets that it sends in one go at SuperSpeed.
    pub(super) burst: u8,
}

/// What does not depend on the port or the single device.
#[derive(Debug, Clone, Copy)]
pub(super) struct Description {
    pub(super) manufacturer: &'static str,
    pub(super) product: &'static str,
    /// Class, subclass and protocol of the interface.
    pub(super) class: [u8; 3],
    pub(super) endpoints: &'static [Endpoint],
}

impl Endpoint {
    /// Bytes of a full packet.
    pub(super) fn packet(self, speed: UsbSpeed) -> u16 {
        match (self.kind, speed) {
            (Kind::Interrupt, _) | (Kind::Bulk, UsbSpeed::Full) => 64,
            (Kind::Bulk, UsbSpeed::High) => 512,
            (Kind::Bulk, UsbSpeed::Super) => 1024,
        }
    }
}

/// The descriptor of `kind` and `index`; `None` for one that there is not.
pub(super) fn descriptor(
    kind: u8,
    index: u8,
    identity: &UsbIdentity,
    description: &Description,
) -> Option<Vec<u8>> {
    let speed = identity.speed.unwrap_or(UsbSpeed::High);
    match (kind, index) {
        (DEVICE, 0) => Some(device(identity, speed)),
        (CONFIGURATION, 0) => Some(configuration(description, speed)),
        (STRING, 0) => Some(string(&ENGLISH)),
        (STRING, MANUFACTURER) => Some(text(description.manufacturer)),
        (STRING, PRODUCT) => Some(text(description.product)),
        (STRING, SERIAL) if !identity.serial.is_empty() => Some(text(&identity.serial)),
        (OBJECT_STORE, 0) if speed == UsbSpeed::Super => Some(object_store()),
        _ => None,
    }
}

fn device(identity: &UsbIdentity, speed: UsbSpeed) -> Vec<u8> {
    // The largest packet of endpoint 0 is told as its power of two at SuperSpeed.
    let (usb, packet): (u16, u8) = if speed == UsbSpeed::Super { (0x0300, 9) } else { (0x0200, 64) };
    let serial = if identity.serial.is_empty() { 0 } else { SERIAL };
    let [usb, vendor, product, version] =
        [usb, identity.vendor, identity.product, identity.version].map(u16::to_le_bytes);
    [
        &[18, DEVICE][..],
        &usb,
        &[0, 0, 0, packet],
        &vendor,
        &product,
        &version,
        &[MANUFACTURER, PRODUCT, serial, 1],
    ]
    .concat()
}

fn configuration(description: &Description, speed: UsbSpeed) -> Vec<u8> {
    let Description { class, endpoints, .. } = description;
    let mut inner = vec![9, INTERFACE, 0, 0, endpoints.len() as u8];
    inner.extend(class);
    inner.push(0);
    for endpoint in *endpoints {
        let [low, high] = endpoint.packet(speed).to_le_bytes();
        let interval = if endpoint.kind == Kind::Interrupt { 4 } else { 0 };
        inner.extend([7, ENDPOINT, endpoint.address, endpoint.kind as u8, low, high, interval]);
        if speed == UsbSpeed::Super {
            let [low, high] = if endpoint.kind == Kind::Interrupt { [low, high] } else { [0, 0] };
            inner.extend([6, COMPANION, endpoint.burst.saturating_sub(1), 0, low, high]);
        }
    }
    // Told in units of 8 mA at SuperSpeed, of 2 mA otherwise.
    let power = CURRENT_MA / if speed == UsbSpeed::Super { 8 } else { 2 };
    let [low, high] = (9 + inner.len() as u16).to_le_bytes();
    let mut whole = vec![9, CONFIGURATION, low, high, 1, 1, 0, BUS_POWERED, power as u8];
    whole.extend(inner);
    whole
}

/// USB 2 extension (link power management), and SuperSpeed with its speeds and its times to wake up.
fn object_store() -> Vec<u8> {
    let capabilities =
        [&[7, CAPABILITY, 2, 2, 0, 0, 0][..], &[10, CAPABILITY, 3, 0, 0x0E, 0, 1, 10, 0xFF, 0x07]].concat();
    let [low, high] = (5 + capabilities.len() as u16).to_le_bytes();
    [&[5, OBJECT_STORE, low, high, 2][..], &capabilities].concat()
}

fn text(text: &str) -> Vec<u8> {
    string(&text.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<_>>())
}

fn string(content: &[u8]) -> Vec<u8> {
    [&[content.len() as u8 + 2, STRING][..], content].concat()
}
