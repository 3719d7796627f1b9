//! The board's messages ("treuzell"): a property, the size of what follows, and that; 32-bit numbers, little-endian.

/// What a message is about.
pub(super) mod property {
    /// The serial number: eight bytes, four on old boards.
    pub(crate) const SERIAL: u32 = 0x72;
    /// The firmware's version.
    pub(crate) const RELEASE_VERSION: u32 = 0x79;
    /// Names of the sensor that a device is compatible with.
    pub(crate) const DEVICE_COMPATIBLE: u32 = 0x1_0003;
    /// Registers of a device.
    pub(crate) const REGISTERS: u32 = 0x1_0102;
    /// Added to a property that is written.
    pub(crate) const WRITE: u32 = 0x4000_0000;
    /// The answer's property when the firmware does not know the request's; added to it when the request failed.
    pub(crate) const FAILED: u32 = 0x8000_0000;
}

/// The sensor, among the board's devices.
pub(super) const SENSOR: u32 = 0;
/// The longest answer, bytes.
pub(super) const MAX_ANSWER: usize = 1024;
/// Property and size, before the payload.
const HEADER: usize = 8;
/// Device and address, before registers' values.
const REGISTERS_HEADER: usize = 8;

/// An answer that is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(super) enum AnswerError {
    /// The message is cut short, or longer than it says.
    #[error("an answer of {bytes} bytes that states another size")]
    Size {
        /// Bytes that came.
        bytes: usize,
    },
    /// The answer is to something else.
    #[error("an answer to property {answered:#x}, not to {asked:#x}")]
    Other {
        /// Property of the request.
        asked: u32,
        /// Property of the answer.
        answered: u32,
    },
    /// The firmware does not know the property.
    #[error("the firmware does not know property {asked:#x}")]
    NotImplemented {
        /// Property of the request.
        asked: u32,
    },
    /// The firmware could not do it.
    #[error("the firmware failed with code {code} at property {asked:#x}")]
    Failed {
        /// Property of the request.
        asked: u32,
        /// What it says, like Linux's error numbers.
        code: u32,
    },
    /// The answer holds less, or another register, than was asked for.
    #[error("an answer to property {asked:#x} without what was asked for")]
    Content {
        /// Property of the request.
        asked: u32,
    },
}

/// The request about `property` with `payload`.
pub(super) fn request(property: u32, payload: &[u32]) -> Vec<u8> {
    let size = payload.len() * 4;
    let mut message = Vec::with_capacity(HEADER + size);
    message.extend_from_slice(&property.to_le_bytes());
    message.extend_from_slice(&(size as u32).to_le_bytes());
    message.extend(payload.iter().flat_map(|word| word.to_le_bytes()));
    message
}

/// The payload of the answer to a request about `asked`.
pub(super) fn payload(asked: u32, answer: &[u8]) -> Result<&[u8], AnswerError> {
    let wrong_size = AnswerError::Size { bytes: answer.len() };
    let (answered, rest) = word(answer).ok_or(wrong_size)?;
    let (size, payload) = word(rest).ok_or(wrong_size)?;
    if answered == property::FAILED {
        return Err(AnswerError::NotImplemented { asked });
    }
    if answered == asked | property::FAILED {
        let code = word(payload).map_or(0, |(code, _)| code);
        return Err(AnswerError::Failed { asked, code });
    }
    if answered != asked {
        return Err(AnswerError::Other { asked, answered });
    }
    if usize::try_from(size) != Ok(payload.len()) {
        return Err(wrong_size);
    }
    Ok(payload)
}

/// The first number of an answer about `asked`.
pub(super) fn number(asked: u32, answer: &[u8]) -> Result<u32, AnswerError> {
    let payload = payload(asked, answer)?;
    word(payload).map(|(number, _)| number).ok_or(AnswerError::Content { asked })
}

/// The value of the register at `address` in the answer to a request for it alone.
pub(super) fn register(address: u32, answer: &[u8]) -> Result<u32, AnswerError> {
    let asked = property::REGISTERS;
    let payload = payload(asked, answer)?;
    let value = payload.get(REGISTERS_HEADER..).and_then(|rest| rest.try_into().ok()).map(u32::from_le_bytes);
    let echoed = word(payload).and_then(|(device, rest)| Some((device, word(rest)?.0)));
    value.filter(|_| echoed == Some((SENSOR, address))).ok_or(AnswerError::Content { asked })
}

/// Checks the answer to a write of registers from `address` on.
pub(super) fn written(address: u32, answer: &[u8]) -> Result<(), AnswerError> {
    let asked = property::REGISTERS | property::WRITE;
    let payload = payload(asked, answer)?;
    let echoed = word(payload).and_then(|(device, rest)| Some((device, word(rest)?.0)));
    if echoed == Some((SENSOR, address)) { Ok(()) } else { Err(AnswerError::Content { asked }) }
}

/// Whether an answer about [`property::DEVICE_COMPATIBLE`] has one of `names` among its strings.
pub(super) fn is_compatible(answer: &[u8], names: &[&str]) -> Result<bool, AnswerError> {
    let payload = payload(property::DEVICE_COMPATIBLE, answer)?;
    let strings = payload.get(4..).unwrap_or_default().split(|&byte| byte == 0);
    Ok(strings.into_iter().any(|string| names.iter().any(|name| name.as_bytes() == string)))
}

/// The first number of `bytes`, and the rest.
fn word(bytes: &[u8]) -> Option<(u32, &[u8])> {
    bytes.split_first_chunk().map(|(first, rest)| (u32::from_le_bytes(*first), rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_those_on_the_wire() {
        let read = request(property::REGISTERS, &[SENSOR, 0x14, 1]);
        assert_eq!(read, [2, 1, 1, 0, 12, 0, 0, 0, 0, 0, 0, 0, 0x14, 0, 0, 0, 1, 0, 0, 0]);
        let write = request(property::REGISTERS | property::WRITE, &[SENSOR, 0x9028, 2]);
        assert_eq!(write[..8], [2, 1, 1, 0x40, 12, 0, 0, 0]);
    }

    #[test]
    fn answers_are_checked() {
        let good = request(property::REGISTERS, &[SENSOR, 0x14, 0xA040_1806]);
        assert_eq!(register(0x14, &good), Ok(0xA040_1806));
        assert_eq!(register(0x18, &good), Err(AnswerError::Content { asked: property::REGISTERS }));
        assert_eq!(register(0x14, &good[..19]), Err(AnswerError::Size { bytes: 19 }));
        assert_eq!(register(0x14, &[]), Err(AnswerError::Size { bytes: 0 }));
        let other = AnswerError::Other { asked: property::SERIAL, answered: property::REGISTERS };
        assert_eq!(number(property::SERIAL, &good), Err(other));
        let unknown = request(property::FAILED, &[]);
        assert_eq!(number(0x55, &unknown), Err(AnswerError::NotImplemented { asked: 0x55 }));
        let failed = request(0x55 | property::FAILED, &[5]);
        assert_eq!(number(0x55, &failed), Err(AnswerError::Failed { asked: 0x55, code: 5 }));
        assert_eq!(number(0x55, &request(0x55, &[])), Err(AnswerError::Content { asked: 0x55 }));
    }

    #[test]
    fn names_are_found_among_strings() {
        let mut answer = request(property::DEVICE_COMPATIBLE, &[SENSOR, 0, 0, 0, 0]);
        answer[12..28].copy_from_slice(b"treuzell\0imx636\0");
        assert_eq!(is_compatible(&answer, &["imx636"]), Ok(true));
        assert_eq!(is_compatible(&answer, &["imx"]), Ok(false));
    }
}
