//! Commands and answers: ASCII, `:` letters hex-payload `#`; answers without the colon, and only to questions.

use crate::line::Answer;

/// Highest position: the smallest firmwares keep a line of 8 bytes, `:SN` and six digits without `:` and `#`.
pub const HIGHEST: u32 = 0xFF_FFFF;

/// How the motor steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StepMode {
    /// Full steps.
    Full,
    /// Half steps.
    Half,
}

/// A speed divisor: the larger, the slower. The original goes at 500 steps/s divided by it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Divisor(u8);

impl Divisor {
    /// From fast to slow.
    const ALL: [Self; 5] = [Self(0x02), Self(0x04), Self(0x08), Self(0x10), Self(0x20)];

    /// The fastest one at which the motor is not faster than `share` of its highest speed; the slowest if none is.
    pub fn for_share(share: f64) -> Self {
        // Half the speed may come as slightly less than a half.
        let fits = |divisor: &&Self| divisor.share() <= share * 1.000_001;
        Self::ALL.iter().find(fits).copied().unwrap_or(Self(0x20))
    }

    /// Speed as a share of the highest.
    pub fn share(self) -> f64 {
        2.0 / f64::from(self.0)
    }
}

/// What is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Command {
    /// `GV`: which firmware.
    Version,
    /// `GP`: where the motor is.
    Position,
    /// `GN`: where it is to go.
    Target,
    /// `GI`: whether it moves.
    IsMoving,
    /// `SN`: where to go next; some firmwares set out at once.
    SetTarget(u32),
    /// `FG`: go.
    Go,
    /// `FQ`: stop now.
    Stop,
    /// `SD`: how fast.
    Speed(Divisor),
    /// `SH`, `SF`.
    Steps(StepMode),
}

impl Command {
    /// The bytes on the line.
    pub fn encode(self) -> Vec<u8> {
        let text = match self {
            Self::Version => ":GV#".to_owned(),
            Self::Position => ":GP#".to_owned(),
            Self::Target => ":GN#".to_owned(),
            Self::IsMoving => ":GI#".to_owned(),
            Self::SetTarget(position) => format!(":SN{:04X}#", position.min(HIGHEST)),
            Self::Go => ":FG#".to_owned(),
            Self::Stop => ":FQ#".to_owned(),
            Self::Speed(Divisor(divisor)) => format!(":SD{divisor:02X}#"),
            Self::Steps(StepMode::Full) => ":SF#".to_owned(),
            Self::Steps(StepMode::Half) => ":SH#".to_owned(),
        };
        text.into_bytes()
    }
}

/// Digits of a position, at least; other answers are shorter.
const POSITION_DIGITS: usize = 3;

/// A position: hex digits, four or more from every firmware that is known, at most eight, then `#`.
pub(crate) fn position(bytes: &[u8]) -> Answer<u32> {
    number(bytes, |digits| digits >= POSITION_DIGITS)
}

/// The first number of as many hex digits as `fits` wants, then `#`. Others, and a `#` that comes first, belong to an earlier question
/// whose answer was late.
fn number(bytes: &[u8], fits: impl Fn(usize) -> bool) -> Answer<u32> {
    let (mut value, mut digits): (u32, usize) = (0, 0);
    for &byte in bytes {
        match char::from(byte).to_digit(16) {
            Some(digit) if digits < 8 => (value, digits) = (value << 4 | digit, digits + 1),
            None if byte == b'#' && fits(digits) => return Answer::Whole(value),
            None if byte == b'#' => (value, digits) = (0, 0),
            Some(_) | None => return Answer::Wrong("not hex digits and #"),
        }
    }
    Answer::Incomplete
}

/// `01#` or `00#`, or one digit.
pub(crate) fn is_moving(bytes: &[u8]) -> Answer<bool> {
    match number(bytes, |digits| (1..POSITION_DIGITS).contains(&digits)) {
        Answer::Whole(value @ (0 | 1)) => Answer::Whole(value == 1),
        Answer::Whole(_) => Answer::Wrong("neither 0 nor 1"),
        Answer::Wrong(why) => Answer::Wrong(why),
        Answer::Incomplete => Answer::Incomplete,
    }
}

/// Two digits; the original sends no `#` after them, its copies do.
pub(crate) fn version(bytes: &[u8]) -> Answer<[u8; 2]> {
    let start = bytes.iter().position(|&byte| byte != b'#').unwrap_or(bytes.len());
    let digits = bytes.get(start..).unwrap_or_default();
    if !digits.iter().take(2).all(u8::is_ascii_alphanumeric) {
        return Answer::Wrong("not two digits");
    }
    digits.first_chunk().map_or(Answer::Incomplete, |&version| Answer::Whole(version))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_worked_examples() {
        assert_eq!(Command::SetTarget(5040).encode(), b":SN13B0#");
        assert_eq!(Command::SetTarget(100_000).encode(), b":SN186A0#");
        assert_eq!(Command::Go.encode(), b":FG#");
        assert_eq!(Command::Speed(Divisor::for_share(0.25)).encode(), b":SD08#");
        assert_eq!(position(b"1064#"), Answer::Whole(4196));
        assert_eq!(position(b"186A0#"), Answer::Whole(100_000));
        assert_eq!(position(b"#1064#"), Answer::Whole(4196));
        // Late answers to other questions.
        assert_eq!(position(b"00#1064#"), Answer::Whole(4196));
        assert_eq!(is_moving(b"1064#01#"), Answer::Whole(true));
        assert_eq!(position(b"106"), Answer::Incomplete);
        assert!(matches!(position(b"10x4#"), Answer::Wrong(_)));
        assert!(matches!(position(b"123456789#"), Answer::Wrong(_)));
        for (bytes, expected) in
            [(&b"01#"[..], true), (&b"00#"[..], false), (&b"1#"[..], true), (&b"0#"[..], false)]
        {
            assert_eq!(is_moving(bytes), Answer::Whole(expected));
        }
        assert!(matches!(is_moving(b"7F#"), Answer::Wrong(_)));
        assert_eq!(version(b"10"), Answer::Whole(*b"10"));
        assert_eq!(version(b"10#"), Answer::Whole(*b"10"));
        assert_eq!(version(b"1"), Answer::Incomplete);
        assert!(matches!(version(b"\xFF\x00"), Answer::Wrong(_)));
    }

    #[test]
    fn divisors_are_never_faster_than_asked() {
        for (share, expected) in
            [(1.0, 0x02), (0.5, 0x04), (0.3, 0x08), (0.125, 0x10), (0.0626, 0x20), (0.001, 0x20)]
        {
            assert_eq!(Divisor::for_share(share), Divisor(expected), "{share}");
        }
    }

    proptest! {
        /// What is encoded is understood, and no bytes make a parser panic.
        #[test]
        fn positions_survive(value in 0..=HIGHEST, garbage in prop::collection::vec(any::<u8>(), 0..600)) {
            prop_assert_eq!(position(format!("{value:04X}#").as_bytes()), Answer::Whole(value));
            let (_, _, _) = (position(&garbage), is_moving(&garbage), version(&garbage));
        }
    }
}
