//! What a device is to the port it is plugged into.

use std::fmt;

use evfocus_core::{CameraMicros, EventBatch};
use evfocus_hal::usb::{UsbError, UsbIdentity, VendorRequest};

use super::davis346::Davis346;
use super::descriptors::Description;
use super::evk4::Evk4;
use super::tally::Tally;
use super::{UsbFaults, UsbModel};

/// An emulated device. Times are those of the simulated camera's clock.
pub(super) trait Device: fmt::Debug + Send {
    fn identity(&self, faults: &UsbFaults) -> UsbIdentity;
    fn description(&self) -> &'static Description;
    fn control_in(
        &mut self,
        request: VendorRequest,
        answer: &mut [u8],
        faults: &UsbFaults,
    ) -> Result<usize, UsbError>;
    fn control_out(&mut self, request: VendorRequest, data: &[u8]) -> Result<(), UsbError>;
    /// A message on a control endpoint; its answer waits for [`answer`](Self::answer).
    fn bulk_out(&mut self, endpoint: u8, data: &[u8], faults: &UsbFaults) -> Result<(), UsbError>;
    /// The oldest answer that waits at `endpoint`.
    fn answer(&mut self, endpoint: u8) -> Option<Vec<u8>>;
    fn data_endpoint(&self) -> u8;
    /// Whether the registers let time pass and the link send.
    fn is_running(&self) -> bool;
    /// The stream begins; the camera's clock shows `now`.
    fn begin(&mut self, now: CameraMicros);
    /// The words for `batch`, appended to those that wait.
    fn send(&mut self, batch: &EventBatch);
    /// The next packet that is ready, if any.
    fn packet(&mut self) -> Option<Vec<u8>>;
    /// What `batch` holds cannot be sent.
    fn overflow(&mut self, batch: &EventBatch);
    /// What the stream has carried, at 2, 4, 8 and so on events.
    fn tallies(&self) -> &[Tally];
    fn register(&self, module: u8, address: u32) -> u32;
}

/// A device that has just got its power.
pub(super) fn power_up(model: UsbModel, seed: u64) -> Box<dyn Device> {
    match model {
        UsbModel::Davis346 => Box::new(Davis346::new(seed)),
        UsbModel::Evk4 => Box::new(Evk4::new(seed)),
    }
}
