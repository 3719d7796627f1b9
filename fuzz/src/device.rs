//! A USB device whose answers are arbitrary bytes, among sound ones.

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::{EventBatch, HostMicros};
use evfocus_hal::usb::{StreamQueue, UsbError, UsbIdentity, UsbTransport, VendorRequest};
use evfocus_hal::{Camera, Clock, VirtualClock};

/// The device. The data decide: a byte for each request says whether its answer is sound, arbitrary, or an error.
pub struct Anything<'data, Sound> {
    identity: UsbIdentity,
    data: &'data [u8],
    clock: Arc<VirtualClock>,
    /// A sound answer to a vendor request.
    sound: Sound,
    /// The message that was sent last, for a sound answer.
    message: Vec<u8>,
    received: &'data [u8],
}

impl<'data, Sound: Fn(VendorRequest, &mut [u8]) + Send> Anything<'data, Sound> {
    pub fn new(
        data: &'data [u8],
        (vendor, product): (u16, u16),
        clock: Arc<VirtualClock>,
        sound: Sound,
    ) -> Self {
        let identity = UsbIdentity { vendor, product, version: 6, serial: String::new(), speed: None };
        Self { identity, data, clock, sound, message: Vec::new(), received: &[] }
    }

    fn take(&mut self, count: usize) -> &'data [u8] {
        let (taken, rest) = self.data.split_at(count.min(self.data.len()));
        self.data = rest;
        taken
    }

    /// What becomes of the next request: `Ok(true)` for a sound answer.
    fn fate(&mut self) -> Result<bool, UsbError> {
        match self.take(1) {
            [] | [0..=239] => Ok(true),
            [240] => Err(UsbError::Disconnected),
            [241] => Err(UsbError::Stalled),
            [242] => Err(UsbError::TimedOut),
            [243] => Err(UsbError::Fault),
            [244] => Err(UsbError::OutOfMemory),
            _ => Ok(false),
        }
    }

    fn arbitrary(&mut self, answer: &mut [u8]) -> usize {
        let count = usize::from(self.take(1).first().copied().unwrap_or(0)).min(answer.len());
        let bytes = self.take(count);
        for (slot, byte) in answer.iter_mut().zip(bytes) {
            *slot = *byte;
        }
        bytes.len()
    }

    /// The answer that a sound board gives to the message sent last.
    fn sound_answer(&self, answer: &mut [u8]) -> usize {
        let word = |index: usize| {
            let bytes = self.message.get(index * 4..index * 4 + 4);
            bytes.and_then(|bytes| bytes.try_into().ok()).map_or(0, u32::from_le_bytes)
        };
        let payload: Vec<u8> = match word(0) {
            0x1_0102 => {
                let value: u32 = if word(3) == 0x14 { 0xA040_1806 } else { 0 };
                [word(2), word(3), value].iter().flat_map(|word| word.to_le_bytes()).collect()
            }
            0x4001_0102 => [word(2), word(3)].iter().flat_map(|word| word.to_le_bytes()).collect(),
            0x1_0003 => b"\0\0\0\0psee,ccam5_imx636\0".to_vec(),
            _ => 0x3_0900_u32.to_le_bytes().to_vec(),
        };
        let message =
            [&word(0).to_le_bytes(), &(payload.len() as u32).to_le_bytes(), payload.as_slice()].concat();
        for (slot, byte) in answer.iter_mut().zip(&message) {
            *slot = *byte;
        }
        message.len().min(answer.len())
    }
}

impl<Sound: Fn(VendorRequest, &mut [u8]) + Send> UsbTransport for Anything<'_, Sound> {
    fn identity(&self) -> &UsbIdentity {
        &self.identity
    }

    fn control_in(&mut self, request: VendorRequest, answer: &mut [u8]) -> Result<usize, UsbError> {
        if self.fate()? {
            (self.sound)(request, answer);
            return Ok(answer.len());
        }
        Ok(self.arbitrary(answer))
    }

    fn control_out(&mut self, _: VendorRequest, _: &[u8]) -> Result<(), UsbError> {
        self.fate().map(|_| ())
    }

    fn bulk_out(&mut self, _: u8, data: &[u8]) -> Result<(), UsbError> {
        self.message = data.to_vec();
        self.fate().map(|_| ())
    }

    fn bulk_in(&mut self, endpoint: u8, data: &mut [u8], timeout: Duration) -> Result<usize, UsbError> {
        let is_data = endpoint == 0x81;
        match self.fate()? {
            true if is_data => {
                self.clock.sleep_until(self.clock.now() + timeout);
                Err(UsbError::TimedOut)
            }
            true => Ok(self.sound_answer(data)),
            false => {
                self.clock.sleep_until(self.clock.now() + Duration::from_millis(1));
                Ok(self.arbitrary(data))
            }
        }
    }

    fn clear_halt(&mut self, _: u8) -> Result<(), UsbError> {
        self.fate().map(|_| ())
    }

    fn start_stream(&mut self, _: u8, _: StreamQueue) -> Result<(), UsbError> {
        self.fate().map(|_| ())
    }

    fn receive(&mut self, timeout: Duration) -> Result<Option<HostMicros>, UsbError> {
        self.received = &[];
        self.clock.sleep_until(self.clock.now() + timeout.min(Duration::from_millis(1)));
        self.fate()?;
        let count = usize::from(self.take(1).first().copied().unwrap_or(0)) * 3;
        self.received = self.take(count);
        Ok((count > 0).then(|| self.clock.now()))
    }

    fn received(&self) -> &[u8] {
        self.received
    }

    fn stop_stream(&mut self) -> Result<(), UsbError> {
        self.received = &[];
        self.fate().map(|_| ())
    }
}

/// Starts, reads with batches of several sizes, stops.
pub fn use_it(mut camera: impl Camera) {
    let geometry = camera.info().geometry;
    for capacity in [5, 100, 5000] {
        if camera.start().is_err() {
            continue;
        }
        let mut batch = EventBatch::with_capacity(capacity);
        let room = batch.events.capacity();
        let mut last = i64::MIN;
        for _ in 0..50 {
            if camera.read(&mut batch, Duration::from_millis(2)).is_err() {
                break;
            }
            assert_eq!(batch.events.capacity(), room, "the batch grew");
            for event in batch.events.iter() {
                assert!(event.t.0 >= last, "time went back");
                assert!(geometry.contains(event.x, event.y));
                last = event.t.0;
            }
        }
        let _stopped = camera.stop();
    }
}
