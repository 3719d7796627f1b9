//! Parameters as the bytes of control transfers. All numbers are big-endian.

use evfocus_hal::usb::VendorRequest;

use super::registers::{PARAMETER_REQUEST, Parameter};

/// The request that reads or writes `parameter`; its data is a [`value`].
pub(super) fn one(parameter: Parameter) -> VendorRequest {
    let Parameter { module, address } = parameter;
    VendorRequest { request: PARAMETER_REQUEST, value: u16::from(module), index: u16::from(address) }
}

/// The data of a write.
pub(super) fn value(value: u32) -> [u8; 4] {
    value.to_be_bytes()
}

/// The value in the answer to a read; `None` unless it has four bytes.
pub(super) fn value_of(answer: &[u8]) -> Option<u32> {
    answer.try_into().ok().map(u32::from_be_bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_those_of_the_protocol() {
        let parameter = Parameter { module: 3, address: 7 };
        assert_eq!(one(parameter), VendorRequest { request: 0xBF, value: 3, index: 7 });
        assert_eq!(value(0x0102_0304), [1, 2, 3, 4]);
        assert_eq!((value_of(&[0, 0, 1, 2]), value_of(&[1, 2]), value_of(&[])), (Some(258), None, None));
    }
}
