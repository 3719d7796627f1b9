//! A LabJack T7 over Modbus TCP, before a motor stage and a potentiometer: DAC0 how fast, DAC1 which way, the wiper on AIN0.

use evfocus_core::HostMicros;

use super::motor::DcMotor;
use super::{Device, Motor};

/// The potentiometer lies between 0 and 5 V, which are 0 and 4095 counts.
const REFERENCE_VOLTS: f64 = 5.0;
const FULL_COUNTS: f64 = 4095.0;
const FULL_DRIVE_VOLTS: f32 = 5.0;
const HEADER: usize = 6;
const LONGEST_FRAME: usize = 260;
const ILLEGAL_FUNCTION: u8 = 1;
const ILLEGAL_ADDRESS: u8 = 2;
const ILLEGAL_VALUE: u8 = 3;

#[derive(Debug)]
pub(super) struct LabJackModel {
    motor: DcMotor,
    received: Vec<u8>,
    outputs: [f32; 2],
    miscount: f64,
}

impl LabJackModel {
    pub(super) fn new(motor: Motor) -> Self {
        Self { motor: DcMotor::new(motor), received: Vec::new(), outputs: [0.0; 2], miscount: 0.0 }
    }

    /// The 32-bit value whose high word is at `register`.
    fn value(&self, register: u16, now: HostMicros) -> Option<[u8; 4]> {
        Some(match register {
            0 => {
                let counts = self.motor.position(now) + self.miscount;
                ((counts / FULL_COUNTS * REFERENCE_VOLTS) as f32).to_be_bytes()
            }
            2 | 4 | 6 => 0_f32.to_be_bytes(),
            1000 => self.outputs[0].to_be_bytes(),
            1002 => self.outputs[1].to_be_bytes(),
            55_100 => 0x0011_2233_u32.to_be_bytes(),
            55_124 => (-9999_f32).to_be_bytes(),
            60_000 => 7_f32.to_be_bytes(),
            60_004 => 1.03_f32.to_be_bytes(),
            60_028 => 470_010_042_u32.to_be_bytes(),
            61_520 => ((now.0 * 40) as u32).to_be_bytes(),
            _ => return None,
        })
    }

    fn obey(&mut self, request: &[u8], now: HostMicros) -> Result<Vec<u8>, u8> {
        let word = |index: usize| {
            let bytes = request.get(index..index + 2).and_then(|bytes| bytes.first_chunk());
            bytes.map_or(0, |&bytes| u16::from_be_bytes(bytes))
        };
        let (function, register, count) = (request.first(), word(1), word(3));
        match function {
            Some(3 | 4) => {
                if count == 0 || count % 2 == 1 || count > 64 {
                    return Err(ILLEGAL_VALUE);
                }
                let mut reply = vec![3, 2 * count as u8];
                for pair in 0..count / 2 {
                    let at = register.checked_add(2 * pair).ok_or(ILLEGAL_ADDRESS)?;
                    reply.extend(self.value(at, now).ok_or(ILLEGAL_ADDRESS)?);
                }
                Ok(reply)
            }
            Some(16) => {
                let data = request.get(6..).unwrap_or_default();
                if data.len() != 2 * usize::from(count) {
                    return Err(ILLEGAL_VALUE);
                }
                for (pair, bytes) in data.chunks_exact(4).enumerate() {
                    let value = bytes.first_chunk().map_or(0.0, |&bytes| f32::from_be_bytes(bytes));
                    let output = match usize::from(register) + 2 * pair {
                        1000 => &mut self.outputs[0],
                        1002 => &mut self.outputs[1],
                        _ => return Err(ILLEGAL_ADDRESS),
                    };
                    *output = value.clamp(0.0, 5.0);
                }
                self.drive(now);
                Ok([&[16][..], &register.to_be_bytes(), &count.to_be_bytes()].concat())
            }
            _ => Err(ILLEGAL_FUNCTION),
        }
    }

    fn drive(&mut self, now: HostMicros) {
        let [speed, direction] = self.outputs;
        let drive = f64::from(speed / FULL_DRIVE_VOLTS);
        self.motor.drive(now, if direction > 1.5 { drive } else { -drive });
    }
}

impl Device for LabJackModel {
    fn receive(&mut self, bytes: &[u8], now: HostMicros, replies: &mut Vec<u8>) {
        self.received.extend(bytes);
        while let Some(&[t0, t1, p0, p1, l0, l1]) = self.received.first_chunk::<HEADER>() {
            let length = usize::from(u16::from_be_bytes([l0, l1]));
            if [p0, p1] != [0, 0] || !(2..=LONGEST_FRAME).contains(&length) {
                // Not Modbus; there is no way back into step.
                self.received.clear();
                return;
            }
            if self.received.len() < HEADER + length {
                return;
            }
            let frame: Vec<u8> = self.received.drain(..HEADER + length).collect();
            let unit = frame.get(HEADER).copied().unwrap_or_default();
            let request = frame.get(HEADER + 1..).unwrap_or_default();
            let function = request.first().copied().unwrap_or_default();
            let reply = self.obey(request, now).unwrap_or_else(|code| vec![function | 0x80, code]);
            replies.extend([t0, t1, 0, 0]);
            replies.extend((1 + reply.len() as u16).to_be_bytes());
            replies.push(unit);
            replies.extend(reply);
        }
    }

    fn reset(&mut self, now: HostMicros) {
        self.outputs = [0.0; 2];
        self.received.clear();
        self.drive(now);
    }

    fn miscount(&mut self, counts: f64) {
        self.miscount += counts;
    }
}
