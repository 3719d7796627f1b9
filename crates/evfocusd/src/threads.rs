//! The three threads between the devices and the controller.
//!
//! | thread | waits on | queue in | queue out | stopped by |
//! | --- | --- | --- | --- | --- |
//! | `evfocus-camera` | the camera, at most 10 ms | empty batches | filled batches | the stop flag |
//! | `evfocus-control` | being woken, at most 2 ms, 6 between runs | batches, samples, notices, commands | orders, snapshots, curve points, reports | the stop flag |
//! | `evfocus-lens` | orders, until the next poll is due | orders | samples, notices | the end of the orders' queue |
//!
//! Every queue is bounded; orders are a slot in which the latest motion counts. The lens is stopped when its orders end, whatever ended them: a clean stop, an error, a panic.

pub(crate) mod camera;
pub(crate) mod control;
pub(crate) mod latency;
pub(crate) mod lens;
pub(crate) mod orders;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use evfocus_core::controller::DeviceFailure;

/// Tells the threads to stop.
#[derive(Debug, Clone, Default)]
pub(crate) struct StopFlag(Arc<AtomicBool>);

impl StopFlag {
    /// Tells them.
    pub(crate) fn stop(&self) {
        self.0.store(true, Ordering::SeqCst);
    }

    /// Whether they have been told.
    pub(crate) fn is_stopped(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }
}

/// News of a device's health, from its thread to the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Notice {
    /// The camera failed.
    CameraFailed(DeviceFailure),
    /// The camera streams again.
    CameraReady,
    /// The lens failed.
    LensFailed(DeviceFailure),
    /// The lens answers again.
    LensReady,
}

/// Room for notices: devices change their health a few times a minute at the worst.
pub(crate) const NOTICES: usize = 64;
