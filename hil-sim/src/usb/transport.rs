//! The system's side of the emulated port: queued transfers, time-outs, cancelling.

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::HostMicros;
use evfocus_hal::Clock;
use evfocus_hal::usb::{StreamQueue, UsbError, UsbIdentity, UsbTransport, VendorRequest};

use super::link::{Link, Step};

/// How long a request may take.
const REQUEST_TIME: Duration = Duration::from_secs(1);
/// The rig is asked at least this often, so that the device's own words come when nothing happens.
const STEP: Duration = Duration::from_millis(1);

/// An opened port.
#[derive(Debug)]
pub struct EmulatedUsb {
    identity: UsbIdentity,
    clock: ClockHandle,
    link: Link,
    stream: Option<Stream>,
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
    received: Vec<u8>,
}

impl EmulatedUsb {
    pub(super) fn new(identity: UsbIdentity, clock: Arc<dyn Clock>, link: Link) -> Self {
        Self { identity, clock: ClockHandle(clock), link, stream: None }
    }

    /// Lets the time pass that requests take.
    fn wait(&mut self, timeout: Duration) -> Result<(), UsbError> {
        let delay = self.link.peek(|shared| shared.faults.control_delay);
        self.clock.0.sleep_until(self.clock.0.now() + delay.min(timeout));
        if self.link.is_pulled() {
            return Err(UsbError::Disconnected);
        }
        if delay > timeout { Err(UsbError::TimedOut) } else { Ok(()) }
    }
}

impl UsbTransport for EmulatedUsb {
    fn identity(&self) -> &UsbIdentity {
        &self.identity
    }

    fn control_in(&mut self, request: VendorRequest, answer: &mut [u8]) -> Result<usize, UsbError> {
        self.wait(REQUEST_TIME)?;
        self.link.control_in(request, answer)
    }

    fn control_out(&mut self, request: VendorRequest, data: &[u8]) -> Result<(), UsbError> {
        self.wait(REQUEST_TIME)?;
        self.link.control_out(request, data)
    }

    fn bulk_out(&mut self, endpoint: u8, data: &[u8]) -> Result<(), UsbError> {
        self.wait(REQUEST_TIME)?;
        self.link.bulk_out(endpoint, data)
    }

    fn bulk_in(&mut self, endpoint: u8, data: &mut [u8], timeout: Duration) -> Result<usize, UsbError> {
        self.wait(timeout)?;
        let Some(answer) = self.link.answer(endpoint)? else {
            self.clock.0.sleep_until(self.clock.0.now() + timeout);
            return Err(UsbError::TimedOut);
        };
        for (slot, byte) in data.iter_mut().zip(&answer) {
            *slot = *byte;
        }
        Ok(answer.len().min(data.len()))
    }

    fn clear_halt(&mut self, endpoint: u8) -> Result<(), UsbError> {
        self.wait(REQUEST_TIME)?;
        self.link.set_halt(endpoint, false)
    }

    fn start_stream(&mut self, endpoint: u8, queue: StreamQueue) -> Result<(), UsbError> {
        let (memory_ends_at, data) =
            self.link.peek(|shared| (shared.faults.no_memory_for, shared.device.data_endpoint()));
        if memory_ends_at.is_some_and(|transfers| queue.transfers >= transfers) {
            return Err(UsbError::OutOfMemory);
        }
        if endpoint != data || queue.bytes == 0 || !queue.bytes.is_multiple_of(1024) {
            return Err(UsbError::Fault);
        }
        self.stream = Some(Stream { queue, received: Vec::new() });
        Ok(())
    }

    fn receive(&mut self, timeout: Duration) -> Result<Option<HostMicros>, UsbError> {
        let Self { clock, link, stream: Some(stream), .. } = self else { return Err(UsbError::Fault) };
        let deadline = clock.0.now() + timeout;
        stream.received.clear();
        if let Some(babble) = link.strike()? {
            stream.received = babble;
            return Ok(Some(clock.0.now()));
        }
        loop {
            if let Some((arrival, transfer)) = link.ready.pop_front() {
                stream.received = transfer;
                return Ok(Some(arrival));
            }
            let now = clock.0.now();
            if link.step(STEP.min(deadline.since(now)), stream.queue.bytes)? == Step::Stopped {
                clock.0.sleep_until(deadline);
                return Ok(None);
            }
            if link.ready.is_empty() && clock.0.now() >= deadline {
                return Ok(None);
            }
        }
    }

    fn received(&self) -> &[u8] {
        self.stream.as_ref().map(|stream| stream.received.as_slice()).unwrap_or_default()
    }

    fn stop_stream(&mut self) -> Result<(), UsbError> {
        self.stream = None;
        self.link.ready.clear();
        Ok(())
    }
}
