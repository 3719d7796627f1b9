//! Once a stream runs, neither driver allocates: per transfer, per batch, or when nothing comes.
#![expect(clippy::unwrap_used, reason = "a test whose own fixture is missing fails")]

use std::sync::Arc;
use std::time::Duration;

use evfocus_camera::davis346::{self, Davis346};
use evfocus_camera::evk4::{self, Evk4};
use evfocus_core::{EventBatch, HostMicros};
use evfocus_hal::usb::{StreamQueue, UsbError, UsbIdentity, UsbTransport, VendorRequest};
use evfocus_hal::{Camera, Clock, VirtualClock};
use hil_sim::{EmulatedUsb, Rig, RigConfig, UsbModel};

#[path = "../../evfocus-core/tests/support/allocations.rs"]
mod allocations;

use allocations::allocations_in;

/// An emulated device whose stream has been written down: the emulator computes pixels, and allocates while it does.
#[derive(Debug)]
struct Written {
    device: EmulatedUsb,
    clock: Arc<VirtualClock>,
    transfers: Vec<Vec<u8>>,
    next: usize,
}

impl UsbTransport for Written {
    fn identity(&self) -> &UsbIdentity {
        self.device.identity()
    }

    fn control_in(&mut self, request: VendorRequest, answer: &mut [u8]) -> Result<usize, UsbError> {
        self.device.control_in(request, answer)
    }

    fn control_out(&mut self, request: VendorRequest, data: &[u8]) -> Result<(), UsbError> {
        self.device.control_out(request, data)
    }

    fn bulk_out(&mut self, endpoint: u8, data: &[u8]) -> Result<(), UsbError> {
        self.device.bulk_out(endpoint, data)
    }

    fn bulk_in(&mut self, endpoint: u8, data: &mut [u8], timeout: Duration) -> Result<usize, UsbError> {
        self.device.bulk_in(endpoint, data, timeout)
    }

    fn clear_halt(&mut self, endpoint: u8) -> Result<(), UsbError> {
        self.device.clear_halt(endpoint)
    }

    fn start_stream(&mut self, endpoint: u8, queue: StreamQueue) -> Result<(), UsbError> {
        self.device.start_stream(endpoint, queue)
    }

    fn receive(&mut self, timeout: Duration) -> Result<Option<HostMicros>, UsbError> {
        self.next += 1;
        let now = self.clock.now() + timeout.min(Duration::from_millis(1));
        self.clock.advance_to(now);
        // Every tenth time, nothing.
        Ok((!self.next.is_multiple_of(10)).then_some(now))
    }

    fn received(&self) -> &[u8] {
        self.transfers.get(self.next % self.transfers.len()).map(Vec::as_slice).unwrap_or_default()
    }

    fn stop_stream(&mut self) -> Result<(), UsbError> {
        self.device.stop_stream()
    }
}

fn written(model: UsbModel, transfers: Vec<Vec<u8>>) -> (Written, Arc<VirtualClock>) {
    let clock = Arc::new(VirtualClock::new());
    let rig = Rig::new(RigConfig::default(), clock.clone()).unwrap();
    let device = rig.plug(model).open().unwrap();
    (Written { device, clock: Arc::clone(&clock), transfers, next: 0 }, clock)
}

/// Reads, with room for less than a transfer and for more; no allocation in a thousand reads.
fn allocates_nothing(mut camera: impl Camera) {
    camera.start().unwrap();
    for capacity in [5, 500, 50_000] {
        let mut batch = EventBatch::with_capacity(capacity);
        let mut events = 0;
        let allocations = allocations_in(|| {
            for _ in 0..1_000 {
                camera.read(&mut batch, Duration::from_millis(2)).unwrap();
                events += batch.events.len();
            }
        });
        assert!(events > 3_000, "{events} events");
        assert_eq!(allocations, 0, "with room for {capacity} events");
    }
}

fn bytes(words: &[u16]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

#[test]
fn the_davis346_allocates_nothing() {
    let wraps_and_events =
        [&[0x7001, 0x8001, 0x1005], &[0x2003; 900][..], &[0x7002, 0x8002, 0x3007]].concat();
    let transfers = vec![bytes(&wraps_and_events), bytes(&[0x7001]), vec![0x02]];
    let (transport, clock) = written(UsbModel::Davis346, transfers);
    allocates_nothing(Davis346::open(transport, &davis346::Settings::default(), clock).unwrap());
}

#[test]
fn the_evk4_allocates_nothing() {
    let vectors = [0x8001, 0x6002, 0x0007, 0x3064, 0x4FFF, 0x4FFF, 0x50FF].repeat(300);
    let transfers = vec![bytes(&vectors), bytes(&[0x8002, 0xE014, 0xF001]), bytes(&[0x2001; 64])];
    let (transport, clock) = written(UsbModel::Evk4, transfers);
    allocates_nothing(Evk4::open(transport, &evk4::Settings::default(), clock).unwrap());
}
