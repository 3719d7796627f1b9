//! A MoonLite focuser: byte-wise parser, answers to `G` commands only, a target that waits for `FG`.

use std::time::Duration;

use evfocus_core::HostMicros;

use super::{Device, Motor};

/// Bytes of a command between `:` and `#` that the firmware keeps: it has a line of 8 with both.
const LINE: usize = 8;
/// After a reset nothing is heard for this long.
const BOOT: Duration = Duration::from_millis(1500);

/// The model, and which of its quirks it has: it sends no `#` after its version, as the original.
#[derive(Debug)]
pub(super) struct MoonLiteModel {
    motor: Motor,
    /// What has come since the last `#`; `None` while it is longer than the line.
    command: Option<Vec<u8>>,
    target: u32,
    divisor: u8,
    half_steps: bool,
    /// What the controller counts more than the motor has done.
    miscount: f64,
    deaf_until: HostMicros,
}

impl MoonLiteModel {
    pub(super) fn new(motor: Motor) -> Self {
        Self {
            motor,
            command: Some(Vec::new()),
            target: 0,
            divisor: 0x02,
            half_steps: false,
            miscount: 0.0,
            deaf_until: HostMicros(0),
        }
    }

    fn position(&self, now: HostMicros) -> u32 {
        (self.motor.report(now).0 + self.miscount).round().max(0.0) as u32
    }

    fn obey(&mut self, command: &[u8], now: HostMicros, replies: &mut Vec<u8>) {
        let text = String::from_utf8_lossy(command).to_ascii_uppercase();
        let (name, payload) = text.split_at_checked(2).unwrap_or((text.as_str(), ""));
        let value = u32::from_str_radix(payload, 16).ok();
        let mut say = |text: String| replies.extend(text.bytes());
        match (name, value) {
            ("GP", None) => say(format!("{:04X}#", self.position(now))),
            ("GN", None) => say(format!("{:04X}#", self.target)),
            ("GI", None) => say(if self.motor.report(now).1 { "01#" } else { "00#" }.to_owned()),
            ("GT", None) => say("0028#".to_owned()),
            ("GC" | "GB", None) => say("00#".to_owned()),
            ("GD", None) => say(format!("{:02X}#", self.divisor)),
            ("GH", None) => say(if self.half_steps { "FF#" } else { "00#" }.to_owned()),
            ("GV", None) => say("10".to_owned()),
            ("SN", Some(target)) => self.target = target,
            ("SP", Some(position)) => {
                self.miscount = f64::from(position) - self.motor.report(now).0;
                self.target = position;
            }
            ("SD", Some(divisor @ (0x02 | 0x04 | 0x08 | 0x10 | 0x20))) => self.divisor = divisor as u8,
            ("SH", None) => self.half_steps = true,
            ("SF", None) => self.half_steps = false,
            ("FG", None) => {
                let speed = self.motor.max_speed() * 2.0 / f64::from(self.divisor);
                self.motor.travel(now, f64::from(self.target) - self.miscount, speed);
            }
            ("FQ", None) => {
                self.motor.brake(now);
                self.target = self.position(now);
            }
            // Not a command, or one without an answer and without an effect here.
            _ => {}
        }
    }
}

impl Device for MoonLiteModel {
    fn receive(&mut self, bytes: &[u8], now: HostMicros, replies: &mut Vec<u8>) {
        if now < self.deaf_until {
            return;
        }
        for &byte in bytes {
            match byte {
                b':' => self.command = Some(Vec::new()),
                b'#' => {
                    if let Some(command) = self.command.replace(Vec::new()) {
                        self.obey(&command, now, replies);
                    }
                }
                _ => {
                    self.command = self.command.take().filter(|command| command.len() < LINE);
                    if let Some(command) = &mut self.command {
                        command.push(byte);
                    }
                }
            }
        }
    }

    fn reset(&mut self, now: HostMicros) {
        let count = self.motor.report(now).0;
        self.motor.brake(now);
        // The count starts anew where the motor stands.
        *self = Self { miscount: -count, deaf_until: now + BOOT, ..Self::new(self.motor.clone()) };
    }

    fn miscount(&mut self, counts: f64) {
        self.miscount += counts;
    }
}
