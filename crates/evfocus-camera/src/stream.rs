//! From queued transfers to batches: what both drivers do between `start` and `stop`.

use std::time::Duration;

use evfocus_core::decode::{DavisWordDecoder, Evt3Decoder};
use evfocus_core::{EventBatch, HostMicros};
use evfocus_hal::usb::{StreamQueue, UsbError, UsbTransport};
use evfocus_hal::{Clock, DeviceError, DeviceErrorKind};

use crate::error::transfer_error;

/// Stalls in a row, without data in between, after which the stream is given up.
const MOST_STALLS: u32 = 3;

/// A decoder of words of two bytes.
pub(crate) trait Decode {
    /// The most events that a word can hold.
    const MAX_EVENTS_PER_WORD: usize;

    /// Appends the events in `bytes` to the batch.
    fn decode(&mut self, bytes: &[u8], batch: &mut EventBatch);

    /// A transfer has ended. Cameras send whole words, so half of one is damage, and must not shift what follows.
    fn end_transfer(&mut self);
}

impl Decode for DavisWordDecoder {
    const MAX_EVENTS_PER_WORD: usize = DavisWordDecoder::MAX_EVENTS_PER_WORD;

    fn decode(&mut self, bytes: &[u8], batch: &mut EventBatch) {
        DavisWordDecoder::decode(self, bytes, batch);
    }

    fn end_transfer(&mut self) {
        self.finish();
    }
}

impl Decode for Evt3Decoder {
    const MAX_EVENTS_PER_WORD: usize = Evt3Decoder::MAX_EVENTS_PER_BYTE * 2;

    fn decode(&mut self, bytes: &[u8], batch: &mut EventBatch) {
        Evt3Decoder::decode(self, bytes, batch);
    }

    fn end_transfer(&mut self) {
        self.finish();
    }
}

/// Whether a camera streams.
///
/// ```text
/// Stopped --start--> Running --stop, a failed read--> Stopped
///                       \------the device is gone---> Gone
/// ```
#[derive(Debug)]
pub(crate) enum Streaming<D> {
    Stopped,
    Running(Stream<D>),
    /// Only a newly opened handle will do.
    Gone,
}

impl<D: Decode> Streaming<D> {
    /// Whether there is anything to start.
    pub(crate) fn is_to_start(&self, device: &str) -> Result<bool, DeviceError> {
        match self {
            Self::Stopped => Ok(true),
            Self::Running(_) => Ok(false),
            Self::Gone => Err(transfer_error(UsbError::Disconnected, device, "starting")),
        }
    }

    /// Whether there is anything to stop; afterwards there is not.
    pub(crate) fn take_to_stop(&mut self, device: &str) -> Result<bool, DeviceError> {
        match self {
            Self::Stopped => Ok(false),
            Self::Running(_) => {
                *self = Self::Stopped;
                Ok(true)
            }
            Self::Gone => Err(transfer_error(UsbError::Disconnected, device, "stopping")),
        }
    }

    /// The decoder of the stream under way.
    pub(crate) fn decoder(&self) -> Option<&D> {
        match self {
            Self::Running(stream) => Some(&stream.decoder),
            Self::Stopped | Self::Gone => None,
        }
    }

    /// As [`Camera::read`](evfocus_hal::Camera::read). A stream that failed has to be started again.
    pub(crate) fn read(
        &mut self,
        transport: &mut impl UsbTransport,
        clock: &dyn Clock,
        device: &str,
        batch: &mut EventBatch,
        timeout: Duration,
    ) -> Result<(), DeviceError> {
        batch.clear();
        let what = "reading the stream";
        match self {
            Self::Stopped => {
                let what = "read before start; start the camera first";
                Err(DeviceError::new(DeviceErrorKind::NotStarted, device, what))
            }
            Self::Gone => Err(transfer_error(UsbError::Disconnected, device, what)),
            Self::Running(stream) => stream.read(transport, clock, batch, timeout).map_err(|error| {
                // What was queued is of no use any more; that it cannot be taken back changes nothing.
                transport.stop_stream().unwrap_or_default();
                let error = transfer_error(error, device, what);
                let is_gone = error.kind == DeviceErrorKind::Disconnected;
                *self = if is_gone { Self::Gone } else { Self::Stopped };
                error
            }),
        }
    }
}

/// A stream under way. Transfers are decoded where the system put them; a batch that is full leaves the rest of its transfer for
/// the next.
#[derive(Debug)]
pub(crate) struct Stream<D> {
    endpoint: u8,
    queue: StreamQueue,
    decoder: D,
    /// Bytes of the received transfer that have been decoded.
    taken: usize,
    /// When the received transfer arrived.
    arrival: HostMicros,
    /// Events of a word that held more than a whole batch.
    spill: EventBatch,
    stalls: u32,
}

impl<D: Decode> Stream<D> {
    /// Clears the endpoint's halt and queues its transfers.
    pub(crate) fn start(
        transport: &mut impl UsbTransport,
        clock: &dyn Clock,
        endpoint: u8,
        queue: StreamQueue,
        decoder: D,
    ) -> Result<Self, UsbError> {
        transport.clear_halt(endpoint)?;
        transport.start_stream(endpoint, queue)?;
        Ok(Self {
            endpoint,
            queue,
            decoder,
            taken: 0,
            arrival: clock.now(),
            spill: EventBatch::with_capacity(D::MAX_EVENTS_PER_WORD),
            stalls: 0,
        })
    }

    fn read(
        &mut self,
        transport: &mut impl UsbTransport,
        clock: &dyn Clock,
        batch: &mut EventBatch,
        timeout: Duration,
    ) -> Result<(), UsbError> {
        let deadline = clock.now() + timeout;
        loop {
            self.fill(transport.received(), batch);
            batch.arrival = self.arrival;
            let now = clock.now();
            if !batch.events.is_empty() {
                return Ok(());
            }
            match transport.receive(deadline.since(now)) {
                Ok(Some(arrival)) => {
                    self.decoder.end_transfer();
                    self.arrival = arrival;
                    self.taken = 0;
                    self.stalls = 0;
                }
                Ok(None) => return Ok(()),
                Err(UsbError::Stalled) if self.stalls < MOST_STALLS => self.recover(transport)?,
                Err(error) => return Err(error),
            }
            // A device that sends without end, but no events, must not keep the reader.
            if now >= deadline {
                self.fill(transport.received(), batch);
                batch.arrival = self.arrival;
                return Ok(());
            }
        }
    }

    /// Decodes as much of the received transfer as the batch has room for.
    fn fill(&mut self, received: &[u8], batch: &mut EventBatch) {
        self.move_spill(batch);
        while self.spill.events.is_empty() {
            let rest = received.get(self.taken..).unwrap_or_default();
            let room = batch.events.room();
            let fits = room / D::MAX_EVENTS_PER_WORD * 2;
            if rest.is_empty() || (fits == 0 && !batch.events.is_empty()) {
                return;
            }
            let piece = rest.get(..fits.max(2)).unwrap_or(rest);
            self.taken += piece.len();
            if fits > 0 {
                self.decoder.decode(piece, batch);
            } else {
                self.spill.clear();
                self.decoder.decode(piece, &mut self.spill);
                batch.lost += self.spill.lost;
                batch.reached = self.spill.reached;
                self.move_spill(batch);
            }
        }
    }

    fn move_spill(&mut self, batch: &mut EventBatch) {
        let room = batch.events.room();
        batch.lost += batch.events.append(self.spill.events.drain_front(room));
    }

    /// Queues the transfers anew after a stall.
    fn recover(&mut self, transport: &mut impl UsbTransport) -> Result<(), UsbError> {
        self.stalls += 1;
        tracing::warn!(
            endpoint = self.endpoint,
            stalls = self.stalls,
            "the stream has stalled; starting it again"
        );
        transport.stop_stream()?;
        self.taken = 0;
        transport.clear_halt(self.endpoint)?;
        transport.start_stream(self.endpoint, self.queue)
    }
}
