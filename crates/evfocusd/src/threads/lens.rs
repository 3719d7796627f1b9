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
use crate::vitals::Vitals;

/// Samples in flight: half a second at 1 kHz.
pub(crate) const SAMPLES: usize = 512;
/// A lens at rest is asked this seldom.
const REST_POLL: Duration = Duration::from_millis(50);
/// How long a lens is asked often after the last order or motion.
const ATTENTION: Duration = Duration::from_millis(500);
/// A control thread that has made no progress for this long does not know where the lens goes. Its longest step is the search at
/// the end of a large sweep, with the lens at rest.
const CONTROL_HANGS: Duration = Duration::from_secs(2);
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
    /// Whether that thread makes progress.
    pub(crate) vitals: Vitals,
}

/// The last progress of the control thread that was seen, and when.
#[derive(Debug, Clone, Copy)]
struct Progress {
    beats: u64,
    since: HostMicros,
    /// The lens has been stopped for want of it.
    stopped: bool,
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
        self.lens.listen(self.orders.bell());
        // A daemon that was killed may have left it moving.
        self.obey(Action::StopLens, &mut state);
        let mut next_poll = self.clock.now();
        let mut progress = Progress { beats: 0, since: next_poll, stopped: false };
        let mut attentive_until = next_poll;
        loop {
            match self.orders.receive(next_poll.since(self.clock.now())) {
                Received::Order(order) => {
                    attentive_until = self.clock.now() + ATTENTION;
                    self.obey(order, &mut state);
                    self.orders.done(self.clock.now());
                }
                Received::Nothing => {
                    next_poll = self.clock.now() + self.look(&mut state, &mut attentive_until);
                    self.guard(attentive_until, &mut progress, &mut state);
                }
                Received::End => break,
            }
        }
        match self.lens.stop() {
            Ok(()) => tracing::info!("the lens is stopped"),
            Err(error) => tracing::warn!(%error, "the lens could not be stopped"),
        }
    }

    /// Stops a lens that may be moving while the control thread hangs: nobody watches over it then.
    fn guard(&mut self, attentive_until: HostMicros, progress: &mut Progress, state: &mut Health) {
        let (beats, now) = (self.vitals.beats(), self.clock.now());
        if beats != progress.beats {
            *progress = Progress { beats, since: now, stopped: false };
        } else if now < attentive_until && !progress.stopped && now.since(progress.since) >= CONTROL_HANGS {
            progress.stopped = true;
            tracing::error!("the control thread hangs, so the lens is stopped");
            self.obey(Action::StopLens, state);
        }
    }

    /// A failed lens is still told to stop; motions were ordered by somebody who did not know yet. A motion that a stop cuts short is not
    /// missed.
    fn obey(&mut self, order: Action, state: &mut Health) {
        if *state == Health::Failed && order != Action::StopLens {
            return;
        }
        if let Err(error) = devices::perform(order, self.lens.as_mut())
            && !error.is_interruption()
        {
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
            // The order first, then again.
            Err(error) if error.is_interruption() => return Duration::ZERO,
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

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use evfocus_core::{LensPosition, LensRange, LensSpeed};
    use evfocus_hal::{DeviceErrorKind, LensClass, LensInfo, VirtualClock};
    use rtrb::{Consumer, RingBuffer};

    use super::super::orders::orders;
    use super::*;

    /// What the lens was told, and whether it answers.
    #[derive(Debug, Default)]
    struct Wire {
        told: Vec<&'static str>,
        silent: bool,
    }

    struct FakeLens(Arc<Mutex<Wire>>);

    impl FakeLens {
        fn tell(&self, what: &'static str) -> Result<(), DeviceError> {
            let mut wire = self.0.lock().unwrap();
            wire.told.push(what);
            if wire.silent {
                Err(DeviceError::new(DeviceErrorKind::TimedOut, "fake lens", what))
            } else {
                Ok(())
            }
        }
    }

    impl Lens for FakeLens {
        fn info(&self) -> LensInfo {
            LensInfo {
                model: "fake".to_owned(),
                class: LensClass::Positioner,
                speed_is_share: false,
                serial: "1".to_owned(),
                range: LensRange::new(LensPosition(0.0), LensPosition(1.0)).unwrap(),
                max_speed: LensSpeed::new(1.0).unwrap(),
                needs_homing: false,
            }
        }
        fn home(&mut self) -> Result<(), DeviceError> {
            self.tell("home")
        }
        fn move_to(&mut self, _: LensPosition, _: LensSpeed) -> Result<(), DeviceError> {
            self.tell("move")
        }
        fn stop(&mut self) -> Result<(), DeviceError> {
            self.tell("stop")
        }
        fn sample(&mut self) -> Result<LensSample, DeviceError> {
            self.tell("sample")?;
            let (requested, replied) = (HostMicros(0), HostMicros(0));
            Ok(LensSample { requested, replied, position: LensPosition(0.5), moving: true })
        }
    }

    struct Bench {
        thread: LensThread,
        wire: Arc<Mutex<Wire>>,
        clock: Arc<VirtualClock>,
        notices: Consumer<Notice>,
        samples: Consumer<LensSample>,
    }

    fn bench() -> Bench {
        let (wire, clock) = (Arc::new(Mutex::new(Wire::default())), Arc::new(VirtualClock::new()));
        let (samples_in, samples) = RingBuffer::new(SAMPLES);
        let (notices_in, notices) = RingBuffer::new(8);
        let thread = LensThread {
            lens: Box::new(FakeLens(Arc::clone(&wire))),
            clock: clock.clone(),
            poll: Duration::from_millis(2),
            orders: orders().1,
            samples: samples_in,
            notices: notices_in,
            control: std::thread::current(),
            vitals: Vitals::default(),
        };
        Bench { thread, wire, clock, notices, samples }
    }

    /// Any motion will do.
    const MOVE: Action = Action::Home;

    #[test]
    fn a_lens_that_fell_silent_in_a_motion_is_stopped_before_it_counts_again() {
        let mut bench = bench();
        let (mut health, mut attentive) = (Health::Sound, HostMicros(0));
        bench.thread.obey(MOVE, &mut health);
        bench.wire.lock().unwrap().silent = true;
        assert_eq!(bench.thread.look(&mut health, &mut attentive), RETRY);
        assert_eq!(
            bench.notices.pop(),
            Ok(Notice::LensFailed(evfocus_core::controller::DeviceFailure::Silent))
        );
        bench.thread.obey(Action::StopLens, &mut health);
        bench.thread.obey(MOVE, &mut health);
        bench.wire.lock().unwrap().silent = false;
        bench.thread.look(&mut health, &mut attentive);
        // The stop was tried while it was silent and again once it answered; the motion was not.
        assert_eq!(bench.wire.lock().unwrap().told, ["home", "sample", "stop", "sample", "stop"]);
        assert_eq!(bench.notices.pop(), Ok(Notice::LensReady));
        assert!(bench.notices.pop().is_err(), "one failure, one recovery");
        assert!(bench.samples.pop().is_ok());
    }

    #[test]
    fn a_lens_that_moves_while_the_control_thread_hangs_is_stopped_once() {
        let mut bench = bench();
        let (mut health, mut attentive) = (Health::Sound, HostMicros(0));
        let mut progress = Progress { beats: 0, since: HostMicros(0), stopped: false };
        let mut told = Vec::new();
        for second in 1..=9 {
            bench.clock.advance_to(HostMicros(second * 1_000_000));
            if second <= 3 || second == 7 {
                bench.thread.vitals.beat();
            }
            attentive = attentive.max(bench.clock.now() + ATTENTION);
            bench.thread.guard(attentive, &mut progress, &mut health);
            told.push(bench.wire.lock().unwrap().told.len());
        }
        // Beats at 1, 2, 3 and 7 s: two seconds after the third and the last of them the lens is stopped.
        assert_eq!(told, [0, 0, 0, 0, 1, 1, 1, 1, 2]);
    }

    #[test]
    fn the_end_of_the_orders_stops_the_lens() {
        let bench = bench();
        let wire = Arc::clone(&bench.wire);
        // The sender is gone already.
        bench.thread.run();
        assert_eq!(wire.lock().unwrap().told.last(), Some(&"stop"));
    }
}
