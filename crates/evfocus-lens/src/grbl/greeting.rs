//! The first words with a controller: whether it is one, and what it is set to.

use std::time::Duration;

use evfocus_core::{HostMicros, LensSpeed};
use evfocus_hal::{DeviceError, DeviceErrorKind};

use super::protocol::{self, Lines, Message, Settings};
use super::{ANSWER, ATTEMPTS, GrblConfig};
use crate::line::Line;

/// Opening the port resets an Arduino, which is deaf for up to 2 s: each attempt waits this long.
const BOOTING: Duration = Duration::from_secs(1);
/// The end of the line clears what a program before may have left half sent.
const JOG_CANCEL_AND_LINE_END: &[u8] = &[protocol::JOG_CANCEL, b'\n'];

/// The next message, or nothing by `deadline`.
pub(super) fn next(
    line: &mut Line,
    lines: &mut Lines,
    deadline: HostMicros,
) -> Result<Option<Message>, DeviceError> {
    while let Some(byte) = line.next_byte(deadline)? {
        if let Some(message) = lines.push(byte) {
            return Ok(Some(message));
        }
    }
    Ok(None)
}

/// Ends what the machine may be doing, and reads steps per mm and the highest speed.
pub(super) fn greet(
    line: &mut Line,
    lines: &mut Lines,
    config: &GrblConfig,
) -> Result<(f64, LensSpeed), DeviceError> {
    let mut settings = Settings::default();
    let mut heard = false;
    for _ in 0..ATTEMPTS {
        line.drain()?;
        line.send(&[JOG_CANCEL_AND_LINE_END, protocol::SETTINGS].concat())?;
        let deadline = line.now() + BOOTING;
        while let Some(message) = next(line, lines, deadline)? {
            heard |= !matches!(message, Message::Other);
            if let Message::Setting(number, value) = message {
                settings.take(config.axis, number, value);
            }
            if let Settings {
                steps_per_mm: Some(steps),
                mm_per_minute: Some(feed),
                has_homing: Some(homing),
            } = settings
            {
                return understand(line, config, steps, feed, homing);
            }
        }
    }
    if heard {
        let what = "it answers, but does not tell its settings; is it on hold or asleep?";
        return Err(line.error(DeviceErrorKind::Protocol, what));
    }
    let what = format!(
        "no settings after \"$$\" within {BOOTING:?}, asked {ATTEMPTS} times; check power and cable, the baud rate, and that \
         this is a GRBL 1.1"
    );
    Err(line.error(DeviceErrorKind::TimedOut, what))
}

fn understand(
    line: &mut Line,
    config: &GrblConfig,
    steps_per_mm: f64,
    feed: f64,
    has_homing: bool,
) -> Result<(f64, LensSpeed), DeviceError> {
    let senseless = |what: String| line.error(DeviceErrorKind::Fault, what);
    if config.needs_homing && !has_homing {
        return Err(senseless(
            "is to be homed, but homing is off; set $22=1 if there are switches".to_owned(),
        ));
    }
    let speed = LensSpeed::new(steps_per_mm * feed / 60.0).map_err(|error| {
        senseless(format!("{steps_per_mm} steps/mm at {feed} mm/min: {error}; set $100 and $110"))
    })?;
    // The rest of the settings must not be taken for answers.
    let quiet = line.now() + ANSWER;
    let mut lines = Lines::default();
    while let Some(message) = next(line, &mut lines, quiet)? {
        if message == Message::Ok {
            break;
        }
    }
    tracing::info!(
        port = line.place(),
        steps_per_mm,
        max_speed = speed.counts_per_second(),
        "GRBL controller"
    );
    Ok((steps_per_mm, speed))
}
