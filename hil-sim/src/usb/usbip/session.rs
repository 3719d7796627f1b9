//! One connection, as a state machine.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use evfocus_core::HostMicros;
use evfocus_hal::Clock;
use evfocus_hal::usb::{UsbError, UsbIdentity};

use super::super::UsbPort;
use super::super::descriptors::Description;
use super::super::link::{Link, Step};
use super::UsbIpError;
use super::control::Endpoint0;
use super::message::{self, Command, Transfer};

/// Transfers that may wait: several times what any driver queues.
const MOST_WAITING: usize = 4096;
/// Steps of the rig that are made in one go, so that the host is heard in between when the rig is late.
const STEPS: usize = 16;
/// What a halted endpoint, a transfer that was given back, and a packet that is too long end with: Linux's EPIPE, ECONNRESET and
/// EOVERFLOW.
const STALLED: i32 = -32;
const GIVEN_BACK: i32 = -104;
const OVERFLOW: i32 = -75;
const PROTOCOL: i32 = -71;
const NO_MEMORY: i32 = -12;

/// The device's side of a connection. Bytes in, bytes out; time is the rig's clock.
pub struct Session {
    link: Link,
    clock: Arc<dyn Clock>,
    identity: UsbIdentity,
    description: &'static Description,
    data_endpoint: u8,
    endpoint0: Endpoint0,
    /// Bytes of a command that is not whole yet.
    input: Vec<u8>,
    /// Requests that the device is slow to answer, with the time at which it does.
    slow: VecDeque<(HostMicros, Transfer)>,
    /// Transfers to the host that the device has nothing for yet, in their order.
    waiting: VecDeque<Transfer>,
}

impl std::fmt::Debug for Session {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Session")
            .field("identity", &self.identity)
            .field("waiting", &self.waiting.len())
            .finish_non_exhaustive()
    }
}

/// What the bus shows of an error, for the kernel.
fn status(error: UsbError) -> i32 {
    match error {
        UsbError::Stalled => STALLED,
        UsbError::OutOfMemory => NO_MEMORY,
        UsbError::System(number) => -i32::try_from(number).unwrap_or(-PROTOCOL),
        UsbError::Fault | UsbError::TimedOut | UsbError::Disconnected => PROTOCOL,
    }
}

impl UsbPort {
    /// Attaches the camera to a USB/IP host.
    ///
    /// # Errors
    /// [`UsbIpError::Unplugged`] while its cable is out.
    pub fn attach(&self) -> Result<Session, UsbIpError> {
        let (identity, link) = self.connect().map_err(|_| UsbIpError::Unplugged)?;
        let (description, data_endpoint) =
            link.peek(|shared| (shared.device.description(), shared.device.data_endpoint()));
        Ok(Session {
            link,
            clock: self.rig.clock(),
            identity,
            description,
            data_endpoint,
            endpoint0: Endpoint0::default(),
            input: Vec::new(),
            slow: VecDeque::new(),
            waiting: VecDeque::new(),
        })
    }
}

impl Session {
    pub(super) fn identity(&self) -> &UsbIdentity {
        &self.identity
    }

    pub(super) fn description(&self) -> &'static Description {
        self.description
    }

    /// Takes bytes from the host, and appends what is answered at once.
    ///
    /// # Errors
    /// The connection must be closed: the camera is unplugged, or the host does not keep to the protocol.
    pub fn receive(&mut self, bytes: &[u8], answers: &mut Vec<u8>) -> Result<(), UsbIpError> {
        self.input.extend_from_slice(bytes);
        let mut done = 0;
        while let Some((command, length)) = message::parse(self.input.get(done..).unwrap_or_default())? {
            done += length;
            match command {
                Command::Submit(transfer) => self.submit(transfer, answers)?,
                Command::Unlink { sequence, victim } => self.unlink(sequence, victim, answers),
            }
        }
        self.input.drain(..done);
        Ok(())
    }

    /// Lets the rig go on to the present, as far as the host has transfers waiting, and appends what they got. Returns whether
    /// there is more to do at once.
    ///
    /// # Errors
    /// [`UsbIpError::Unplugged`]: the connection must be closed.
    pub fn advance(&mut self, answers: &mut Vec<u8>) -> Result<bool, UsbIpError> {
        let now = self.clock.now();
        while self.slow.front().is_some_and(|(due, _)| *due <= now) {
            if let Some((_, transfer)) = self.slow.pop_front() {
                self.perform(&transfer, answers)?;
            }
        }
        self.give_answers(answers)?;
        for _ in 0..STEPS {
            self.give_data(answers)?;
            if !self.waits_for_data() {
                break;
            }
            match self.link.step(Duration::ZERO, usize::MAX).map_err(unplugged)? {
                Step::Advanced => {}
                Step::Early | Step::Stopped => return Ok(false),
            }
        }
        if self.link.is_pulled() { Err(UsbIpError::Unplugged) } else { Ok(self.waits_for_data()) }
    }

    fn waits_for_data(&self) -> bool {
        self.waiting.iter().any(|transfer| transfer.endpoint == self.data_endpoint)
    }

    fn submit(&mut self, transfer: Transfer, answers: &mut Vec<u8>) -> Result<(), UsbIpError> {
        let is_known = transfer.endpoint == 0
            || self.description.endpoints.iter().any(|endpoint| endpoint.address == transfer.endpoint);
        if !is_known {
            message::submitted(&transfer, STALLED, &[], 0, answers);
            return Ok(());
        }
        if self.waiting.len() + self.slow.len() >= MOST_WAITING {
            return Err(UsbIpError::TooManyTransfers(MOST_WAITING));
        }
        if transfer.endpoint & 0x80 != 0 {
            self.waiting.push_back(transfer);
            return Ok(());
        }
        let delay = self.link.peek(|shared| shared.faults.control_delay);
        if delay.is_zero() && self.slow.is_empty() {
            return self.perform(&transfer, answers);
        }
        let last = self.slow.back().map_or(self.clock.now(), |(due, _)| *due);
        self.slow.push_back((last + delay, transfer));
        Ok(())
    }

    fn unlink(&mut self, sequence: u32, victim: u32, answers: &mut Vec<u8>) {
        let before = self.waiting.len() + self.slow.len();
        self.waiting.retain(|transfer| transfer.sequence != victim);
        self.slow.retain(|(_, transfer)| transfer.sequence != victim);
        let has_waited = self.waiting.len() + self.slow.len() < before;
        message::unlinked(sequence, if has_waited { GIVEN_BACK } else { 0 }, answers);
    }

    /// Does what a transfer to the device, or a request, is about.
    fn perform(&mut self, transfer: &Transfer, answers: &mut Vec<u8>) -> Result<(), UsbIpError> {
        let done = if transfer.endpoint == 0 {
            let Self { link, identity, description, endpoint0, .. } = self;
            endpoint0.respond(transfer.setup.into(), &transfer.data, link, identity, description)
        } else {
            self.link.bulk_out(transfer.endpoint, &transfer.data).map(|()| Vec::new())
        };
        match done {
            Ok(mut answer) => {
                answer.truncate(transfer.length);
                message::submitted(transfer, 0, &answer, transfer.data.len(), answers);
            }
            Err(UsbError::Disconnected) => return Err(UsbIpError::Unplugged),
            Err(error) => message::submitted(transfer, status(error), &[], 0, answers),
        }
        Ok(())
    }

    /// Gives the answers that the device has ready on endpoints other than that of the data.
    fn give_answers(&mut self, answers: &mut Vec<u8>) -> Result<(), UsbIpError> {
        let mut still = VecDeque::new();
        for transfer in std::mem::take(&mut self.waiting) {
            let answer = if transfer.endpoint == self.data_endpoint {
                None
            } else {
                self.link.answer(transfer.endpoint).map_err(unplugged)?
            };
            match answer {
                Some(mut answer) => {
                    let status = if answer.len() > transfer.length { OVERFLOW } else { 0 };
                    answer.truncate(transfer.length);
                    message::submitted(&transfer, status, &answer, 0, answers);
                }
                None => still.push_back(transfer),
            }
        }
        self.waiting = still;
        Ok(())
    }

    /// Ends as many of the transfers that wait for data as can be.
    fn give_data(&mut self, answers: &mut Vec<u8>) -> Result<(), UsbIpError> {
        while let Some(index) =
            self.waiting.iter().position(|transfer| transfer.endpoint == self.data_endpoint)
        {
            let Some(length) = self.waiting.get(index).map(|transfer| transfer.length) else { break };
            let (status, data) = match self.link.strike() {
                Ok(None) => match self.take(length) {
                    Some(taken) => taken,
                    None => break,
                },
                Ok(Some(babble)) => (0, babble),
                Err(UsbError::Disconnected) => return Err(UsbIpError::Unplugged),
                Err(error) => (status(error), Vec::new()),
            };
            if let Some(transfer) = self.waiting.remove(index) {
                let data = data.get(..length).unwrap_or(&data);
                message::submitted(&transfer, status, data, 0, answers);
            }
        }
        Ok(())
    }

    /// What ends a transfer of `length` bytes, if that is there: so many bytes, or a packet that is not full. With its status:
    /// a packet that does not fit has overflowed, and is lost.
    fn take(&mut self, length: usize) -> Option<(i32, Vec<u8>)> {
        let speed = self.identity.speed?;
        let endpoint =
            self.description.endpoints.iter().find(|endpoint| endpoint.address == self.data_endpoint)?;
        let packet = usize::from(endpoint.packet(speed));
        let mut taken = 0;
        let mut status = None;
        'transfers: for (_, sent) in &self.link.ready {
            for piece in sent.chunks(packet) {
                if taken == length {
                    break 'transfers;
                }
                if taken + piece.len() > length {
                    status = Some(OVERFLOW);
                    break 'transfers;
                }
                taken += piece.len();
                if piece.len() < packet {
                    status = Some(0);
                    break 'transfers;
                }
            }
        }
        let status = if taken == length { status.or(Some(0)) } else { status }?;
        let mut data = Vec::with_capacity(taken);
        while data.len() < taken {
            let (_, sent) = self.link.ready.front_mut()?;
            let piece = sent.len().min(taken - data.len());
            data.extend(sent.drain(..piece));
            if sent.is_empty() {
                self.link.ready.pop_front();
            }
        }
        if status == OVERFLOW
            && let Some((_, sent)) = self.link.ready.front_mut()
        {
            let piece = sent.len().min(packet);
            sent.drain(..piece);
            if sent.is_empty() {
                self.link.ready.pop_front();
            }
        }
        Some((status, data))
    }
}

/// Of what can go wrong with a device that is asked, only this is not the transfer's affair.
fn unplugged(_: UsbError) -> UsbIpError {
    UsbIpError::Unplugged
}
