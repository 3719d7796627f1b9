//! The driver's transfers as nusb's.

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::HostMicros;
use evfocus_hal::Clock;
use evfocus_hal::usb::{StreamQueue, UsbError, UsbIdentity, UsbTransport, VendorRequest};
use nusb::MaybeFuture;
use nusb::transfer::{
    Buffer, Bulk, Completion, ControlIn, ControlOut, ControlType, In, Out, Recipient, TransferError,
};
use nusb::{Endpoint, Interface};

/// How long a request may take that states no time of its own.
const REQUEST_TIME: Duration = Duration::from_secs(1);
/// How long cancelled transfers may take to come back.
const CANCEL_TIME: Duration = Duration::from_secs(1);
/// Linux's number for "no memory".
const ENOMEM: u32 = 12;

/// A claimed interface of a device of this machine.
pub struct NusbTransport {
    identity: UsbIdentity,
    clock: Arc<dyn Clock>,
    /// Endpoints in use, opened when first needed.
    inputs: Vec<Endpoint<Bulk, In>>,
    outputs: Vec<Endpoint<Bulk, Out>>,
    stream: Option<Stream>,
    interface: Interface,
}

struct Stream {
    endpoint: Endpoint<Bulk, In>,
    /// The transfer received last.
    received: Option<Buffer>,
}

impl std::fmt::Debug for NusbTransport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("NusbTransport").field("identity", &self.identity).finish_non_exhaustive()
    }
}

fn usb_error(error: TransferError) -> UsbError {
    match error {
        TransferError::Cancelled => UsbError::TimedOut,
        TransferError::Stall => UsbError::Stalled,
        TransferError::Disconnected => UsbError::Disconnected,
        TransferError::Fault | TransferError::InvalidArgument => UsbError::Fault,
        TransferError::Unknown(ENOMEM) => UsbError::OutOfMemory,
        TransferError::Unknown(number) => UsbError::System(number),
    }
}

fn system_error(error: &nusb::Error) -> UsbError {
    if error.kind() == nusb::ErrorKind::Disconnected {
        return UsbError::Disconnected;
    }
    match error.os_error() {
        Some(ENOMEM) => UsbError::OutOfMemory,
        number => UsbError::System(number.unwrap_or_default()),
    }
}

/// What came with a completed transfer.
fn completed(completion: Completion) -> Result<Buffer, UsbError> {
    completion.into_result().map_err(usb_error)
}

impl NusbTransport {
    pub(super) fn new(interface: Interface, identity: UsbIdentity, clock: Arc<dyn Clock>) -> Self {
        Self { identity, clock, inputs: Vec::new(), outputs: Vec::new(), stream: None, interface }
    }

    fn open_input(&self, address: u8) -> Result<Endpoint<Bulk, In>, UsbError> {
        self.interface.endpoint(address).map_err(|error| system_error(&error))
    }

    /// Takes the endpoint out of those in use, or opens it; who does not start a stream on it puts it back.
    fn take_input(&mut self, address: u8) -> Result<Endpoint<Bulk, In>, UsbError> {
        match self.inputs.iter().position(|endpoint| endpoint.endpoint_address() == address) {
            Some(index) => Ok(self.inputs.swap_remove(index)),
            None => self.open_input(address),
        }
    }
}

impl UsbTransport for NusbTransport {
    fn identity(&self) -> &UsbIdentity {
        &self.identity
    }

    fn control_in(&mut self, request: VendorRequest, answer: &mut [u8]) -> Result<usize, UsbError> {
        let VendorRequest { request, value, index } = request;
        let length = u16::try_from(answer.len()).unwrap_or(u16::MAX);
        let (control_type, recipient) = (ControlType::Vendor, Recipient::Device);
        let request = ControlIn { control_type, recipient, request, value, index, length };
        let data = self.interface.control_in(request, REQUEST_TIME).wait().map_err(usb_error)?;
        for (slot, byte) in answer.iter_mut().zip(&data) {
            *slot = *byte;
        }
        Ok(data.len().min(answer.len()))
    }

    fn control_out(&mut self, request: VendorRequest, data: &[u8]) -> Result<(), UsbError> {
        let VendorRequest { request, value, index } = request;
        let (control_type, recipient) = (ControlType::Vendor, Recipient::Device);
        let request = ControlOut { control_type, recipient, request, value, index, data };
        self.interface.control_out(request, REQUEST_TIME).wait().map_err(usb_error)
    }

    fn bulk_out(&mut self, address: u8, data: &[u8]) -> Result<(), UsbError> {
        let open = self.outputs.iter().position(|endpoint| endpoint.endpoint_address() == address);
        let mut endpoint = match open {
            Some(index) => self.outputs.swap_remove(index),
            None => self.interface.endpoint(address).map_err(|error| system_error(&error))?,
        };
        let sent = completed(endpoint.transfer_blocking(data.to_vec().into(), REQUEST_TIME));
        self.outputs.push(endpoint);
        sent.map(|_| ())
    }

    fn bulk_in(&mut self, address: u8, data: &mut [u8], timeout: Duration) -> Result<usize, UsbError> {
        let mut endpoint = self.take_input(address)?;
        // A transfer asks for whole packets.
        let packet = endpoint.max_packet_size().max(1);
        let buffer = Buffer::new(data.len().div_ceil(packet).max(1) * packet);
        let got = completed(endpoint.transfer_blocking(buffer, timeout));
        self.inputs.push(endpoint);
        let buffer = got?;
        for (slot, byte) in data.iter_mut().zip(buffer.iter()) {
            *slot = *byte;
        }
        Ok(buffer.len().min(data.len()))
    }

    fn clear_halt(&mut self, address: u8) -> Result<(), UsbError> {
        let mut endpoint = self.take_input(address)?;
        let cleared = endpoint.clear_halt().wait();
        self.inputs.push(endpoint);
        cleared.map_err(|error| system_error(&error))
    }

    fn start_stream(&mut self, address: u8, queue: StreamQueue) -> Result<(), UsbError> {
        self.stop_stream()?;
        let mut endpoint = self.take_input(address)?;
        for _ in 0..queue.transfers {
            let buffer = endpoint.allocate(queue.bytes);
            endpoint.submit(buffer);
        }
        self.stream = Some(Stream { endpoint, received: None });
        Ok(())
    }

    fn receive(&mut self, timeout: Duration) -> Result<Option<HostMicros>, UsbError> {
        let Some(Stream { endpoint, received }) = &mut self.stream else { return Err(UsbError::Fault) };
        if let Some(buffer) = received.take() {
            endpoint.submit(buffer);
        }
        if endpoint.pending() == 0 {
            return Err(UsbError::Fault);
        }
        let Some(completion) = endpoint.wait_next_complete(timeout) else { return Ok(None) };
        let arrival = self.clock.now();
        *received = Some(completed(completion)?);
        Ok(Some(arrival))
    }

    fn received(&self) -> &[u8] {
        self.stream.as_ref().and_then(|stream| stream.received.as_deref()).unwrap_or_default()
    }

    fn stop_stream(&mut self) -> Result<(), UsbError> {
        let Some(Stream { mut endpoint, .. }) = self.stream.take() else { return Ok(()) };
        endpoint.cancel_all();
        while endpoint.pending() > 0 {
            if endpoint.wait_next_complete(CANCEL_TIME).is_none() {
                return Err(UsbError::TimedOut);
            }
        }
        self.inputs.push(endpoint);
        Ok(())
    }
}
