//! Modbus TCP as LabJack's T series speaks it: big-endian, a 32-bit value in two registers, high word first.

use crate::line::Answer;

/// `AIN0`, volts; two registers a channel.
const FIRST_INPUT: u16 = 0;
/// `DAC0`, volts; `DAC1` follows.
pub const OUTPUTS: u16 = 1000;
/// `TEST`: always [`TEST_VALUE`], to see that words come in the right order.
pub const TEST: u16 = 55_100;
/// What `TEST` reads.
pub const TEST_VALUE: u32 = 0x0011_2233;
/// `PRODUCT_ID`: 4, 7 or 8.
pub const PRODUCT: u16 = 60_000;
/// `SERIAL_NUMBER`.
pub const SERIAL: u16 = 60_028;

const READ: u8 = 3;
const WRITE: u8 = 16;
/// The device takes any unit.
const UNIT: u8 = 1;
/// Transaction, protocol, length.
const HEADER: usize = 6;
/// Longer frames there are not.
const LONGEST_FRAME: usize = 260;

/// The register of an analog input, `AIN0` to `AIN13`.
pub fn input(channel: u8) -> u16 {
    FIRST_INPUT + 2 * u16::from(channel)
}

fn frame(transaction: u16, function: u8, rest: &[u8]) -> Vec<u8> {
    let length = 2 + rest.len() as u16;
    let mut frame = Vec::with_capacity(HEADER + usize::from(length));
    for word in [transaction, 0, length] {
        frame.extend(word.to_be_bytes());
    }
    frame.extend([UNIT, function]);
    frame.extend(rest);
    frame
}

/// Asks for the 32-bit value at `register`.
pub fn read(transaction: u16, register: u16) -> Vec<u8> {
    frame(transaction, READ, &[register.to_be_bytes(), 2_u16.to_be_bytes()].concat())
}

/// Sets the values from `register` on.
pub fn write(transaction: u16, register: u16, values: &[f32]) -> Vec<u8> {
    let registers = 2 * values.len() as u16;
    let mut rest = [register.to_be_bytes(), registers.to_be_bytes()].concat();
    rest.push(2 * registers as u8);
    rest.extend(values.iter().flat_map(|value| value.to_be_bytes()));
    frame(transaction, WRITE, &rest)
}

/// The body, function first, of the answer to `transaction`; answers to earlier ones are passed over.
fn answer(transaction: u16, mut bytes: &[u8]) -> Answer<&[u8]> {
    while let Some(&[high, low, 0, 0, length_high, length_low]) = bytes.first_chunk::<HEADER>() {
        let length = usize::from(u16::from_be_bytes([length_high, length_low]));
        if !(3..=LONGEST_FRAME).contains(&length) {
            return Answer::Wrong("no frame has this length");
        }
        let Some((body, rest)) = bytes.get(HEADER..).and_then(|rest| rest.split_at_checked(length)) else {
            return Answer::Incomplete;
        };
        if u16::from_be_bytes([high, low]) == transaction {
            return Answer::Whole(body.get(1..).unwrap_or_default());
        }
        bytes = rest;
    }
    if bytes.len() < HEADER { Answer::Incomplete } else { Answer::Wrong("not Modbus TCP") }
}

/// The 32-bit value that [`read`] asked for.
pub(crate) fn value(transaction: u16, bytes: &[u8]) -> Answer<[u8; 4]> {
    match answer(transaction, bytes) {
        Answer::Whole(&[READ, 4, a, b, c, d]) => Answer::Whole([a, b, c, d]),
        Answer::Whole(&[0x83, 2]) => Answer::Wrong("there is no such register"),
        Answer::Whole(_) => Answer::Wrong("a refusal"),
        Answer::Wrong(why) => Answer::Wrong(why),
        Answer::Incomplete => Answer::Incomplete,
    }
}

/// That [`write`] was obeyed.
pub(crate) fn written(transaction: u16, bytes: &[u8]) -> Answer<()> {
    match answer(transaction, bytes) {
        Answer::Whole(&[WRITE, ..]) => Answer::Whole(()),
        Answer::Whole(_) => Answer::Wrong("a refusal"),
        Answer::Wrong(why) => Answer::Wrong(why),
        Answer::Incomplete => Answer::Incomplete,
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_worked_examples() {
        assert_eq!(read(1, input(0)), [0, 1, 0, 0, 0, 6, 1, 3, 0, 0, 0, 2]);
        let reply = [0, 1, 0, 0, 0, 7, 1, 3, 4, 0x3F, 0x9E, 0x04, 0x19];
        let Answer::Whole(bytes) = value(1, &reply) else { panic!("a value") };
        assert!((f32::from_be_bytes(bytes) - 1.2345).abs() < 1e-6);
        assert_eq!(
            write(2, OUTPUTS, &[2.5]),
            [0, 2, 0, 0, 0, 0x0B, 1, 0x10, 3, 0xE8, 0, 2, 4, 0x40, 0x20, 0, 0]
        );
        assert_eq!(written(2, &[0, 2, 0, 0, 0, 6, 1, 0x10, 3, 0xE8, 0, 2]), Answer::Whole(()));
        assert_eq!(value(3, &[0, 3, 0, 0, 0, 3, 1, 0x83, 2]), Answer::Wrong("there is no such register"));
        // A late answer to an earlier question comes first.
        let late = [&[0, 1, 0, 0, 0, 3, 1, 0x83, 2][..], &[0, 4, 0, 0, 0, 7, 1, 3, 4, 0, 0, 0, 9]].concat();
        assert_eq!(value(4, &late), Answer::Whole([0, 0, 0, 9]));
        assert_eq!(value(4, &late[..12]), Answer::Incomplete);
        assert!(matches!(value(1, b"HTTP/1.1 400 Bad Request"), Answer::Wrong(_)));
    }

    proptest! {
        /// No bytes make a parser panic, and no prefix of an answer is an answer.
        #[test]
        fn any_bytes(garbage in prop::collection::vec(any::<u8>(), 0..600), number: u32, transaction: u16) {
            let (_, _) = (value(transaction, &garbage), written(transaction, &garbage));
            let reply = frame(transaction, READ, &[&[4][..], &number.to_be_bytes()].concat());
            prop_assert_eq!(value(transaction, &reply), Answer::Whole(number.to_be_bytes()));
            for length in 0..reply.len() {
                prop_assert_eq!(value(transaction, &reply[..length]), Answer::Incomplete);
            }
        }
    }
}
