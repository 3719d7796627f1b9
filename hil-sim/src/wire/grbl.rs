//! A GRBL 1.1 controller: lines that are acknowledged when they are parsed, bytes that act at once, jogs that queue.

use std::collections::VecDeque;
use std::time::Duration;

use evfocus_core::HostMicros;

use super::{Device, Motor};

/// `$100`: one step is one count of the rig's lens.
const STEPS_PER_MM: f64 = 100.0;
const LONGEST_LINE: usize = 128;
/// Blocks that the planner holds.
const PLANNER: usize = 15;
/// How often the planner looks whether a block has ended.
const TICK: Duration = Duration::from_millis(1);
/// After a reset nothing is heard for this long.
const BOOT: Duration = Duration::from_millis(1500);
const BANNER: &[u8] = b"\r\nGrbl 1.1h ['$' for help]\r\n";
/// Every so many reports have the work offset, every other so many the overrides.
const SELDOM: u32 = 10;

/// What the machine does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Booting(HostMicros),
    Idle,
    Jog,
    Home,
    Alarm,
}

#[derive(Debug)]
pub(super) struct GrblModel {
    motor: Motor,
    line: Vec<u8>,
    state: State,
    /// Jogs that wait: target in counts and speed.
    planner: VecDeque<(f64, f64)>,
    tick: HostMicros,
    reports: u32,
    miscount: f64,
    /// How far the motor had slipped at the last tick: more means that it has come to a switch at an end of the way.
    slip: f64,
}

impl GrblModel {
    pub(super) fn new(motor: Motor) -> Self {
        let state = if motor.needs_homing() { State::Alarm } else { State::Idle };
        let (line, planner) = (Vec::new(), VecDeque::new());
        Self { motor, line, state, planner, tick: HostMicros(0), reports: 0, miscount: 0.0, slip: 0.0 }
    }

    fn jog(&mut self, words: &str, now: HostMicros) -> Result<(), u16> {
        if !matches!(self.state, State::Idle | State::Jog) {
            return Err(if self.state == State::Alarm { 9 } else { 8 });
        }
        let (mut relative, mut mm, mut feed) = (false, None, None);
        let starts = words.char_indices().filter(|(_, letter)| letter.is_ascii_alphabetic());
        for (index, letter) in starts {
            let rest = words.get(index + 1..).unwrap_or_default();
            let end = rest.find(|letter: char| letter.is_ascii_alphabetic()).unwrap_or(rest.len());
            let value: f64 = rest.get(..end).unwrap_or_default().trim().parse().map_err(|_| 2_u16)?;
            match (letter, value.round() as i64) {
                ('G', 90) => relative = false,
                ('G', 91) => relative = true,
                ('G', 21 | 53) => {}
                ('X', _) => mm = Some(value),
                ('F', _) => feed = Some(value),
                _ => return Err(16),
            }
        }
        let (mm, feed) = (mm.ok_or(2_u16)?, feed.ok_or(22_u16)?);
        let from = if relative { self.motor.report(now).0 } else { -self.miscount };
        let target = from + mm * STEPS_PER_MM;
        let range = self.motor.range();
        if target < range.min().0 - 0.5 || target > range.max().0 + 0.5 {
            return Err(15);
        }
        if self.planner.len() < PLANNER {
            self.planner.push_back((target, feed / 60.0 * STEPS_PER_MM));
        }
        if self.state == State::Idle {
            self.state = State::Jog;
            self.next_block(now);
        }
        Ok(())
    }

    /// Sets out on the next block, or comes to rest.
    fn next_block(&mut self, now: HostMicros) {
        self.tick = now + TICK;
        match self.planner.pop_front() {
            Some((target, speed)) => self.motor.travel(now, target, speed),
            None => self.state = State::Idle,
        }
    }

    fn obey(&mut self, line: &str, now: HostMicros, replies: &mut Vec<u8>) {
        let result = if let Some(words) = line.strip_prefix("$J=") {
            self.jog(words, now)
        } else {
            match line {
                "" => Ok(()),
                "$$" => {
                    let feed = self.motor.max_speed() / STEPS_PER_MM * 60.0;
                    let homing = u8::from(self.motor.needs_homing());
                    let settings = format!(
                        "$10=1\r\n$21=1\r\n$22={homing}\r\n$100={STEPS_PER_MM:.3}\r\n$110={feed:.3}\r\n$120=200.000\r\n"
                    );
                    replies.extend(settings.bytes());
                    Ok(())
                }
                "$X" => {
                    self.state = if self.state == State::Alarm { State::Idle } else { self.state };
                    replies.extend(b"[MSG:Caution: Unlocked]\r\n");
                    Ok(())
                }
                "$H" if !self.motor.needs_homing() => Err(5),
                "$H" => {
                    self.state = State::Home;
                    self.tick = now + TICK;
                    let (switch, speed) = (self.motor.range().min().0, self.motor.max_speed());
                    self.motor.travel(now, switch, speed);
                    // Its ok comes when the switch is found.
                    return;
                }
                _ => Err(if self.state == State::Alarm { 9 } else { 2 }),
            }
        };
        match result {
            Ok(()) => replies.extend(b"ok\r\n"),
            Err(code) => replies.extend(format!("error:{code}\r\n").bytes()),
        }
    }

    fn report(&mut self, now: HostMicros, replies: &mut Vec<u8>) {
        let state = match self.state {
            State::Booting(_) => return,
            State::Idle => "Idle",
            State::Jog => "Jog",
            State::Home => "Home",
            State::Alarm => "Alarm",
        };
        let mm = (self.motor.report(now).0 + self.miscount).round() / STEPS_PER_MM;
        let extra = match self.reports % SELDOM {
            0 => "|WCO:0.000,0.000,0.000",
            1 => "|Ov:100,100,100",
            _ => "",
        };
        self.reports = self.reports.wrapping_add(1);
        replies.extend(format!("<{state}|MPos:{mm:.3},0.000,0.000|FS:0,0{extra}>\r\n").bytes());
    }

    fn soft_reset(&mut self, now: HostMicros, replies: &mut Vec<u8>) {
        let moved = self.motor.report(now).1;
        self.motor.brake(now);
        (self.line, self.planner) = (Vec::new(), VecDeque::new());
        if moved {
            replies.extend(b"ALARM:3\r\n");
        }
        self.state = if moved || self.motor.needs_homing() { State::Alarm } else { State::Idle };
        replies.extend(BANNER);
    }
}

impl Device for GrblModel {
    fn receive(&mut self, bytes: &[u8], now: HostMicros, replies: &mut Vec<u8>) {
        if matches!(self.state, State::Booting(_)) {
            return;
        }
        for &byte in bytes {
            match byte {
                b'?' => self.report(now, replies),
                0x18 => self.soft_reset(now, replies),
                0x85 => {
                    if self.state == State::Jog {
                        self.planner.clear();
                        self.motor.brake(now);
                    }
                }
                b'\n' | b'\r' => {
                    let line = std::mem::take(&mut self.line);
                    self.obey(String::from_utf8_lossy(&line).trim(), now, replies);
                }
                _ if byte >= 0x80 || self.line.len() >= LONGEST_LINE => {}
                _ => self.line.push(byte),
            }
        }
    }

    fn due(&self) -> Option<HostMicros> {
        match self.state {
            State::Booting(until) => Some(until),
            State::Jog | State::Home => Some(self.tick),
            State::Idle | State::Alarm => None,
        }
    }

    fn speak(&mut self, now: HostMicros, said: &mut Vec<u8>) {
        self.tick = now + TICK;
        let slipped = self.motor.slip(now) - std::mem::replace(&mut self.slip, self.motor.slip(now));
        match self.state {
            State::Jog if slipped.abs() > 0.1 => {
                self.motor.brake(now);
                self.planner.clear();
                self.state = State::Alarm;
                said.extend(b"ALARM:1\r\n");
            }
            State::Booting(_) => {
                self.state = if self.motor.needs_homing() { State::Alarm } else { State::Idle };
                said.extend(BANNER);
            }
            State::Jog if !self.motor.report(now).1 => self.next_block(now),
            State::Home if !self.motor.report(now).1 => {
                self.state = State::Idle;
                said.extend(b"ok\r\n");
            }
            State::Idle | State::Jog | State::Home | State::Alarm => {}
        }
    }

    fn reset(&mut self, now: HostMicros) {
        let count = self.motor.report(now).0;
        self.motor.brake(now);
        let state = State::Booting(now + BOOT);
        *self = Self { state, miscount: -count, ..Self::new(self.motor.clone()) };
    }

    fn miscount(&mut self, counts: f64) {
        self.miscount += counts;
    }
}
