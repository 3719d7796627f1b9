//! Frames: ASCII letters, big-endian data, CRC-16/ARC with its low byte first; answers end with CR LF after the checksum.
//!
//! Answers are read by their length: data and checksum may contain any byte, CR and LF too.

use crate::line::Answer;

/// What opens the conversation; it has no checksum.
pub const START: &[u8] = b"Start";
const READY: &[u8] = b"Ready\r\n";
/// The answer to a frame whose checksum is wrong.
const REFUSAL: &[u8] = b"N\r\n";

/// CRC-16/ARC: polynomial 0x8005, reflected; zero before, nothing after. Over a message and its checksum it is zero.
pub fn checksum(message: &[u8]) -> u16 {
    message.iter().fold(0, |mut crc, &byte| {
        crc ^= u16::from(byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { crc >> 1 ^ 0xA001 } else { crc >> 1 };
        }
        crc
    })
}

/// What is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Command {
    /// `H`: the firmware's type, a letter after the `H`.
    FirmwareType,
    /// `X`: the lens's serial number, 8 characters.
    SerialNumber,
    /// `MwDA`: obey currents.
    CurrentMode,
    /// `MwCA`: obey focal powers; answers with their limits.
    FocalPowerMode,
    /// `CrUA`: the upper limit of the current.
    UpperCurrent,
    /// `CrLA`: the lower.
    LowerCurrent,
    /// `Aw`: a current, raw; obeyed without a word.
    SetCurrent(i16),
    /// `Ar`: the current that was set.
    Current,
    /// `PwDA`: a focal power, raw; obeyed without a word.
    SetFocalPower(i16),
    /// `PrDA`: the focal power that was set.
    FocalPower,
}

impl Command {
    /// The bytes on the line.
    pub fn encode(self) -> Vec<u8> {
        let (name, data) = match self {
            Self::FirmwareType => ("H", vec![]),
            Self::SerialNumber => ("X", vec![]),
            Self::CurrentMode => ("MwDA", vec![]),
            Self::FocalPowerMode => ("MwCA", vec![]),
            Self::UpperCurrent => ("CrUA", vec![0, 0]),
            Self::LowerCurrent => ("CrLA", vec![0, 0]),
            Self::SetCurrent(raw) => ("Aw", raw.to_be_bytes().to_vec()),
            Self::Current => ("Ar", vec![0, 0]),
            Self::SetFocalPower(raw) => ("PwDA", [raw.to_be_bytes(), [0, 0]].concat()),
            Self::FocalPower => ("PrDA", vec![0; 4]),
        };
        let mut frame = [name.as_bytes(), &data].concat();
        frame.extend(checksum(&frame).to_le_bytes());
        frame
    }
}

/// `Ready`, perhaps after the rest of an answer to somebody else.
pub(crate) fn ready(bytes: &[u8]) -> Answer<()> {
    if bytes.windows(READY.len()).any(|window| window == READY) {
        Answer::Whole(())
    } else {
        Answer::Incomplete
    }
}

/// An answer whose payload has `N` bytes.
pub(crate) fn payload<const N: usize>(bytes: &[u8]) -> Answer<[u8; N]> {
    if bytes.starts_with(REFUSAL) {
        return Answer::Wrong("a complaint about a checksum");
    }
    if bytes.first() == Some(&b'E') && bytes.ends_with(b"\r\n") {
        return Answer::Wrong("an error");
    }
    let (Some(payload), Some(message), Some(end)) =
        (bytes.first_chunk::<N>(), bytes.get(..N + 2), bytes.get(N + 2..N + 4))
    else {
        return Answer::Incomplete;
    };
    if checksum(message) != 0 {
        return Answer::Wrong("its checksum is wrong");
    }
    if end != b"\r\n" {
        return Answer::Wrong("it does not end where it should");
    }
    Answer::Whole(*payload)
}

/// A payload of letters and one number at its end.
pub(crate) fn number<const N: usize>(bytes: &[u8]) -> Answer<i16> {
    match payload::<N>(bytes) {
        Answer::Whole(payload) => match payload.last_chunk() {
            Some(&number) => Answer::Whole(i16::from_be_bytes(number)),
            None => Answer::Wrong("it has no number"),
        },
        Answer::Wrong(why) => Answer::Wrong(why),
        Answer::Incomplete => Answer::Incomplete,
    }
}

/// The answer to `MwCA`: `MCA`, a status, the highest and the lowest focal power.
pub(crate) fn focal_power_limits(bytes: &[u8]) -> Answer<(i16, i16)> {
    match payload::<8>(bytes) {
        Answer::Whole([_, _, _, _, high @ .., low_high, low_low]) => {
            Answer::Whole((i16::from_be_bytes([low_high, low_low]), i16::from_be_bytes(high)))
        }
        Answer::Wrong(why) => Answer::Wrong(why),
        Answer::Incomplete => Answer::Incomplete,
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn answer(payload: &[u8]) -> Vec<u8> {
        [payload, &checksum(payload).to_le_bytes(), b"\r\n"].concat()
    }

    #[test]
    fn the_worked_examples() {
        assert_eq!(checksum(b"123456789"), 0xBB3D);
        for (command, end) in [
            (Command::FirmwareType, [0x00, 0x36]),
            (Command::SerialNumber, [0x01, 0xFA]),
            (Command::CurrentMode, [0x54, 0x46]),
            (Command::FocalPowerMode, [0x56, 0x76]),
            (Command::UpperCurrent, [0x77, 0x20]),
            (Command::SetCurrent(0), [0xA4, 0x26]),
            (Command::SetCurrent(0x7FF), [0xE6, 0x56]),
            (Command::Current, [0xB4, 0x27]),
            (Command::SetFocalPower(2000), [0x31, 0xFD]),
            (Command::FocalPower, [0x64, 0x70]),
        ] {
            let frame = command.encode();
            assert!(frame.ends_with(&end), "{command:?}: {frame:02x?}");
            assert_eq!(checksum(&frame), 0);
        }
        let focal_power = [0x50, 0x77, 0x44, 0x41, 0x07, 0xD0, 0x00, 0x00, 0x31, 0xFD];
        assert_eq!(Command::SetFocalPower(2000).encode(), focal_power);
    }

    #[test]
    fn answers_are_read_by_length_and_checksum() {
        // A payload that contains the end of a line.
        assert_eq!(number::<3>(&answer(b"A\r\n")), Answer::Whole(0x0D0A));
        assert_eq!(number::<5>(&answer(b"CLA\xFF\x00")), Answer::Whole(-256));
        assert_eq!(focal_power_limits(&answer(b"MCA\x00\x03\xE8\xFE\x0C")), Answer::Whole((-500, 1000)));
        let mut spoilt = answer(b"A\x01\x02");
        spoilt[1] ^= 0x10;
        assert_eq!(number::<3>(&spoilt), Answer::Wrong("its checksum is wrong"));
        assert!(matches!(number::<3>(b"N\r\n"), Answer::Wrong(_)));
        assert!(matches!(number::<3>(b"E1\r\n"), Answer::Wrong(_)));
        assert_eq!(ready(b"xReady\r\n"), Answer::Whole(()));
    }

    proptest! {
        /// Every number survives; no bytes make a parser panic; a prefix is never an answer.
        #[test]
        fn numbers_survive(value: i16, garbage in prop::collection::vec(any::<u8>(), 0..64)) {
            let bytes = answer(&[b"A", &value.to_be_bytes()[..]].concat());
            prop_assert_eq!(number::<3>(&bytes), Answer::Whole(value));
            for length in 0..bytes.len() {
                prop_assert_eq!(number::<3>(&bytes[..length]), Answer::Incomplete);
            }
            let (_, _, _) = (number::<3>(&garbage), focal_power_limits(&garbage), ready(&garbage));
        }
    }
}
