//! Requests and answers over the two control endpoints.

use std::time::Duration;

use evfocus_hal::usb::{UsbError, UsbTransport};

use super::protocol::{self, AnswerError, MAX_ANSWER, SENSOR, property};
use super::sequences::Step;

/// Where requests go.
const REQUESTS: u8 = 0x02;
/// Where answers come from.
const ANSWERS: u8 = 0x82;
/// How long an answer may take; OpenEB waits that long.
const ANSWER_TIME: Duration = Duration::from_secs(10);

/// A request that was not answered as it must be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(super) enum BoardError {
    /// The transfer failed.
    #[error(transparent)]
    Usb(#[from] UsbError),
    /// The answer is none.
    #[error(transparent)]
    Answer(#[from] AnswerError),
}

/// Sends a request and hands its answer to `take`.
fn ask<T>(
    transport: &mut impl UsbTransport,
    property: u32,
    payload: &[u32],
    take: impl FnOnce(&[u8]) -> Result<T, AnswerError>,
) -> Result<T, BoardError> {
    transport.bulk_out(REQUESTS, &protocol::request(property, payload))?;
    let mut answer = [0; MAX_ANSWER];
    let got = transport.bulk_in(ANSWERS, &mut answer, ANSWER_TIME)?;
    Ok(take(answer.get(..got).unwrap_or_default())?)
}

/// The number that the firmware gives for `property`.
pub(super) fn number(transport: &mut impl UsbTransport, property: u32) -> Result<u32, BoardError> {
    ask(transport, property, &[], |answer| protocol::number(property, answer))
}

/// Whether the board's sensor is one of `names`.
pub(super) fn is_compatible(transport: &mut impl UsbTransport, names: &[&str]) -> Result<bool, BoardError> {
    ask(transport, property::DEVICE_COMPATIBLE, &[SENSOR], |answer| protocol::is_compatible(answer, names))
}

/// Reads a register.
pub(super) fn read(transport: &mut impl UsbTransport, address: u32) -> Result<u32, BoardError> {
    ask(transport, property::REGISTERS, &[SENSOR, address, 1], |answer| protocol::register(address, answer))
}

/// Writes registers from `address` on.
pub(super) fn write(
    transport: &mut impl UsbTransport,
    address: u32,
    values: &[u32],
) -> Result<(), BoardError> {
    let payload = [&[SENSOR, address], values].concat();
    let property = property::REGISTERS | property::WRITE;
    ask(transport, property, &payload, |answer| protocol::written(address, answer))
}

/// Writes the bits of `mask`.
pub(super) fn write_bits(
    transport: &mut impl UsbTransport,
    address: u32,
    value: u32,
    mask: u32,
) -> Result<(), BoardError> {
    let old = read(transport, address)?;
    write(transport, address, &[old & !mask | value & mask])
}

/// Goes through `steps`; `wait` waits.
pub(super) fn run(
    transport: &mut impl UsbTransport,
    steps: &[Step],
    wait: impl Fn(Duration),
) -> Result<(), BoardError> {
    for &step in steps {
        match step {
            Step::Write(address, value) => write(transport, address, &[value])?,
            Step::WriteBits(address, value, mask) => write_bits(transport, address, value, mask)?,
            Step::Wait(duration) => wait(duration),
        }
    }
    Ok(())
}
