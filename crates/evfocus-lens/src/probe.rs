//! What answers on a serial port: each protocol's most harmless question, at its own speed, with a bounded wait.
//!
//! Opening a port resets many boards, and a device that speaks another protocol hears nonsense: only do this to ports that nothing
//! uses, and because somebody asked for it. No question moves anything.

use std::sync::Arc;
use std::time::Duration;

use evfocus_hal::{Clock, DeviceError, DeviceErrorKind, Transport};

use crate::line::Answer;
use crate::port::serial;
use crate::{firmata, grbl, moonlite, optotune};

/// Boards that the opening has reset are deaf for up to 2 s.
const BOOTING: Duration = Duration::from_millis(2300);
/// How long an answer may take.
const ANSWER: Duration = Duration::from_millis(300);
/// Bytes that are looked at.
const MOST_HEARD: usize = 4096;

/// What answered.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Answered {
    /// The driver that speaks its protocol, as the configuration calls it.
    pub driver: &'static str,
    /// What it said, for people.
    pub words: String,
}

/// A protocol's question and what tells its answer from another's.
struct Question {
    driver: &'static str,
    bytes: &'static [u8],
    /// What it says of itself; nothing if this is no answer.
    understand: fn(&[u8]) -> Option<String>,
}

/// The questions at each speed, those that disturb least first.
const QUESTIONS: [(u32, &[Question]); 3] = [
    (
        grbl::BAUD,
        &[
            Question { driver: "grbl", bytes: b"?", understand: is_grbl },
            Question { driver: "optotune", bytes: optotune::protocol::START, understand: is_optotune },
        ],
    ),
    (firmata::BAUD, &[Question { driver: "firmata", bytes: &[0xF9], understand: is_firmata }]),
    (moonlite::BAUD, &[Question { driver: "moonlite", bytes: b":GP#", understand: is_moonlite }]),
];

fn is_grbl(heard: &[u8]) -> Option<String> {
    let mut lines = grbl::protocol::Lines::default();
    let is_status = |message| matches!(message, grbl::protocol::Message::Status { .. });
    heard.iter().filter_map(|&byte| lines.push(byte)).any(is_status).then(|| "a status report".to_owned())
}

fn is_optotune(heard: &[u8]) -> Option<String> {
    (optotune::protocol::ready(heard) == Answer::Whole(())).then(|| "Ready".to_owned())
}

fn is_firmata(heard: &[u8]) -> Option<String> {
    let mut decoder = firmata::protocol::Decoder::default();
    heard.iter().filter_map(|&byte| decoder.push(byte)).find_map(|message| {
        let firmata::protocol::Message::Version(major, minor) = message else { return None };
        // Of a byte stream that is something else, hardly any looks like this.
        (major == 2).then(|| format!("protocol {major}.{minor}"))
    })
}

fn is_moonlite(heard: &[u8]) -> Option<String> {
    // Four digits at least, so that noise is not taken for it.
    match moonlite::protocol::position(heard) {
        Answer::Whole(steps) if heard.len() >= 5 => Some(format!("at step {steps}")),
        Answer::Whole(_) | Answer::Incomplete | Answer::Wrong(_) => None,
    }
}

/// Asks what is on the serial port at `path`: nothing if nobody that there is a driver for answers.
///
/// Takes up to 8 s.
///
/// # Errors
/// What keeps the port from being opened, or that it was lost.
pub fn probe(path: &str, clock: &Arc<dyn Clock>) -> Result<Option<Answered>, DeviceError> {
    ask_all(|baud| serial::open(path, baud, Arc::clone(clock)), clock.as_ref())
}

/// As [`probe`], on whatever `open` opens.
///
/// # Errors
/// As of [`probe`].
pub fn ask_all(
    mut open: impl FnMut(u32) -> Result<Box<dyn Transport>, DeviceError>,
    clock: &dyn Clock,
) -> Result<Option<Answered>, DeviceError> {
    for (baud, questions) in QUESTIONS {
        let mut transport = open(baud)?;
        let deadline = clock.now() + BOOTING;
        while clock.now() < deadline {
            for question in questions {
                if let Some(words) = ask(transport.as_mut(), question, clock)? {
                    return Ok(Some(Answered { driver: question.driver, words }));
                }
            }
        }
    }
    Ok(None)
}

fn ask(
    transport: &mut dyn Transport,
    question: &Question,
    clock: &dyn Clock,
) -> Result<Option<String>, DeviceError> {
    transport.drain()?;
    match transport.write(question.bytes) {
        Err(error) if error.kind != DeviceErrorKind::TimedOut => return Err(error),
        // A line that takes nothing says nothing.
        Ok(()) | Err(_) => {}
    }
    let deadline = clock.now() + ANSWER;
    let (mut heard, mut buffer) = (Vec::new(), [0; 256]);
    while heard.len() < MOST_HEARD {
        let length = transport.read(&mut buffer, deadline)?;
        if length == 0 {
            break;
        }
        heard.extend(buffer.iter().take(length));
        if let Some(words) = (question.understand)(&heard) {
            return Ok(Some(words));
        }
        if clock.now() >= deadline {
            break;
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// No bytes make it panic, and hardly any are taken for an answer.
        #[test]
        fn garbage_is_no_answer(heard in prop::collection::vec(0x80_u8..=0xF0, 0..300)) {
            for (_, questions) in QUESTIONS {
                for question in questions {
                    prop_assert_eq!((question.understand)(&heard), None, "{}", question.driver);
                }
            }
        }
    }
}
