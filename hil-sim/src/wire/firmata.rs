//! An Arduino Uno with StandardFirmata 2.5 before an H-bridge and a potentiometer: PWM on pin 3, direction on pin 4, the wiper
//! on A0. It has no watchdog: the last PWM stays.

use std::time::Duration;

use evfocus_core::HostMicros;

use super::motor::DcMotor;
use super::{Device, Motor};

const PWM_PIN: u8 = 3;
const DIRECTION_PIN: u8 = 4;
const FIRST_ANALOG_PIN: u8 = 14;
const PINS: u8 = 20;
/// The converter has 10 bits over the potentiometer, whose ends are 0 and 4095 counts.
const FULL_READING: f64 = 1023.0;
const FULL_COUNTS: f64 = 4095.0;
/// After a reset nothing is heard for this long.
const BOOT: Duration = Duration::from_millis(1500);
const LONGEST_MESSAGE: usize = 64;

#[derive(Debug)]
pub(super) struct FirmataModel {
    motor: DcMotor,
    message: Vec<u8>,
    in_sysex: bool,
    duty: u8,
    positive: bool,
    /// The channel is reported; other channels are not there.
    streams: bool,
    interval: Duration,
    next_reading: HostMicros,
    booting_until: Option<HostMicros>,
    miscount: f64,
}

impl FirmataModel {
    pub(super) fn new(motor: Motor) -> Self {
        Self {
            motor: DcMotor::new(motor),
            message: Vec::new(),
            in_sysex: false,
            duty: 0,
            positive: false,
            streams: false,
            interval: Duration::from_millis(19),
            next_reading: HostMicros(0),
            booting_until: None,
            miscount: 0.0,
        }
    }

    fn take(&mut self, byte: u8, now: HostMicros, replies: &mut Vec<u8>) {
        if self.in_sysex && byte == 0xF7 {
            self.in_sysex = false;
            self.sysex(replies);
            self.message.clear();
        } else if byte >= 0x80 {
            self.in_sysex = byte == 0xF0;
            self.message.clear();
            match byte {
                0xF0 => {}
                0xF9 => replies.extend([0xF9, 2, 5]),
                0xFF => self.stop_all(now),
                _ => self.message.push(byte),
            }
        } else if self.in_sysex || (!self.message.is_empty() && self.message.len() < LONGEST_MESSAGE) {
            if self.message.len() < LONGEST_MESSAGE {
                self.message.push(byte);
            }
            if !self.in_sysex {
                self.obey(now);
            }
        }
    }

    fn obey(&mut self, now: HostMicros) {
        match *self.message.as_slice() {
            [0xC0, on] => {
                self.streams = on != 0;
                self.next_reading = now + self.interval;
            }
            [command, low, high] if command == 0xE0 | PWM_PIN => {
                self.duty = (u16::from(low) | u16::from(high) << 7).min(255) as u8;
                self.drive(now);
            }
            [0xF5, DIRECTION_PIN, level] => {
                self.positive = level != 0;
                self.drive(now);
            }
            // Pins 0 to 7 as one port.
            [0x90, low, _] => {
                self.positive = low >> DIRECTION_PIN & 1 == 1;
                self.drive(now);
            }
            // Pin modes, other pins and channels.
            [0xC1..=0xDF, _] | [_, _, _] => {}
            _ => return,
        }
        self.message.clear();
    }

    fn sysex(&mut self, replies: &mut Vec<u8>) {
        let pins = 0..PINS;
        match *self.message.as_slice() {
            [0x79] => {
                replies.extend([0xF0, 0x79, 2, 5]);
                replies.extend("StandardFirmata.ino".bytes().flat_map(|byte| [byte, 0]));
                replies.push(0xF7);
            }
            [0x69] => {
                replies.extend([0xF0, 0x6A]);
                replies.extend(pins.map(|pin| pin.checked_sub(FIRST_ANALOG_PIN).unwrap_or(0x7F)));
                replies.push(0xF7);
            }
            [0x6B] => {
                replies.extend([0xF0, 0x6C]);
                for pin in pins {
                    match pin {
                        0 | 1 => {}
                        3 | 5 | 6 | 9 | 10 | 11 => replies.extend([0, 1, 0x0B, 1, 1, 1, 3, 8, 4, 14]),
                        FIRST_ANALOG_PIN.. => replies.extend([0, 1, 0x0B, 1, 1, 1, 2, 10]),
                        _ => replies.extend([0, 1, 0x0B, 1, 1, 1]),
                    }
                    replies.push(0x7F);
                }
                replies.push(0xF7);
            }
            [0x6D, pin] => replies.extend([0xF0, 0x6E, pin, 1, 0, 0xF7]),
            [0x7A, low, high] => {
                let millis = u64::from(low) | u64::from(high) << 7;
                self.interval = Duration::from_millis(millis.max(1));
            }
            _ => {}
        }
    }

    fn drive(&mut self, now: HostMicros) {
        let duty = f64::from(self.duty) / 255.0;
        self.motor.drive(now, if self.positive { duty } else { -duty });
    }

    fn stop_all(&mut self, now: HostMicros) {
        (self.duty, self.positive, self.streams) = (0, false, false);
        self.drive(now);
    }
}

impl Device for FirmataModel {
    fn receive(&mut self, bytes: &[u8], now: HostMicros, replies: &mut Vec<u8>) {
        if self.booting_until.is_none() {
            for &byte in bytes {
                self.take(byte, now, replies);
            }
        }
    }

    fn due(&self) -> Option<HostMicros> {
        self.booting_until.or(self.streams.then_some(self.next_reading))
    }

    fn speak(&mut self, now: HostMicros, said: &mut Vec<u8>) {
        if self.booting_until.take().is_some() {
            said.extend([0xF9, 2, 5]);
            self.message = vec![0x79];
            self.sysex(said);
            self.message.clear();
            return;
        }
        self.next_reading = now + self.interval;
        let counts = self.motor.position(now) + self.miscount;
        let reading = (counts / FULL_COUNTS * FULL_READING).round().clamp(0.0, FULL_READING) as u16;
        said.extend([0xE0, (reading & 0x7F) as u8, (reading >> 7) as u8]);
    }

    fn reset(&mut self, now: HostMicros) {
        self.stop_all(now);
        *self = Self {
            booting_until: Some(now + BOOT),
            miscount: self.miscount,
            ..Self::new(self.motor.motor().clone())
        };
    }

    fn miscount(&mut self, counts: f64) {
        self.miscount += counts;
    }
}
