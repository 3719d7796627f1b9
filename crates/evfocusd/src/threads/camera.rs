//! `evfocus-camera`: waits for the camera, hands over what came, and takes empty batches back.

use std::sync::Arc;
use std::thread::Thread;
use std::time::Duration;

use evfocus_core::{EventBatch, HostMicros};
use evfocus_hal::{Camera, Clock, DeviceError};
use rtrb::{Consumer, Producer};

use super::{Notice, StopFlag};
use crate::devices;

/// Batches in flight: 64 transfers of a millisecond each is what the control thread may fall behind without loss.
pub(crate) const BATCHES: usize = 64;
/// Events a batch holds: 1 ms at 65 million events a second.
pub(crate) const BATCH_EVENTS: usize = 65_536;
/// How long one read may wait, so that a stop is noticed.
const READ_TIMEOUT: Duration = Duration::from_millis(10);
/// How often a camera that failed is tried again.
const RETRY: Duration = Duration::from_secs(1);

/// The thread's ends of its queues.
pub(crate) struct CameraThread {
    /// The camera; its stream has not been started.
    pub(crate) camera: Box<dyn Camera>,
    /// Host time.
    pub(crate) clock: Arc<dyn Clock>,
    /// Empty batches come back here.
    pub(crate) empty: Consumer<EventBatch>,
    /// Filled batches leave here.
    pub(crate) filled: Producer<EventBatch>,
    /// Health leaves here.
    pub(crate) notices: Producer<Notice>,
    /// Who is woken when something leaves.
    pub(crate) control: Thread,
    /// When to end.
    pub(crate) stop: StopFlag,
}

impl std::fmt::Debug for CameraThread {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("CameraThread").field("camera", &self.camera.info()).finish_non_exhaustive()
    }
}

impl CameraThread {
    /// Runs until stopped.
    pub(crate) fn run(mut self) {
        // With every batch on its way, events are read into this one and counted as lost.
        let mut spare = EventBatch::with_capacity(BATCH_EVENTS);
        let mut lost = 0;
        let mut failed = false;
        if let Err(error) = self.camera.start() {
            self.fail(&error);
            failed = true;
        }
        while !self.stop.is_stopped() {
            if failed {
                self.pause(RETRY);
                if self.camera.start().is_ok() {
                    failed = false;
                    self.notify(Notice::CameraReady);
                    tracing::info!("the camera streams again");
                }
                continue;
            }
            let mut batch = self.empty.pop().ok();
            let room = batch.as_mut().unwrap_or(&mut spare);
            let outcome = self.camera.read(room, READ_TIMEOUT);
            if outcome.is_err() {
                room.clear();
            }
            room.lost += std::mem::take(&mut lost);
            match batch {
                Some(batch) => self.hand_over(batch),
                None => lost = spare.lost + spare.events.len() as u64,
            }
            if let Err(error) = outcome {
                self.fail(&error);
                failed = true;
            }
        }
        if let Err(error) = self.camera.stop() {
            tracing::warn!(%error, "the camera does not stop");
        }
    }

    /// Passes `batch` on. There is a place for every batch, so the way is never full.
    fn hand_over(&mut self, batch: EventBatch) {
        if self.filled.push(batch).is_err() {
            tracing::error!("a batch did not find its way to the control thread");
        }
        self.control.unpark();
    }

    fn fail(&mut self, error: &DeviceError) {
        tracing::error!(%error, "the camera failed");
        self.notify(Notice::CameraFailed(devices::failure(error)));
    }

    fn notify(&mut self, notice: Notice) {
        if self.notices.push(notice).is_err() {
            tracing::error!(?notice, "the control thread does not take notices");
        }
        self.control.unpark();
    }

    /// Waits for `duration` or until stopped.
    fn pause(&self, duration: Duration) {
        let end: HostMicros = self.clock.now() + duration;
        while self.clock.now() < end && !self.stop.is_stopped() {
            self.clock.sleep_until(self.clock.now() + READ_TIMEOUT);
        }
    }
}
