//! Lines of text, each answered `ok` or `error:N`; single bytes that act at once; status reports and messages that come between.

use std::fmt::Write;

/// Asks for a status report.
pub const STATUS: u8 = b'?';
/// Ends a jog: the motor brakes and keeps its count.
pub const JOG_CANCEL: u8 = 0x85;
/// Starts the firmware anew: what ends a homing cycle. The machine is locked then.
pub const SOFT_RESET: u8 = 0x18;
/// Homing cycle.
pub const HOME: &[u8] = b"$H\n";
/// Asks for the settings.
pub const SETTINGS: &[u8] = b"$$\n";

/// No line of the firmware is longer: its own buffer holds 128 bytes.
const LONGEST_LINE: usize = 256;

/// Which axis turns the lens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Axis {
    /// The first motor.
    X,
    /// The second.
    Y,
    /// The third.
    Z,
}

impl Axis {
    fn letter(self) -> char {
        match self {
            Self::X => 'X',
            Self::Y => 'Y',
            Self::Z => 'Z',
        }
    }

    fn index(self) -> usize {
        self as usize
    }

    /// The axis's setting in the family that begins at `family`: 100 for steps/mm, 110 for mm/min.
    fn setting(self, family: usize) -> usize {
        family + self.index()
    }
}

/// A jog to `millimetres` in machine coordinates, whatever the state of the G-code parser.
pub fn jog(axis: Axis, millimetres: f64, millimetres_per_minute: f64) -> Vec<u8> {
    let mut line = "$J=G21G90G53".to_owned();
    // Writing to a string does not fail.
    write!(line, "{}{millimetres:.4}F{millimetres_per_minute:.1}", axis.letter()).unwrap_or_default();
    line.push('\n');
    line.into_bytes()
}

/// What the machine is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// Nothing.
    Idle,
    /// Jogging, or a program.
    Moving,
    /// The homing cycle.
    Homing,
    /// Locked: the position is not certain.
    Alarm,
    /// Something that only its user can end: a hold, an open door, check mode, sleep.
    Held,
}

/// A line from the firmware.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Message {
    /// The last line was taken.
    Ok,
    /// The last line was refused, and why.
    Error(u16),
    /// The machine has locked itself, and why.
    Alarm(u16),
    /// It has started: `Grbl 1.1h [...]`.
    Banner,
    /// Answer to `?`: the state, and positions of the three axes in mm where the report has them.
    Status {
        /// What it is doing.
        state: State,
        /// In machine coordinates.
        machine: Option<[f64; 3]>,
        /// In work coordinates.
        work: Option<[f64; 3]>,
        /// Machine minus work; in every tenth report or so.
        offset: Option<[f64; 3]>,
    },
    /// A setting, `$100=250.000`.
    Setting(usize, f64),
    /// Anything else: feedback in brackets, echoes, garbage.
    Other,
}

/// Cuts the stream into lines. Bounded: what is longer than any line is thrown away up to its end.
#[derive(Debug, Default)]
pub struct Lines {
    line: Vec<u8>,
}

impl Lines {
    /// Takes a byte; gives the line that it ends.
    pub fn push(&mut self, byte: u8) -> Option<Message> {
        match byte {
            b'\n' | b'\r' => {
                let message = (!self.line.is_empty()).then(|| parse(&String::from_utf8_lossy(&self.line)));
                self.line.clear();
                message
            }
            _ => {
                if self.line.len() < LONGEST_LINE {
                    self.line.push(byte);
                }
                None
            }
        }
    }
}

fn parse(line: &str) -> Message {
    let line = line.trim();
    let code = |text: &str| text.trim().parse().unwrap_or(0);
    if line == "ok" {
        Message::Ok
    } else if let Some(number) = line.strip_prefix("error:") {
        Message::Error(code(number))
    } else if let Some(number) = line.strip_prefix("ALARM:") {
        Message::Alarm(code(number))
    } else if line.starts_with("Grbl ") {
        Message::Banner
    } else if let Some(report) = line.strip_prefix('<').and_then(|rest| rest.strip_suffix('>')) {
        status(report)
    } else {
        setting(line).unwrap_or(Message::Other)
    }
}

fn setting(line: &str) -> Option<Message> {
    let (number, value) = line.strip_prefix('$')?.split_once('=')?;
    let value: f64 = value.trim().parse().ok()?;
    Some(Message::Setting(number.parse().ok()?, value)).filter(|_| value.is_finite())
}

/// Fields come and go, so they are found by name.
fn status(report: &str) -> Message {
    let mut fields = report.split('|');
    let word = fields.next().unwrap_or_default();
    let state = match word.split(':').next().unwrap_or_default() {
        "Idle" => State::Idle,
        "Run" | "Jog" => State::Moving,
        "Home" => State::Homing,
        "Alarm" => State::Alarm,
        "Hold" | "Door" | "Check" | "Sleep" => State::Held,
        _ => return Message::Other,
    };
    let (mut machine, mut work, mut offset) = (None, None, None);
    for field in fields {
        match field.split_once(':') {
            Some(("MPos", values)) => machine = axes(values),
            Some(("WPos", values)) => work = axes(values),
            Some(("WCO", values)) => offset = axes(values),
            Some(_) | None => {}
        }
    }
    Message::Status { state, machine, work, offset }
}

fn axes(values: &str) -> Option<[f64; 3]> {
    let mut axes = [0.0; 3];
    let mut given = values.split(',');
    for place in &mut axes {
        *place = given.next()?.parse().ok().filter(|value: &f64| value.is_finite())?;
    }
    Some(axes)
}

/// Settings that matter here, as they come in.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Settings {
    /// `$100`: steps per mm of the axis.
    pub steps_per_mm: Option<f64>,
    /// `$110`: its highest speed, mm per minute.
    pub mm_per_minute: Option<f64>,
    /// `$22`: whether there are switches to home on.
    pub has_homing: Option<bool>,
}

impl Settings {
    /// Takes one that is of this axis.
    pub fn take(&mut self, axis: Axis, number: usize, value: f64) {
        if number == axis.setting(100) {
            self.steps_per_mm = Some(value);
        } else if number == axis.setting(110) {
            self.mm_per_minute = Some(value);
        } else if number == 22 {
            self.has_homing = Some(value > 0.5);
        }
    }
}

/// The axis's own of three.
pub(super) fn of(axis: Axis, axes: [f64; 3]) -> f64 {
    axes.get(axis.index()).copied().unwrap_or_default()
}

/// What an `error:` says, for those that a jog or a homing cycle can meet.
pub(super) fn error_text(code: u16) -> &'static str {
    match code {
        5 => "homing is off; set $22=1 if there are switches",
        8 => "it is busy with something else than a jog",
        9 => "it is locked; home it, or unlock it with $X",
        15 => "the target is outside of its travel; compare $130 with lens.max_counts",
        22 => "no speed was given",
        _ => "see the list of error codes of Grbl 1.1",
    }
}

/// What an `ALARM:` says.
pub(super) fn alarm_text(code: u16) -> &'static str {
    match code {
        1 => "an end switch was hit",
        2 => "the target is outside of its travel",
        3 => "it was reset while it moved, and may have lost steps",
        6..=9 => "homing did not find the switch",
        _ => "see the list of alarm codes of Grbl 1.1",
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn messages(bytes: &[u8]) -> Vec<Message> {
        let mut lines = Lines::default();
        bytes.iter().filter_map(|&byte| lines.push(byte)).collect()
    }

    #[test]
    fn lines_of_the_firmware() {
        assert_eq!(messages(b"\r\nGrbl 1.1h ['$' for help]\r\n"), [Message::Banner]);
        assert_eq!(
            messages(b"ok\r\nerror:15\r\nALARM:3\r\n"),
            [Message::Ok, Message::Error(15), Message::Alarm(3)]
        );
        assert_eq!(messages(b"$100=250.000\r\n[MSG:x]\r\n"), [Message::Setting(100, 250.0), Message::Other]);
        let status = |state, machine, work, offset| Message::Status { state, machine, work, offset };
        assert_eq!(
            messages(b"<Jog|MPos:18.748,0.000,-1.000|FS:600,0|Ov:100,100,100>\r\n"),
            [status(State::Moving, Some([18.748, 0.0, -1.0]), None, None)]
        );
        assert_eq!(
            messages(b"<Hold:0|WPos:1.000,2.000,3.000|WCO:0.500,0.000,0.000>\r\n"),
            [status(State::Held, None, Some([1.0, 2.0, 3.0]), Some([0.5, 0.0, 0.0]))]
        );
        assert_eq!(messages(b"<Idle|MPos:nan,0,0>\r\n"), [status(State::Idle, None, None, None)]);
        assert_eq!(jog(Axis::X, 20.0, 600.0), b"$J=G21G90G53X20.0000F600.0\n");
    }

    #[test]
    fn a_line_without_an_end_is_bounded() {
        let mut lines = Lines::default();
        for _ in 0..100_000 {
            assert_eq!(lines.push(b'x'), None);
        }
        assert!(lines.line.len() <= LONGEST_LINE);
        assert_eq!(lines.push(b'\n'), Some(Message::Other));
    }

    proptest! {
        /// No bytes make the parser panic, and what follows a line's end is understood.
        #[test]
        fn any_bytes(garbage in prop::collection::vec(any::<u8>(), 0..600)) {
            let stream = [&garbage[..], b"\nok\n"].concat();
            prop_assert_eq!(messages(&stream).last().copied(), Some(Message::Ok));
        }
    }
}
