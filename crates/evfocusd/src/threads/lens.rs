//! `evfocus-lens`: turns orders into calls of the lens, and asks it where it is. Serial lenses block; here that delays nobody.

use std::sync::Arc;
use std::thread::Thread;
use std::time::Duration;

use evfocus_core::controller::Action;
use evfocus_core::{HostMicros, LensSample};
use evfocus_hal::{Clock, DeviceError, Lens};
use rtrb::Producer;

use super::Notice;
use super::orders::{OrderReceiver, Received};
use crate::devices;

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
    pub(crate) orders: OrderReceiver,
    /// Answers leave here.
    pub(crate) samples: Producer<LensSample>,
    /// Health leaves here.
    pub(crate) notices: Producer<Notice>,
    /// Who is woken when something leaves.
    pub(crate) control: Thread,
}

/// Whether the controller has been told that the lens failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Health {
    Sound,
    Failed,
}

impl std::fmt::Debug for LensThread {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LensThread").field("lens", &self.lens.info()).finish_non_exhaustive()
    }
}

impl LensThread {
    /// Runs until there can be no more orders, then stops the lens.
    pub(crate) fn run(mut self) {
        let mut state = Health::Sound;
        let mut next_poll = self.clock.now();
        let mut attentive_until = next_poll;
        loop {
            match self.orders.receive(next_poll.since(self.clock.now())) {
                Received::Order(order) => {
                    attentive_until = self.clock.now() + ATTENTION;
                    self.obey(order, &mut state);
                }
                Received::Nothing => {
                    next_poll = self.clock.now() + self.look(&mut state, &mut attentive_until);
                }
                Received::End => break,
            }
        }
        match self.lens.stop() {
            Ok(()) => tracing::info!("the lens is stopped"),
            Err(error) => tracing::warn!(%error, "the lens could not be stopped"),
        }
    }

    /// A failed lens is still told to stop; motions were ordered by somebody who did not know yet.
    fn obey(&mut self, order: Action, state: &mut Health) {
        if *state == Health::Failed && order != Action::StopLens {
            return;
        }
        if let Err(error) = devices::perform(order, self.lens.as_mut()) {
            self.fail(&error, state);
        }
    }

    /// Asks the lens where it is, and says after how long to ask again.
    fn look(&mut self, state: &mut Health, attentive_until: &mut HostMicros) -> Duration {
        let mut answer = self.lens.sample();
        if *state == Health::Failed && answer.is_ok() {
            // Whatever it was told while it did not listen, it stands still before anybody counts on it again.
            if let Err(error) = self.lens.stop() {
                answer = Err(error);
            }
        }
        let sample = match answer {
            Ok(sample) => sample,
            Err(error) => {
                self.fail(&error, state);
                return RETRY;
            }
        };
        if *state == Health::Failed {
            *state = Health::Sound;
            tracing::info!("the lens answers again");
            self.notify(Notice::LensReady);
        }
        if sample.moving {
            *attentive_until = sample.replied + ATTENTION;
        }
        // The control thread looks hundreds of times a second; if it does not, it has worse to report.
        if self.samples.push(sample).is_err() {
            tracing::error!("the control thread does not take lens samples");
        }
        self.control.unpark();
        if self.clock.now() < *attentive_until { self.poll } else { REST_POLL.max(self.poll) }
    }

    fn fail(&mut self, error: &DeviceError, state: &mut Health) {
        if *state == Health::Sound {
            *state = Health::Failed;
            tracing::error!(%error, "the lens failed");
            self.notify(Notice::LensFailed(devices::failure(error)));
        }
    }

    fn notify(&mut self, notice: Notice) {
        if self.notices.push(notice).is_err() {
            tracing::error!(?notice, "the control thread does not take notices");
        }
        self.control.unpark();
    }
}
