//! The device and its pixels, as the front ends see them. Nothing here waits unless it is told for how long.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use evfocus_core::{CameraMicros, EventBatch, HostMicros};
use evfocus_hal::usb::{UsbError, VendorRequest};
use evfocus_hal::{Camera, DeviceError, DeviceErrorKind};

use super::{Shared, lock};

/// Events that the simulated camera hands over at a time.
const BATCH_EVENTS: usize = 65_536;

/// What became of the wish to go on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Step {
    /// The device does not run.
    Stopped,
    /// Nothing has happened yet.
    Early,
    /// Time went on, events or not.
    Advanced,
}

/// One connection to the device: dead once the cable has been pulled.
#[derive(Debug)]
pub(super) struct Link {
    shared: Arc<Mutex<Shared>>,
    plug: u32,
    batch: EventBatch,
    /// Camera time of the last step.
    reached: Option<CameraMicros>,
    /// Transfers that the device has sent and nobody has taken, with their arrival.
    pub(super) ready: VecDeque<(HostMicros, Vec<u8>)>,
    sent: u32,
    /// Device time until which nothing is sent.
    overflow_until: Option<CameraMicros>,
    random: u32,
}

/// The pixels' failures, as the bus shows them.
fn bus_error(error: &DeviceError) -> UsbError {
    if error.kind == DeviceErrorKind::Disconnected { UsbError::Disconnected } else { UsbError::Fault }
}

impl Link {
    pub(super) fn new(shared: Arc<Mutex<Shared>>) -> Self {
        let plug = lock(&shared).plug;
        Self {
            shared,
            plug,
            batch: EventBatch::with_capacity(BATCH_EVENTS),
            reached: None,
            ready: VecDeque::new(),
            sent: 0,
            overflow_until: None,
            random: 1,
        }
    }

    /// Looks at the device, wherever its cable is.
    pub(super) fn peek<T>(&self, look: impl FnOnce(&Shared) -> T) -> T {
        look(&lock(&self.shared))
    }

    /// Whether the cable has been pulled since the connection was made.
    pub(super) fn is_pulled(&self) -> bool {
        is_pulled(&mut lock(&self.shared), self.plug)
    }

    /// Does `what` with the device; then the pixels follow its registers.
    pub(super) fn request<T>(
        &mut self,
        what: impl FnOnce(&mut Shared) -> Result<T, UsbError>,
    ) -> Result<T, UsbError> {
        let mut shared = lock(&self.shared);
        if is_pulled(&mut shared, self.plug) {
            return Err(UsbError::Disconnected);
        }
        let was_running = shared.device.is_running();
        let done = what(&mut shared)?;
        match (was_running, shared.device.is_running()) {
            (false, true) => {
                shared.camera.start().map_err(|error| bus_error(&error))?;
                let now = shared.camera.reached().unwrap_or_default();
                shared.device.begin(now);
                // What nobody had taken when the stream ended was drained.
                self.ready.clear();
            }
            (true, false) => shared.camera.stop().map_err(|error| bus_error(&error))?,
            (true, true) | (false, false) => {}
        }
        Ok(done)
    }

    fn next_random(&mut self) -> u32 {
        self.random ^= self.random << 13;
        self.random ^= self.random >> 17;
        self.random ^= self.random << 5;
        self.random
    }

    /// Faults that strike instead of the next transfer.
    pub(super) fn strike(&mut self) -> Result<Option<Vec<u8>>, UsbError> {
        let mut shared = lock(&self.shared);
        if is_pulled(&mut shared, self.plug) {
            return Err(UsbError::Disconnected);
        }
        if shared.faults.stalls > 0 {
            shared.faults.stalls -= 1;
            shared.halted = true;
        }
        if shared.halted {
            return Err(UsbError::Stalled);
        }
        match &mut shared.faults.babble {
            None => Ok(None),
            Some(0) => Err(UsbError::Fault),
            Some(left) => {
                *left -= 1;
                drop(shared);
                Ok(Some((0..2000).map(|_| self.next_random() as u8).collect()))
            }
        }
    }

    pub(super) fn control_in(
        &mut self,
        request: VendorRequest,
        answer: &mut [u8],
    ) -> Result<usize, UsbError> {
        self.request(|Shared { device, faults, .. }| {
            if faults.garbled_answers {
                answer.fill(0xA5);
                return Ok(answer.len().min(3));
            }
            device.control_in(request, answer, faults)
        })
    }

    pub(super) fn control_out(&mut self, request: VendorRequest, data: &[u8]) -> Result<(), UsbError> {
        self.request(|shared| shared.device.control_out(request, data))
    }

    /// A message on a control endpoint.
    pub(super) fn bulk_out(&mut self, endpoint: u8, data: &[u8]) -> Result<(), UsbError> {
        self.request(|Shared { device, faults, .. }| device.bulk_out(endpoint, data, faults))
    }

    /// The oldest answer that waits at `endpoint`.
    pub(super) fn answer(&mut self, endpoint: u8) -> Result<Option<Vec<u8>>, UsbError> {
        self.request(|Shared { device, faults, .. }| {
            let mut answer = device.answer(endpoint);
            if let (Some(answer), true) = (&mut answer, faults.garbled_answers) {
                answer.fill(0xA5);
            }
            Ok(answer)
        })
    }

    pub(super) fn is_halted(&self, endpoint: u8) -> bool {
        self.peek(|shared| shared.halted && endpoint == shared.device.data_endpoint())
    }

    /// Only the data endpoint can be halted.
    pub(super) fn set_halt(&mut self, endpoint: u8, halt: bool) -> Result<(), UsbError> {
        self.request(|shared| {
            if endpoint == shared.device.data_endpoint() {
                shared.halted = halt;
            }
            Ok(())
        })
    }

    /// Lets the rig go on for `wait` at most; what it brings is put into transfers of at most `bytes`.
    pub(super) fn step(&mut self, wait: Duration, bytes: usize) -> Result<Step, UsbError> {
        let mut shared = lock(&self.shared);
        if is_pulled(&mut shared, self.plug) {
            return Err(UsbError::Disconnected);
        }
        if !shared.device.is_running() {
            return Ok(Step::Stopped);
        }
        let Shared { device, camera, background, sent, faults, .. } = &mut *shared;
        camera.read(&mut self.batch, wait).map_err(|error| bus_error(&error))?;
        if self.batch.events.is_empty() && self.batch.reached == self.reached {
            return Ok(Step::Early);
        }
        self.reached = self.batch.reached;
        if let Some(background) = background {
            background.add(&mut self.batch);
        }
        if let (Some(duration), Some(reached)) = (faults.overflow.take(), self.batch.reached) {
            self.overflow_until = Some(reached + duration);
        }
        match self.overflow_until {
            Some(until) if self.batch.reached < Some(until) => device.overflow(&self.batch),
            Some(_) | None => {
                self.overflow_until = None;
                sent.0 += self.batch.events.len() as u64;
                device.send(&self.batch);
            }
        }
        while let Some(packet) = device.packet() {
            self.sent += 1;
            sent.1 += packet.len() as u64;
            if faults.lose_one_of.is_some_and(|of| self.sent.is_multiple_of(of)) {
                continue;
            }
            let words = faults.short_packets.unwrap_or(usize::MAX / 2).max(1);
            for piece in packet.chunks(bytes.min(words * 2)) {
                let whole = piece.len() - usize::from(faults.odd_transfers);
                let piece = piece.get(..whole).unwrap_or_default();
                self.ready.push_back((self.batch.arrival, piece.to_vec()));
            }
        }
        Ok(Step::Advanced)
    }
}

/// Whether the cable that was in when `plug` was counted has been pulled.
fn is_pulled(shared: &mut Shared, plug: u32) -> bool {
    !shared.is_plugged || shared.plug != plug || shared.camera.is_unplugged()
}
