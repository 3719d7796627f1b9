//! The system's side of the emulated port: queued transfers, time-outs, cancelling.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use evfocus_core::{CameraMicros, EventBatch, HostMicros};
use evfocus_hal::usb::{StreamQueue, UsbError, UsbIdentity, UsbTransport, VendorRequest};
use evfocus_hal::{Camera, Clock, DeviceError, DeviceErrorKind};

use super::{Shared, lock};

/// How long a request may take.
const REQUEST_TIME: Duration = Duration::from_secs(1);
/// Events that the simulated camera hands over at a time.
const BATCH_EVENTS: usize = 65_536;
/// The rig is asked at least this often, so that the device's own words come when nothing happens.
const STEP: Duration = Duration::from_millis(1);

/// An opened port.
#[derive(Debug)]
pub struct EmulatedUsb {
    identity: UsbIdentity,
    clock: ClockHandle,
    shared: Arc<Mutex<Shared>>,
    batch: EventBatch,
    stream: Option<Stream>,
    random: u32,
}

/// A clock that can be left out of what is printed.
struct ClockHandle(Arc<dyn Clock>);

impl std::fmt::Debug for ClockHandle {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Clock at {}", self.0.now())
    }
}

/// A started stream.
#[derive(Debug)]
struct Stream {
    queue: StreamQueue,
    ready: VecDeque<(HostMicros, Vec<u8>)>,
    received: Vec<u8>,
    sent: u32,
    /// Device time until which nothing is sent.
    overflow_until: Option<CameraMicros>,
}

/// The pixels' failures, as the bus shows them.
fn bus_error(error: &DeviceError) -> UsbError {
    if error.kind == DeviceErrorKind::Disconnected { UsbError::Disconnected } else { UsbError::Fault }
}

impl EmulatedUsb {
    pub(super) fn new(identity: UsbIdentity, clock: Arc<dyn Clock>, shared: Arc<Mutex<Shared>>) -> Self {
        let batch = EventBatch::with_capacity(BATCH_EVENTS);
        Self { identity, clock: ClockHandle(clock), shared, batch, stream: None, random: 1 }
    }

    /// Does `what` with the device, after the time that requests take; then the pixels follow its registers.
    fn request<T>(
        &mut self,
        timeout: Duration,
        what: impl FnOnce(&mut Shared) -> Result<T, UsbError>,
    ) -> Result<T, UsbError> {
        let mut shared = lock(&self.shared);
        let delay = shared.faults.control_delay;
        self.clock.0.sleep_until(self.clock.0.now() + delay.min(timeout));
        if shared.camera.is_unplugged() {
            return Err(UsbError::Disconnected);
        }
        if delay > timeout {
            return Err(UsbError::TimedOut);
        }
        let was_running = shared.device.is_running();
        let done = what(&mut shared)?;
        match (was_running, shared.device.is_running()) {
            (false, true) => {
                shared.camera.start().map_err(|error| bus_error(&error))?;
                let now = shared.camera.reached().unwrap_or_default();
                shared.device.begin(now);
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
    fn strike(&mut self) -> Result<Option<Vec<u8>>, UsbError> {
        let mut shared = lock(&self.shared);
        if shared.camera.is_unplugged() {
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

    /// Lets the rig go on until `deadline` at most; what it brings is put into transfers. `false` when the time is over.
    fn step(&mut self, deadline: HostMicros) -> Result<bool, UsbError> {
        let Some(stream) = &mut self.stream else { return Err(UsbError::Fault) };
        let mut shared = lock(&self.shared);
        let now = self.clock.0.now();
        if !shared.device.is_running() {
            drop(shared);
            self.clock.0.sleep_until(deadline);
            return Ok(false);
        }
        let Shared { device, camera, faults, .. } = &mut *shared;
        camera.read(&mut self.batch, STEP.min(deadline.since(now))).map_err(|error| bus_error(&error))?;
        if let (Some(duration), Some(reached)) = (faults.overflow.take(), self.batch.reached) {
            stream.overflow_until = Some(reached + duration);
        }
        match stream.overflow_until {
            Some(until) if self.batch.reached < Some(until) => device.overflow(&self.batch),
            Some(_) | None => {
                stream.overflow_until = None;
                device.send(&self.batch);
            }
        }
        while let Some(packet) = device.packet() {
            stream.sent += 1;
            if faults.lose_one_of.is_some_and(|of| stream.sent % of == 0) {
                continue;
            }
            let words = faults.short_packets.unwrap_or(usize::MAX / 2).max(1);
            for piece in packet.chunks(stream.queue.bytes.min(words * 2)) {
                let whole = piece.len() - usize::from(faults.odd_transfers);
                let piece = piece.get(..whole).unwrap_or_default();
                stream.ready.push_back((self.batch.arrival, piece.to_vec()));
            }
        }
        Ok(!stream.ready.is_empty() || self.clock.0.now() < deadline)
    }
}

impl UsbTransport for EmulatedUsb {
    fn identity(&self) -> &UsbIdentity {
        &self.identity
    }

    fn control_in(&mut self, request: VendorRequest, answer: &mut [u8]) -> Result<usize, UsbError> {
        self.request(REQUEST_TIME, |Shared { device, faults, .. }| {
            if faults.garbled_answers {
                answer.fill(0xA5);
                return Ok(answer.len().min(3));
            }
            device.control_in(request, answer, faults)
        })
    }

    fn control_out(&mut self, request: VendorRequest, data: &[u8]) -> Result<(), UsbError> {
        self.request(REQUEST_TIME, |shared| shared.device.control_out(request, data))
    }

    fn bulk_out(&mut self, endpoint: u8, data: &[u8]) -> Result<(), UsbError> {
        self.request(REQUEST_TIME, |Shared { device, faults, .. }| device.bulk_out(endpoint, data, faults))
    }

    fn bulk_in(&mut self, endpoint: u8, data: &mut [u8], timeout: Duration) -> Result<usize, UsbError> {
        let clock = Arc::clone(&self.clock.0);
        self.request(timeout, |Shared { device, faults, .. }| {
            let Some(mut answer) = device.answer(endpoint) else {
                clock.sleep_until(clock.now() + timeout);
                return Err(UsbError::TimedOut);
            };
            if faults.garbled_answers {
                answer.fill(0xA5);
            }
            for (slot, byte) in data.iter_mut().zip(&answer) {
                *slot = *byte;
            }
            Ok(answer.len().min(data.len()))
        })
    }

    fn clear_halt(&mut self, endpoint: u8) -> Result<(), UsbError> {
        self.request(REQUEST_TIME, |shared| {
            shared.halted &= endpoint != shared.device.data_endpoint();
            Ok(())
        })
    }

    fn start_stream(&mut self, endpoint: u8, queue: StreamQueue) -> Result<(), UsbError> {
        let shared = lock(&self.shared);
        if shared.faults.no_memory_for.is_some_and(|transfers| queue.transfers >= transfers) {
            return Err(UsbError::OutOfMemory);
        }
        if endpoint != shared.device.data_endpoint() || queue.bytes == 0 || !queue.bytes.is_multiple_of(1024)
        {
            return Err(UsbError::Fault);
        }
        self.stream = Some(Stream {
            queue,
            ready: VecDeque::new(),
            received: Vec::new(),
            sent: 0,
            overflow_until: None,
        });
        Ok(())
    }

    fn receive(&mut self, timeout: Duration) -> Result<Option<HostMicros>, UsbError> {
        let deadline = self.clock.0.now() + timeout;
        if let Some(stream) = &mut self.stream {
            stream.received.clear();
        }
        if let Some(babble) = self.strike()? {
            let now = self.clock.0.now();
            return Ok(self.stream.as_mut().map(|stream| {
                stream.received = babble;
                now
            }));
        }
        loop {
            let Some(stream) = &mut self.stream else { return Err(UsbError::Fault) };
            if let Some((arrival, transfer)) = stream.ready.pop_front() {
                stream.received = transfer;
                return Ok(Some(arrival));
            }
            if !self.step(deadline)? {
                return Ok(None);
            }
        }
    }

    fn received(&self) -> &[u8] {
        self.stream.as_ref().map(|stream| stream.received.as_slice()).unwrap_or_default()
    }

    fn stop_stream(&mut self) -> Result<(), UsbError> {
        self.stream = None;
        Ok(())
    }
}
