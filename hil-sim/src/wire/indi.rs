//! An INDI server with one focuser, "Focuser": properties that appear with the connection, updates at a polling period while it
//! moves, abort.

use std::fmt::Write;
use std::time::Duration;

use evfocus_core::HostMicros;

use super::{Device, Motor};

const DEVICE: &str = "Focuser";
/// A server hangs up on more than this without a command in it.
const LONGEST_COMMAND: usize = 8192;
const HIGHEST_SPEED: f64 = 100.0;

#[derive(Debug)]
pub(super) struct IndiModel {
    motor: Motor,
    received: String,
    connected: bool,
    period: Duration,
    /// Percent.
    speed: f64,
    /// Whether the state of the position is Busy, and when it is looked at next.
    busy: bool,
    /// Aborted, and perhaps not yet at rest.
    stopping: bool,
    next_poll: HostMicros,
    miscount: f64,
}

/// The value of the attribute `key` in `tag`, in either kind of quotes.
fn attribute<'a>(tag: &'a str, key: &str) -> Option<&'a str> {
    let (_, after) = tag.split_once(&format!(" {key}="))?;
    let quote = after.chars().next()?;
    after.get(1..)?.split(quote).next()
}

impl IndiModel {
    pub(super) fn new(motor: Motor) -> Self {
        Self {
            motor,
            received: String::new(),
            connected: false,
            period: Duration::from_millis(500),
            speed: HIGHEST_SPEED,
            busy: false,
            stopping: false,
            next_poll: HostMicros(0),
            miscount: 0.0,
        }
    }

    fn position(&self, now: HostMicros) -> f64 {
        (self.motor.report(now).0 + self.miscount).round()
    }

    /// Definitions look as drivers write them: single quotes, an attribute a line.
    fn define(&self, now: HostMicros, out: &mut String) {
        let mut define = |kind: &str, name: &str, members: &[(&str, String, f64, f64)]| {
            // Writing to a string does not fail.
            write!(out, "<def{kind}Vector\n    device='{DEVICE}'\n    name='{name}'\n    state='Idle'\n    perm='rw'>\n")
                .unwrap_or_default();
            for (member, value, min, max) in members {
                write!(out, "    <def{kind}\n        name='{member}'\n        min='{min}'\n        max='{max}'>\n{value}\n    </def{kind}>\n")
                    .unwrap_or_default();
            }
            writeln!(out, "</def{kind}Vector>").unwrap_or_default();
        };
        let switch = |on: bool| if on { "On" } else { "Off" }.to_owned();
        define(
            "Switch",
            "CONNECTION",
            &[
                ("CONNECT", switch(self.connected), 0.0, 0.0),
                ("DISCONNECT", switch(!self.connected), 0.0, 0.0),
            ],
        );
        define("Text", "DEVICE_PORT", &[("PORT", "/dev/ttyUSB0".to_owned(), 0.0, 0.0)]);
        let period = self.period.as_millis().to_string();
        define("Number", "POLLING_PERIOD", &[("PERIOD_MS", period, 10.0, 600_000.0)]);
        if self.connected {
            // Before the driver has asked the focuser; the update below is true.
            define(
                "Number",
                "ABS_FOCUS_POSITION",
                &[("FOCUS_ABSOLUTE_POSITION", "0".to_owned(), 0.0, 100_000.0)],
            );
            let speed = self.speed.to_string();
            define("Number", "FOCUS_SPEED", &[("FOCUS_SPEED_VALUE", speed, 1.0, HIGHEST_SPEED)]);
            define("Switch", "FOCUS_ABORT_MOTION", &[("ABORT", switch(false), 0.0, 0.0)]);
            let range = self.motor.range();
            self.update_with("Ok", &format!(" min='{}' max='{}'", range.min().0, range.max().0), now, out);
        }
    }

    /// Updates look as servers write them: double quotes, one line.
    fn update(&self, state: &str, now: HostMicros, out: &mut String) {
        self.update_with(state, "", now, out);
    }

    fn update_with(&self, state: &str, limits: &str, now: HostMicros, out: &mut String) {
        let position = self.position(now);
        writeln!(
            out,
            "<setNumberVector device=\"{DEVICE}\" name=\"ABS_FOCUS_POSITION\" state=\"{state}\"><oneNumber \
             name=\"FOCUS_ABSOLUTE_POSITION\"{limits}>\n{position}\n</oneNumber></setNumberVector>"
        )
        .unwrap_or_default();
    }

    /// Obeys the element whose first tag is `tag`, with the value of its first member.
    fn obey(&mut self, tag: &str, member: &str, value: &str, now: HostMicros, out: &mut String) {
        if tag.starts_with("<getProperties") {
            self.define(now, out);
            return;
        }
        if attribute(tag, "device") != Some(DEVICE) {
            return;
        }
        let number: Option<f64> = value.parse().ok();
        match (attribute(tag, "name").unwrap_or_default(), number) {
            ("CONNECTION", _) => {
                self.connected = (member == "CONNECT") == (value == "On");
                self.define(now, out);
            }
            ("POLLING_PERIOD", Some(millis)) => {
                self.period = Duration::from_secs_f64(millis.clamp(10.0, 600_000.0) / 1e3);
            }
            ("FOCUS_SPEED", Some(speed)) => self.speed = speed.clamp(1.0, HIGHEST_SPEED),
            ("FOCUS_ABORT_MOTION", _) if self.connected => {
                self.motor.brake(now);
                // What it runs on by is still told.
                (self.busy, self.stopping) = (false, true);
                self.next_poll = now + self.period;
                self.update("Idle", now, out);
            }
            ("ABS_FOCUS_POSITION", Some(target)) if self.connected => {
                let range = self.motor.range();
                if target < range.min().0 || target > range.max().0 {
                    self.update("Alert", now, out);
                    let max = range.max().0;
                    writeln!(
                        out,
                        "<message device=\"{DEVICE}\" message=\"[ERROR] Requested position out of bound. Focus maximum \
                         position is {max}\"/>"
                    )
                    .unwrap_or_default();
                    return;
                }
                let speed = self.motor.max_speed() * self.speed / HIGHEST_SPEED;
                self.motor.travel(now, target - self.miscount, speed);
                (self.busy, self.stopping) = (true, false);
                self.next_poll = now + self.period;
                self.update("Busy", now, out);
            }
            _ => {}
        }
    }
}

impl Device for IndiModel {
    fn receive(&mut self, bytes: &[u8], now: HostMicros, replies: &mut Vec<u8>) {
        self.received.push_str(&String::from_utf8_lossy(bytes));
        let mut out = String::new();
        loop {
            let start = self.received.find('<').unwrap_or(self.received.len());
            self.received.drain(..start);
            let Some(tag_end) = self.received.find('>') else { break };
            let tag = self.received.get(..=tag_end).unwrap_or_default().to_owned();
            if tag.ends_with("/>") || tag.starts_with("<?") {
                self.received.drain(..=tag_end);
                self.obey(&tag, "", "", now, &mut out);
                continue;
            }
            let name = tag.trim_start_matches('<').split([' ', '>', '\n']).next().unwrap_or_default();
            let closing = format!("</{name}>");
            let Some(end) = self.received.find(&closing) else { break };
            let body = self.received.get(tag_end + 1..end).unwrap_or_default().to_owned();
            self.received.drain(..end + closing.len());
            let member = attribute(&body, "name").unwrap_or_default();
            let value = body.split(['<', '>']).nth(2).unwrap_or_default().trim();
            self.obey(&tag, member, value, now, &mut out);
        }
        if self.received.len() > LONGEST_COMMAND {
            self.received.clear();
        }
        replies.extend(out.bytes());
    }

    fn due(&self) -> Option<HostMicros> {
        (self.busy || self.stopping).then_some(self.next_poll)
    }

    fn speak(&mut self, now: HostMicros, said: &mut Vec<u8>) {
        let mut out = String::new();
        self.next_poll = now + self.period;
        let moving = self.motor.report(now).1;
        let state = if self.stopping {
            self.stopping = moving;
            "Idle"
        } else {
            self.busy = moving;
            if moving { "Busy" } else { "Ok" }
        };
        self.update(state, now, &mut out);
        said.extend(out.bytes());
    }

    fn reset(&mut self, now: HostMicros) {
        self.motor.brake(now);
        *self = Self { miscount: self.miscount, ..Self::new(self.motor.clone()) };
    }

    fn miscount(&mut self, counts: f64) {
        self.miscount += counts;
    }
}
