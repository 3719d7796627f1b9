//! `evfocus-lens`: turns orders into calls of the lens, and asks it where it is. Serial lenses block; here that delays nobody.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::thread::Thread;
use std::time::Duration;

use evfocus_core::LensSample;
use evfocus_core::controller::Action;
use evfocus_hal::{Clock, DeviceError, Lens};
use rtrb::Producer;

use super::Notice;
use crate::devices;

/// Orders in flight; the controller gives two at a time and waits for their effect.
pub(crate) const ORDERS: usize = 16;
/// Samples in flight: half a second at 1 kHz.
pub(crate) const SAMPLES: usize = 512;
/// A lens at rest is asked this seldom.
const REST_POLL: Duration = Duration::from_millis(50);
/// How long a lens is asked often after the last order or motion.
const ATTENTION: Duration = Duration::from_millis(500);
/// How often a lens that failed is tried again.
const RETRY: Duration = Duration::from_secs(1);

/// The thread's ends of its queues.
pub(crate) struct LensThread {
    /// The lens.
    pub(crate) lens: Box<dyn Lens>,
    /// Host time.
    pub(crate) clock: Arc<dyn Clock>,
    /// How often a moving lens is asked where it is.
    pub(crate) poll: Duration,
    /// Orders come here; their end is the end of the thread.
    pub(crate) orders: Receiver<Action>,
    /// Answers leave here.
    pub(crate) samples: Producer<LensSample>,
    /// Health leaves here.
    pub(crate) notices: Producer<Notice>,
    /// Who is woken when something leaves.
    pub(crate) control: Thread,
}

impl std::fmt::Debug for LensThread {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LensThread").field("lens", &self.lens.info()).finish_non_exhaustive()
    }
}

impl LensThread {
    /// Runs until there can be no more orders, then stops the lens.
    pub(crate) fn run(mut self) {
        let mut failed = false;
        let mut next_poll = self.clock.now();
        let mut attentive_until = next_poll;
        loop {
            match self.orders.recv_timeout(next_poll.since(self.clock.now())) {
                Ok(order) => {
                    attentive_until = self.clock.now() + ATTENTION;
                    next_poll = self.clock.now();
                    if !failed && let Err(error) = devices::perform(order, self.lens.as_mut()) {
                        self.fail(&error);
                        failed = true;
                    }
                }
                Err(RecvTimeoutError::Timeout) => match self.lens.sample() {
                    Ok(sample) => {
                        if failed {
                            failed = false;
                            tracing::info!("the lens answers again");
                            self.notify(Notice::LensReady);
                        }
                        if sample.moving {
                            attentive_until = sample.replied + ATTENTION;
                        }
                        let now = self.clock.now();
                        next_poll =
                            now + if now < attentive_until { self.poll } else { REST_POLL.max(self.poll) };
                        // The control thread looks hundreds of times a second; if it does not, it has worse to report.
                        if self.samples.push(sample).is_err() {
                            tracing::error!("the control thread does not take lens samples");
                        }
                        self.control.unpark();
                    }
                    Err(error) => {
                        if !failed {
                            self.fail(&error);
                        }
                        failed = true;
                        next_poll = self.clock.now() + RETRY;
                    }
                },
                Err(RecvTimeoutError::Disconnected) => break,
            }
        }
        match self.lens.stop() {
            Ok(()) => tracing::info!("the lens is stopped"),
            Err(error) => tracing::warn!(%error, "the lens could not be stopped"),
        }
    }

    fn fail(&mut self, error: &DeviceError) {
        tracing::error!(%error, "the lens failed");
        self.notify(Notice::LensFailed(devices::failure(error)));
    }

    fn notify(&mut self, notice: Notice) {
        if self.notices.push(notice).is_err() {
            tracing::error!(?notice, "the control thread does not take notices");
        }
        self.control.unpark();
    }
}
