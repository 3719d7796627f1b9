//! A conversation with an INDI server about one device.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use evfocus_core::{HostMicros, LensPosition, LensRange};
use evfocus_hal::{Clock, DeviceError, DeviceErrorKind};

use super::IndiConfig;
use super::protocol::{self, Decoder, Kind, Message, Property, State};
use crate::Port;
use crate::line::Line;

/// How long the server has to tell of a device.
const INTRODUCTION: Duration = Duration::from_secs(3);
/// How long a device has to connect: drivers wait for controllers that boot.
const CONNECTION: Duration = Duration::from_secs(10);
/// How long a driver may take to ask the focuser where it is, once it is connected.
const FIRST_UPDATE: Duration = Duration::from_secs(1);
/// How long after a failure its reason may come.
const EXPLANATION: Duration = Duration::from_millis(100);
/// Properties of one device that are remembered.
const MOST_PROPERTIES: usize = 512;

const POSITION: &str = "ABS_FOCUS_POSITION";
const POSITION_MEMBER: &str = "FOCUS_ABSOLUTE_POSITION";
const SPEED: &str = "FOCUS_SPEED";
const SPEED_MEMBER: &str = "FOCUS_SPEED_VALUE";
const POLLING: &str = "POLLING_PERIOD";

/// The newest word about where the focuser is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Update {
    pub(super) steps: f64,
    pub(super) state: State,
    /// When it arrived.
    pub(super) time: HostMicros,
}

#[derive(Debug)]
pub(super) struct Session {
    pub(super) line: Line,
    decoder: Decoder,
    device: String,
    properties: BTreeMap<String, Property>,
    pub(super) position: Update,
    words: String,
}

impl Session {
    pub(super) fn new(port: Port, clock: Arc<dyn Clock>) -> Self {
        let position = Update { steps: 0.0, state: State::Idle, time: clock.now() };
        Self {
            line: Line::new("INDI focuser", port, clock),
            decoder: Decoder::default(),
            device: String::new(),
            properties: BTreeMap::new(),
            position,
            words: String::new(),
        }
    }

    /// Connects to the server and the device; gives the focuser's range.
    pub(super) fn begin(&mut self, config: &IndiConfig) -> Result<LensRange, DeviceError> {
        self.line.open()?;
        self.decoder = Decoder::default();
        self.device.clone_from(&config.device);
        self.properties.clear();
        let begun = self.introduce(config);
        self.line.greeted(begun)
    }

    fn introduce(&mut self, config: &IndiConfig) -> Result<LensRange, DeviceError> {
        self.line.send(protocol::GET_PROPERTIES)?;
        self.wait_for(
            "CONNECTION",
            INTRODUCTION,
            "is the name spelt as the server spells it, and the driver running?",
        )?;
        for setting in &config.settings {
            self.wait_for(&setting.property, INTRODUCTION, "leave the setting out, or correct its name")?;
            let kind = self.properties.get(&setting.property).map_or(Kind::Text, |property| property.kind);
            self.set(&setting.property, kind, &setting.member, &setting.value)?;
        }
        self.set("CONNECTION", Kind::Switch, "CONNECT", "On")?;
        self.wait_for(POSITION, CONNECTION, "did it connect, and is it a focuser with absolute positions?")?;
        if self.properties.contains_key(POLLING) {
            let millis = config.polling.as_millis().to_string();
            self.set(POLLING, Kind::Number, "PERIOD_MS", &millis)?;
        }
        // A definition may come before the driver's first question to the focuser; the first update is true. The rest of the
        // properties is on its way meanwhile.
        let settled = self.line.now() + FIRST_UPDATE;
        while self.next(settled)?.is_some() && self.line.now() < settled {}
        if !self.properties.contains_key("FOCUS_ABORT_MOTION") && !config.without_abort {
            let what =
                "cannot be stopped: it has no FOCUS_ABORT_MOTION; set lens.indi.without_abort if it must do";
            return Err(self.line.error(DeviceErrorKind::Fault, what));
        }
        let range = self.range()?;
        tracing::info!(server = self.line.place(), device = self.device, %range, steps = self.position.steps, "INDI focuser");
        Ok(range)
    }

    fn range(&self) -> Result<LensRange, DeviceError> {
        let member = self.properties.get(POSITION).and_then(|property| property.member(POSITION_MEMBER));
        let end = |text: fn(&protocol::Member) -> &String| {
            LensPosition(member.and_then(|member| protocol::number(text(member))).unwrap_or(f64::NAN))
        };
        LensRange::new(end(|member| &member.min), end(|member| &member.max)).map_err(|error| {
            self.line.error(DeviceErrorKind::Fault, format!("its limits make no sense: {error}"))
        })
    }

    /// Reads until the device has `property`.
    fn wait_for(&mut self, property: &str, limit: Duration, remedy: &str) -> Result<(), DeviceError> {
        let deadline = self.line.now() + limit;
        while !self.properties.contains_key(property) {
            if self.next(deadline)?.is_none() || self.line.now() >= deadline {
                let mut what = format!("\"{}\" has no {property} after {limit:?}; {remedy}", self.device);
                if !self.words.is_empty() {
                    what = format!("{what} It said: {}", self.words);
                }
                return Err(self.line.error(DeviceErrorKind::TimedOut, what));
            }
        }
        Ok(())
    }

    /// The next message, heeded, or nothing by `deadline`. Says whether it was about the position.
    fn next(&mut self, deadline: HostMicros) -> Result<Option<bool>, DeviceError> {
        while let Some(byte) = self.line.next_byte(deadline)? {
            if let Some(message) = self.decoder.push(byte) {
                return Ok(Some(self.heed(message)));
            }
        }
        Ok(None)
    }

    /// Takes in what has come already.
    pub(super) fn read_waiting(&mut self) -> Result<(), DeviceError> {
        let now = self.line.now();
        // However fast the server talks, it is listened to only for so long.
        for _ in 0..10_000 {
            if self.next(now)?.is_none() {
                break;
            }
        }
        Ok(())
    }

    /// Waits for the next word about the position.
    pub(super) fn next_position(&mut self, deadline: HostMicros) -> Result<(), DeviceError> {
        while let Some(is_position) = self.next(deadline)? {
            if is_position || self.line.now() >= deadline {
                break;
            }
        }
        Ok(())
    }

    fn heed(&mut self, message: Message) -> bool {
        match message {
            Message::Property(property) if property.device == self.device => self.heed_property(property),
            Message::Text { device, text } if device == self.device => {
                self.words = text;
                false
            }
            Message::Gone { device, name } if device == self.device => {
                self.properties.retain(|known, _| !name.is_empty() && *known != name);
                false
            }
            Message::Property(_) | Message::Text { .. } | Message::Gone { .. } => false,
        }
    }

    fn heed_property(&mut self, property: Property) -> bool {
        if !property.text.is_empty() {
            self.words.clone_from(&property.text);
        }
        let is_position = property.name == POSITION;
        if is_position {
            let steps = property.member(POSITION_MEMBER).and_then(|member| protocol::number(&member.value));
            self.position = Update {
                steps: steps.unwrap_or(self.position.steps),
                state: property.state.unwrap_or(self.position.state),
                time: self.line.now(),
            };
        }
        if property.is_definition && self.properties.len() < MOST_PROPERTIES {
            self.properties.insert(property.name.clone(), property);
        } else if let Some(known) = self.properties.get_mut(&property.name) {
            known.update(property.members);
        }
        is_position
    }

    pub(super) fn set(
        &mut self,
        property: &str,
        kind: Kind,
        member: &str,
        value: &str,
    ) -> Result<(), DeviceError> {
        self.line.send(&protocol::set(&self.device, property, kind, member, value))
    }

    /// Sets the speed to `share` of the highest, where the focuser has speeds.
    pub(super) fn set_speed(&mut self, share: f64) -> Result<(), DeviceError> {
        let member = self.properties.get(SPEED).and_then(|property| property.member(SPEED_MEMBER));
        let ends =
            member.and_then(|member| Some((protocol::number(&member.min)?, protocol::number(&member.max)?)));
        let Some((min, max)) = ends.filter(|(min, max)| min <= max) else { return Ok(()) };
        let value = (share * max).floor().clamp(min, max).to_string();
        self.set(SPEED, Kind::Number, SPEED_MEMBER, &value)
    }

    pub(super) fn forget_words(&mut self) {
        self.words.clear();
    }

    /// What people are told about a failure, which comes after it.
    pub(super) fn wait_for_words(&mut self) -> Result<String, DeviceError> {
        let deadline = self.line.now() + EXPLANATION;
        while self.words.is_empty() && self.line.now() < deadline {
            match self.next(deadline) {
                Ok(Some(_)) => {}
                Ok(None) => break,
                // The failure matters more than its reason.
                Err(error) if error.is_interruption() => break,
                Err(error) => return Err(error),
            }
        }
        let words = std::mem::take(&mut self.words);
        Ok(if words.is_empty() { "the server does not say why".to_owned() } else { words })
    }
}
