//! An Optotune Lens Driver 4 with a liquid lens: binary commands of known lengths with a checksum each, set-points that are
//! obeyed without a word, and glass that swings to them.

use std::time::Duration;

use evfocus_core::HostMicros;

use super::{Device, Motor};
use crate::lens::Spring;

/// Natural frequency and damping of a polymer lens of 10 to 16 mm.
const NATURAL_HZ: f64 = 150.0;
const DAMPING: f64 = 0.2;
/// From the last byte of a set-point to the current.
const DELAY: Duration = Duration::from_micros(500);
/// Commands without data bytes and with how many, longest names first where one begins another.
const COMMANDS: [(&[u8], usize); 19] = [
    (b"CrMA", 2),
    (b"CrUA", 2),
    (b"CrLA", 2),
    (b"CwUA", 2),
    (b"CwLA", 2),
    (b"MwDA", 0),
    (b"MwSA", 0),
    (b"MwTA", 0),
    (b"MwQA", 0),
    (b"MwCA", 0),
    (b"MMA", 0),
    (b"PwDA", 4),
    (b"PrDA", 4),
    (b"TCA", 0),
    (b"Aw", 2),
    (b"Ar", 2),
    (b"H", 0),
    (b"X", 0),
    (b"V", 1),
];

/// What the set-point means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Mode {
    Current = 1,
    FocalPower = 5,
}

/// The model. One raw unit, of current or of focal power, is one count of the rig's lens.
#[derive(Debug)]
pub(super) struct OptotuneModel {
    motor: Motor,
    received: Vec<u8>,
    mode: Mode,
    limits: (i16, i16),
    set_point: i16,
    deaf_until: HostMicros,
}

/// CRC-16/ARC: reflected polynomial 0xA001, nothing before, nothing after.
fn checksum(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0, |crc, &byte| {
        (0..8).fold(crc ^ u16::from(byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xA001 } else { crc >> 1 })
    })
}

impl OptotuneModel {
    pub(super) fn new(motor: Motor) -> Self {
        let raw = |counts: f64| counts.round().clamp(-4095.0, 4095.0) as i16;
        let range = motor.range();
        // The current is what it was when the rig was made.
        let set_point = raw(motor.report(HostMicros(0)).0);
        let limits = (raw(range.min().0), raw(range.max().0));
        Self {
            motor,
            received: Vec::new(),
            mode: Mode::Current,
            limits,
            set_point,
            deaf_until: HostMicros(0),
        }
    }

    fn set(&mut self, raw: i16, now: HostMicros) {
        self.set_point = raw.clamp(self.limits.0, self.limits.1);
        let rest = f64::from(self.set_point);
        self.motor.swing(now + DELAY, Spring { rest, natural_hz: NATURAL_HZ, damping: DAMPING });
    }

    fn obey(&mut self, name: &[u8], data: &[u8], now: HostMicros, replies: &mut Vec<u8>) {
        let value = data.first_chunk().map_or(0, |&bytes| i16::from_be_bytes(bytes));
        let [set, low, high] = [self.set_point, self.limits.0, self.limits.1].map(i16::to_be_bytes);
        let mut say = |parts: &[&[u8]]| {
            let payload = parts.concat();
            replies.extend(&payload);
            replies.extend(checksum(&payload).to_le_bytes());
            replies.extend(b"\r\n");
        };
        match name {
            b"H" => say(&[b"HB"]),
            b"X" => say(&[b"XSIM00001"]),
            b"V" => say(&[b"V", &[1, 8, 0, 0, 0, 1]]),
            b"CrMA" => say(&[b"CMA", &29_284_u16.to_be_bytes()]),
            b"CrUA" => say(&[b"CUA", &high]),
            b"CrLA" => say(&[b"CLA", &low]),
            b"CwUA" => {
                self.limits.1 = value.max(self.limits.0);
                say(&[b"CUA", &self.limits.1.to_be_bytes()]);
            }
            b"CwLA" => {
                self.limits.0 = value.min(self.limits.1);
                say(&[b"CLA", &self.limits.0.to_be_bytes()]);
            }
            b"MMA" => say(&[b"MMA", &[self.mode as u8]]),
            b"MwDA" | b"MwSA" | b"MwTA" | b"MwQA" => {
                self.mode = Mode::Current;
                say(&[b"M", name.get(2..).unwrap_or_default()]);
            }
            b"MwCA" => {
                self.mode = Mode::FocalPower;
                say(&[b"MCA", &[0], &high, &low]);
            }
            b"TCA" => say(&[b"TCA", &480_i16.to_be_bytes()]),
            b"Ar" => say(&[b"A", &set]),
            b"PrDA" => say(&[b"PD", &set]),
            b"Aw" if self.mode == Mode::Current => self.set(value, now),
            b"PwDA" if self.mode == Mode::FocalPower => self.set(value, now),
            // A set-point of the other mode.
            _ => {}
        }
    }
}

impl Device for OptotuneModel {
    fn receive(&mut self, bytes: &[u8], now: HostMicros, replies: &mut Vec<u8>) {
        if now < self.deaf_until {
            return;
        }
        self.received.extend(bytes);
        loop {
            if self.received.starts_with(b"Start") {
                self.received.drain(..5);
                replies.extend(b"Ready\r\n");
                continue;
            }
            let known = COMMANDS.iter().find(|(name, _)| self.received.starts_with(name));
            let Some(&(name, data)) = known else {
                // What may still become a name is waited for; the rest is not a command.
                let begins = |name: &[u8]| name.starts_with(&self.received);
                if self.received.is_empty()
                    || begins(b"Start")
                    || COMMANDS.iter().any(|(name, _)| begins(name))
                {
                    return;
                }
                self.received.remove(0);
                continue;
            };
            // Some programs send the byte after the V, some do not.
            let is_bare = name == b"V" && self.received.get(..3).is_some_and(|frame| checksum(frame) == 0);
            let length = name.len() + if is_bare { 0 } else { data } + 2;
            if self.received.len() < length {
                return;
            }
            let frame: Vec<u8> = self.received.drain(..length).collect();
            // The checksum over a whole frame is zero.
            if checksum(&frame) == 0 {
                let data = frame.get(name.len()..length - 2).unwrap_or_default();
                self.obey(name, data, now, replies);
            } else {
                replies.extend(b"N\r\n");
            }
        }
    }

    fn reset(&mut self, now: HostMicros) {
        let limits = self.limits;
        *self =
            Self { limits, deaf_until: now + Duration::from_millis(200), ..Self::new(self.motor.clone()) };
        // Without a current the glass goes to the end of its way.
        self.set(limits.0, now);
    }

    fn miscount(&mut self, counts: f64) {
        self.set_point = self.set_point.saturating_add(counts as i16);
    }
}
