//! A driver's end of its port: one question at a time, with bounded waits and retries, and errors that say where and what.
//!
//! While the driver waits for an answer, orders may come, which a [`Bell`] tells. Then the wait ends, the question is left open,
//! and what the order has to say is written at once. The next question waits for the answer to the one left open, so that no
//! answer is taken for another's.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use evfocus_core::{HostMicros, LensPosition, LensRange};
use evfocus_hal::{Bell, Clock, Connect, DeviceError, DeviceErrorKind, Transport};

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

type IsAnswered = dyn Fn(&[u8]) -> bool + Send;

/// A question whose answer is still to come, for an order was more urgent.
struct OpenQuestion {
    /// The answer does not come later than this.
    deadline: HostMicros,
    received: Vec<u8>,
    /// Whether these bytes are an answer, or cannot become one.
    is_answered: Box<IsAnswered>,
    /// What was sent meanwhile, and is sent again once the answer is in.
    sent: Vec<u8>,
}

pub(crate) struct Line {
    model: &'static str,
    place: String,
    connect: Connect,
    transport: Option<Box<dyn Transport>>,
    /// What was read and not yet taken byte by byte.
    inbox: VecDeque<u8>,
    open_question: Option<OpenQuestion>,
    bell: Bell,
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
            open_question: None,
            bell: Bell::default(),
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

    /// Opens the port. Until the device has been [`greeted`](Self::greeted), nobody can be told anything sensible, and no order
    /// ends a wait.
    pub(crate) fn open(&mut self) -> Result<(), DeviceError> {
        self.inbox.clear();
        self.open_question = None;
        let opened = (self.connect)();
        self.transport = Some(opened.map_err(|error| self.named(error))?);
        Ok(())
    }

    /// The first words were exchanged, or not: then it hangs up.
    pub(crate) fn greeted<T>(&mut self, outcome: Result<T, DeviceError>) -> Result<T, DeviceError> {
        match (&outcome, &mut self.transport) {
            (Ok(_), Some(transport)) => transport.listen(&self.bell),
            _ => self.close(),
        }
        outcome
    }

    /// Ends waits while `bell` rings.
    pub(crate) fn listen(&mut self, bell: &Bell) {
        self.bell = bell.clone();
        if let Some(transport) = &mut self.transport {
            transport.listen(bell);
        }
    }

    /// Hangs up, so that the next call begins anew.
    pub(crate) fn close(&mut self) {
        self.transport = None;
        self.open_question = None;
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

    fn write(&mut self, bytes: &[u8]) -> Result<(), DeviceError> {
        self.with(|transport| transport.write(bytes))
    }

    fn read(&mut self, buffer: &mut [u8], deadline: HostMicros) -> Result<usize, DeviceError> {
        let length = self.with(|transport| transport.read(buffer, deadline))?;
        if length == 0 && self.bell.rings() && self.now() < deadline {
            return Err(self.error(DeviceErrorKind::Interrupted, "an order is more urgent than the answer"));
        }
        Ok(length)
    }

    /// Sends what has no answer, at once. If an answer is still to come, it is sent again after it: small controllers may not
    /// hear while they speak. So it must be something that may be said twice.
    pub(crate) fn send(&mut self, bytes: &[u8]) -> Result<(), DeviceError> {
        self.write(bytes)?;
        if let Some(question) =
            self.open_question.as_mut().filter(|question| question.sent.len() < LONGEST_ANSWER)
        {
            question.sent.extend(bytes);
        }
        Ok(())
    }

    /// Sends `question` at once, if an answer to another one is still to come and to [`ask`](Self::ask) means to wait for it.
    pub(crate) fn hurry(&mut self, question: &[u8]) -> Result<(), DeviceError> {
        if self.open_question.is_some() { self.write(question) } else { Ok(()) }
    }

    /// Waits for the answer to the question that was left open, which nobody needs any more, and repeats what was sent since.
    pub(crate) fn settle(&mut self) -> Result<(), DeviceError> {
        let Some(mut question) = self.open_question.take() else { return Ok(()) };
        let mut buffer = [0; LONGEST_ANSWER];
        while question.received.len() < LONGEST_ANSWER && !(question.is_answered)(&question.received) {
            match self.read(&mut buffer, question.deadline) {
                Ok(0) => break,
                Ok(length) => question.received.extend(buffer.iter().take(length)),
                Err(error) => {
                    self.open_question = Some(question).filter(|_| error.is_interruption());
                    return Err(error);
                }
            }
        }
        if question.sent.is_empty() { Ok(()) } else { self.write(&question.sent) }
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
    /// `Interrupted` if the bell rings; the question stays open then. `TimedOut` for silence, `Protocol` for answers that are none, each with the question and what came.
    pub(crate) fn ask<T>(
        &mut self,
        question: &[u8],
        patience: Patience,
        parse: impl Fn(&[u8]) -> Answer<T> + Send + 'static,
    ) -> Result<Timed<T>, DeviceError> {
        self.settle()?;
        let mut buffer = [0; LONGEST_ANSWER];
        let (mut received, mut reason) = (0, "it does not end");
        for _ in 0..patience.attempts {
            self.drain()?;
            let requested = self.now();
            self.write(question)?;
            let deadline = self.now() + patience.timeout;
            (received, reason) = (0, "it does not end");
            loop {
                let (taken, free) = buffer.split_at_mut(received);
                let read = if free.is_empty() { Ok(0) } else { self.read(free, deadline) };
                if let Err(error) = &read
                    && error.is_interruption()
                {
                    self.open_question = Some(OpenQuestion {
                        deadline,
                        received: taken.to_vec(),
                        is_answered: Box::new(move |bytes| !matches!(parse(bytes), Answer::Incomplete)),
                        sent: Vec::new(),
                    });
                    return Err(error.clone());
                }
                let length = read?;
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
