//! How long an order takes from the control thread's decision until the driver of the lens has it.

use std::sync::Arc;
use std::sync::mpsc::{Sender, channel};
use std::time::Duration;

use evfocus_core::controller::Action;
use evfocus_core::{HostMicros, LensPosition, LensSample, LensSpeed};
use evfocus_hal::{Clock, DeviceError, Lens, LensInfo, SystemClock};
use rtrb::RingBuffer;

use super::NOTICES;
use super::lens::{LensThread, SAMPLES};
use super::orders::orders;
use crate::vitals::Vitals;

/// An answer that takes longer than this will not come.
const LOST: Duration = Duration::from_secs(5);

/// Notes when an order arrives, and passes it on.
struct Watched {
    lens: Box<dyn Lens>,
    clock: Arc<dyn Clock>,
    arrivals: Sender<HostMicros>,
}

impl Watched {
    fn note(&self) {
        // Whoever counts may have gone.
        self.arrivals.send(self.clock.now()).unwrap_or_default();
    }
}

impl Lens for Watched {
    fn info(&self) -> LensInfo {
        self.lens.info()
    }

    fn home(&mut self) -> Result<(), DeviceError> {
        self.lens.home()
    }

    fn move_to(&mut self, target: LensPosition, speed: LensSpeed) -> Result<(), DeviceError> {
        self.note();
        self.lens.move_to(target, speed)
    }

    fn stop(&mut self) -> Result<(), DeviceError> {
        self.note();
        self.lens.stop()
    }

    fn sample(&mut self) -> Result<LensSample, DeviceError> {
        self.lens.sample()
    }
}

/// Orders the lens about `count` times, there and back and stopped in turn, through the thread that the daemon runs it on, while that
/// asks every `poll` for its position; how long each order took to the driver, in real time.
pub fn command_latency(lens: Box<dyn Lens>, poll: Duration, count: usize) -> Vec<Duration> {
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    let (arrivals, arrived) = channel();
    let info = lens.info();
    let watched = Watched { lens, clock: Arc::clone(&clock), arrivals };
    let (orders_in, orders_out) = orders();
    let (samples, mut taken) = RingBuffer::new(SAMPLES);
    let (notices, _kept) = RingBuffer::new(NOTICES);
    let thread = LensThread {
        lens: Box::new(watched),
        clock: Arc::clone(&clock),
        poll,
        orders: orders_out,
        samples,
        notices,
        control: std::thread::current(),
        vitals: Vitals::default(),
    };
    let thread = std::thread::spawn(move || thread.run());
    let mut latencies = Vec::with_capacity(count);
    for index in 0..count {
        // Never in step with the polls.
        let pause = 3000 + (index as u64 * 7919) % 17_000;
        clock.sleep_until(clock.now() + Duration::from_micros(pause));
        while taken.pop().is_ok() {}
        // The thread itself stops the lens when it begins.
        while arrived.try_recv().is_ok() {}
        let share = if index % 4 < 2 { 0.6 } else { 0.4 };
        let target = LensPosition(info.range.min().0 + share * info.range.length());
        let order = if index % 2 == 0 {
            Action::MoveLens { target, speed: info.max_speed }
        } else {
            Action::StopLens
        };
        let decided = clock.now();
        orders_in.send(order);
        match arrived.recv_timeout(LOST) {
            Ok(at) => latencies.push(at.since(decided)),
            Err(_) => break,
        }
    }
    drop(orders_in);
    if thread.join().is_err() {
        tracing::error!("the lens thread panicked");
    }
    latencies
}
