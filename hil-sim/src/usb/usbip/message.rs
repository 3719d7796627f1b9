//! Commands and their answers, as bytes. All numbers are big-endian.

use super::UsbIpError;

/// Bytes before the data of a transfer.
pub(super) const HEADER: usize = 48;
/// Far more than a transfer of usbfs.
pub(super) const LONGEST: u32 = 16 << 20;

const SUBMIT: u32 = 1;
const UNLINK: u32 = 2;
const SUBMITTED: u32 = 3;
const UNLINKED: u32 = 4;
/// Data goes to the host.
const IN: u32 = 1;

/// What the host wants.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Command {
    /// A transfer.
    Submit(Transfer),
    /// Give back the transfer `victim`, if it still waits.
    Unlink { sequence: u32, victim: u32 },
}

/// A transfer under way, an URB in the kernel's words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Transfer {
    pub(super) sequence: u32,
    /// With the direction in bit 7; endpoint 0 has both.
    pub(super) endpoint: u8,
    pub(super) is_in: bool,
    /// Bytes asked for; bytes sent are in `data`.
    pub(super) length: usize,
    pub(super) setup: [u8; 8],
    pub(super) data: Vec<u8>,
}

/// The word at `index` of a header; headers are whole.
fn word(header: &[u8; HEADER], index: usize) -> u32 {
    header.as_chunks::<4>().0.get(index).copied().map(u32::from_be_bytes).unwrap_or_default()
}

/// The first command in `bytes` and its length; `None` while it is not whole.
pub(super) fn parse(bytes: &[u8]) -> Result<Option<(Command, usize)>, UsbIpError> {
    let Some(header) = bytes.first_chunk::<HEADER>() else { return Ok(None) };
    let word = |index| word(header, index);
    let sequence = word(1);
    match word(0) {
        SUBMIT => {
            let (is_in, number, length, packets) = (word(3) == IN, word(4), word(6), word(8));
            let address = u8::try_from(number).ok().filter(|number| *number < 16);
            let address = address.ok_or(UsbIpError::NoSuchEndpoint(number))?;
            if length > LONGEST {
                return Err(UsbIpError::TooLong(length));
            }
            // Kernels say 0 or -1 for what is not isochronous.
            if packets != 0 && packets != u32::MAX {
                return Err(UsbIpError::Isochronous(packets));
            }
            let length = length as usize;
            let end = HEADER + if is_in { 0 } else { length };
            let Some(data) = bytes.get(HEADER..end) else { return Ok(None) };
            let setup = header.last_chunk::<8>().copied().unwrap_or_default();
            let endpoint = if is_in && address != 0 { address | 0x80 } else { address };
            let data = data.to_vec();
            Ok(Some((Command::Submit(Transfer { sequence, endpoint, is_in, length, setup, data }), end)))
        }
        UNLINK => Ok(Some((Command::Unlink { sequence, victim: word(5) }, HEADER))),
        command => Err(UsbIpError::UnknownCommand(command)),
    }
}

fn answer(kind: u32, sequence: u32, status: i32, length: usize, answers: &mut Vec<u8>) {
    let end = answers.len() + HEADER;
    answers.extend(kind.to_be_bytes());
    answers.extend(sequence.to_be_bytes());
    answers.extend([0; 12]);
    answers.extend(status.to_be_bytes());
    answers.extend((length as u32).to_be_bytes());
    answers.resize(end, 0);
}

/// A transfer has ended, with data for the host or `sent` bytes taken from it.
pub(super) fn submitted(transfer: &Transfer, status: i32, data: &[u8], sent: usize, answers: &mut Vec<u8>) {
    let length = if transfer.is_in { data.len() } else { sent };
    answer(SUBMITTED, transfer.sequence, status, length, answers);
    if transfer.is_in {
        answers.extend_from_slice(data);
    }
}

/// The transfer that was to be given back had (`status` 0) or had not yet ended.
pub(super) fn unlinked(sequence: u32, status: i32, answers: &mut Vec<u8>) {
    answer(UNLINKED, sequence, status, 0, answers);
}
