//! A driver's end of its port: one question at a time, with bounded waits and retries, and errors that say where and what.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use evfocus_core::{HostMicros, LensPosition, LensRange};
use evfocus_hal::{Clock, Connect, DeviceError, DeviceErrorKind, Transport};

use crate::Port;

/// No answer of any protocol is longer; what does not end within is garbage.
const LONGEST_ANSWER: usize = 512;
/// Bytes of a wrong answer that an error shows.
const SHOWN: usize = 24;

/// What a parser makes of the bytes that have come in since the question.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Answer<T> {
    /// The beginning of an answer, or nothing yet.
    Incomplete,
    /// The answer.
    Whole(T),
    /// No answer to this question, and why not.
    Wrong(&'static str),
}

/// An answer, and when.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Timed<T> {
    pub(crate) requested: HostMicros,
    pub(crate) replied: HostMicros,
    pub(crate) value: T,
}

/// How long to wait for an answer, and how often to ask.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Patience {
    pub(crate) timeout: Duration,
    pub(crate) attempts: u32,
}

pub(crate) struct Line {
    model: &'static str,
    place: String,
    connect: Connect,
    transport: Option<Box<dyn Transport>>,
    /// What was read and not yet taken byte by byte.
    inbox: VecDeque<u8>,
    clock: Arc<dyn Clock>,
}

impl std::fmt::Debug for Line {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Line")
            .field("place", &self.place)
            .field("is_open", &self.is_open())
            .finish_non_exhaustive()
    }
}

impl Line {
    pub(crate) fn new(model: &'static str, port: Port, clock: Arc<dyn Clock>) -> Self {
        Self {
            model,
            place: port.place,
            connect: port.connect,
            transport: None,
            inbox: VecDeque::new(),
            clock,
        }
    }

    pub(crate) fn place(&self) -> &str {
        &self.place
    }

    pub(crate) fn now(&self) -> HostMicros {
        self.clock.now()
    }

    pub(crate) fn is_open(&self) -> bool {
        self.transport.is_some()
    }

    pub(crate) fn open(&mut self) -> Result<(), DeviceError> {
        self.inbox.clear();
        let opened = (self.connect)();
        self.transport = Some(opened.map_err(|error| self.named(error))?);
        Ok(())
    }

    /// Hangs up, so that the next call begins anew.
    pub(crate) fn close(&mut self) {
        self.transport = None;
    }

    pub(crate) fn error(&self, kind: DeviceErrorKind, what: impl Into<String>) -> DeviceError {
        DeviceError::new(kind, format!("{} {}", self.model, self.place), what)
    }

    fn named(&self, error: DeviceError) -> DeviceError {
        self.error(error.kind, error.what)
    }

    /// `target`, if the lens accepts it.
    pub(crate) fn check_target(&self, target: LensPosition, range: LensRange) -> Result<(), DeviceError> {
        if range.contains(target) {
            Ok(())
        } else {
            let what = format!("target {target} is outside of {range}; choose one inside");
            Err(self.error(DeviceErrorKind::OutOfRange, what))
        }
    }

    /// Runs `action` on the open connection; a connection that turns out to be lost is closed.
    fn with<T>(
        &mut self,
        action: impl FnOnce(&mut dyn Transport) -> Result<T, DeviceError>,
    ) -> Result<T, DeviceError> {
        let Some(transport) = self.transport.as_deref_mut() else {
            return Err(self.error(DeviceErrorKind::Disconnected, "the port is not open"));
        };
        action(transport).map_err(|error| {
            if error.kind == DeviceErrorKind::Disconnected {
                self.close();
            }
            self.named(error)
        })
    }

    pub(crate) fn send(&mut self, bytes: &[u8]) -> Result<(), DeviceError> {
        self.with(|transport| transport.write(bytes))
    }

    fn read(&mut self, buffer: &mut [u8], deadline: HostMicros) -> Result<usize, DeviceError> {
        self.with(|transport| transport.read(buffer, deadline))
    }

    /// The next byte of a stream, or nothing by `deadline`.
    pub(crate) fn next_byte(&mut self, deadline: HostMicros) -> Result<Option<u8>, DeviceError> {
        if self.inbox.is_empty() {
            let mut buffer = [0; LONGEST_ANSWER];
            let length = self.read(&mut buffer, deadline)?;
            self.inbox.extend(buffer.iter().take(length));
        }
        Ok(self.inbox.pop_front())
    }

    pub(crate) fn drain(&mut self) -> Result<(), DeviceError> {
        self.inbox.clear();
        self.with(|transport| transport.drain())
    }

    /// Sends `question` and waits for what `parse` accepts, as often as `patience` allows. `parse` is shown everything that
    /// has come in since.
    ///
    /// # Errors
    /// `TimedOut` for silence, `Protocol` for answers that are none, each with the question and what came.
    pub(crate) fn ask<T>(
        &mut self,
        question: &[u8],
        patience: Patience,
        parse: impl Fn(&[u8]) -> Answer<T>,
    ) -> Result<Timed<T>, DeviceError> {
        let mut buffer = [0; LONGEST_ANSWER];
        let (mut received, mut reason) = (0, "it does not end");
        for _ in 0..patience.attempts {
            self.drain()?;
            let requested = self.now();
            self.send(question)?;
            let deadline = self.now() + patience.timeout;
            (received, reason) = (0, "it does not end");
            loop {
                let (taken, free) = buffer.split_at_mut(received);
                let length = if free.is_empty() { 0 } else { self.read(free, deadline)? };
                if length == 0 {
                    break;
                }
                let replied = self.now();
                let seen = taken.len() + length;
                received = seen.min(LONGEST_ANSWER);
                match parse(buffer.get(..received).unwrap_or_default()) {
                    Answer::Incomplete => {}
                    Answer::Whole(value) => return Ok(Timed { requested, replied, value }),
                    Answer::Wrong(why) => {
                        reason = why;
                        break;
                    }
                }
            }
        }
        Err(self.unanswered(question, patience, buffer.get(..received).unwrap_or_default(), reason))
    }

    fn unanswered(&self, question: &[u8], patience: Patience, seen: &[u8], reason: &str) -> DeviceError {
        let (question, timeout, attempts) = (question.escape_ascii(), patience.timeout, patience.attempts);
        if seen.is_empty() {
            let what = format!(
                "no answer to \"{question}\" within {timeout:?}, asked {attempts} times; check power and cable, the baud rate, \
                 and that this is the {}",
                self.model
            );
            return self.error(DeviceErrorKind::TimedOut, what);
        }
        let shown = seen.get(..seen.len().min(SHOWN)).unwrap_or_default().escape_ascii();
        let what = format!(
            "\"{shown}\" is no answer to \"{question}\" ({reason}), asked {attempts} times; check the baud rate, and that this is \
                 the {}",
            self.model
        );
        self.error(DeviceErrorKind::Protocol, what)
    }
}
