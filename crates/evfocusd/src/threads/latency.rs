//! How long an order takes from the control thread's decision until it has left for the lens.

use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use evfocus_core::controller::Action;
use evfocus_core::{HostMicros, LensPosition, LensSample, LensSpeed};
use evfocus_hal::{Bell, Clock, DeviceError, Lens, LensInfo, Transport};
use evfocus_lens::Port;
use rtrb::RingBuffer;

use super::NOTICES;
use super::lens::{LensThread, SAMPLES};
use super::orders::orders;
use crate::vitals::Vitals;

/// An answer that takes longer than this will not come.
const LOST: Duration = Duration::from_secs(5);

/// What has become of the order that the lens has.
#[derive(Debug, Clone, Copy)]
enum Order {
    None,
    /// The driver has it.
    Given,
    /// Its first bytes were written.
    Left(HostMicros),
}

/// Notes when orders leave for a lens: give its port to [`tap`](Self::tap).
#[derive(Clone)]
pub struct Departures {
    clock: Arc<dyn Clock>,
    order: Arc<Mutex<Order>>,
}

impl std::fmt::Debug for Departures {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Departures").field("order", &self.order).finish_non_exhaustive()
    }
}

impl Departures {
    /// None yet; times are those of `clock`.
    pub fn new(clock: Arc<dyn Clock>) -> Self {
        Self { clock, order: Arc::new(Mutex::new(Order::None)) }
    }

    /// The same port, watched.
    #[must_use]
    pub fn tap(&self, port: Port) -> Port {
        let departures = self.clone();
        port.through(move |line| Box::new(Tap { line, departures: departures.clone() }))
    }

    fn order(&self) -> MutexGuard<'_, Order> {
        self.order.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn note(&self) {
        let mut order = self.order();
        if let Order::Given = *order {
            *order = Order::Left(self.clock.now());
        }
    }
}

/// A line that notes when the first bytes of an order have been written.
struct Tap {
    line: Box<dyn Transport>,
    departures: Departures,
}

impl Transport for Tap {
    fn write(&mut self, bytes: &[u8]) -> Result<(), DeviceError> {
        self.line.write(bytes)?;
        self.departures.note();
        Ok(())
    }

    fn read(&mut self, buffer: &mut [u8], deadline: HostMicros) -> Result<usize, DeviceError> {
        self.line.read(buffer, deadline)
    }

    fn listen(&mut self, bell: &Bell) {
        self.line.listen(bell);
    }

    fn drain(&mut self) -> Result<(), DeviceError> {
        self.line.drain()
    }
}

/// Notes when an order has left, and passes it on.
struct Watched {
    lens: Box<dyn Lens>,
    departures: Departures,
    left: Sender<HostMicros>,
}

impl Watched {
    /// An order for which nothing is written is with the loop that steers the lens when the call returns.
    fn obey(
        &mut self,
        order: impl FnOnce(&mut dyn Lens) -> Result<(), DeviceError>,
    ) -> Result<(), DeviceError> {
        *self.departures.order() = Order::Given;
        let outcome = order(self.lens.as_mut());
        let left = match std::mem::replace(&mut *self.departures.order(), Order::None) {
            Order::Left(time) => time,
            Order::None | Order::Given => self.departures.clock.now(),
        };
        // Whoever counts may have gone.
        self.left.send(left).unwrap_or_default();
        outcome
    }
}

impl Lens for Watched {
    fn info(&self) -> LensInfo {
        self.lens.info()
    }

    fn listen(&mut self, bell: &Bell) {
        self.lens.listen(bell);
    }

    fn home(&mut self) -> Result<(), DeviceError> {
        self.lens.home()
    }

    fn move_to(&mut self, target: LensPosition, speed: LensSpeed) -> Result<(), DeviceError> {
        self.obey(|lens| lens.move_to(target, speed))
    }

    fn stop(&mut self) -> Result<(), DeviceError> {
        self.obey(|lens| lens.stop())
    }

    fn sample(&mut self) -> Result<LensSample, DeviceError> {
        self.lens.sample()
    }
}

/// Orders the lens about `count` times, there and back and stopped in turn, through the thread that the daemon runs it on, while that
/// asks every `poll` for its position. How long each order took, in real time: until its first bytes were written, or, where the order is
/// one for a loop in the driver, until that had it.
pub fn command_latency(
    lens: Box<dyn Lens>,
    poll: Duration,
    count: usize,
    departures: &Departures,
) -> Vec<Duration> {
    let clock = Arc::clone(&departures.clock);
    let (left, has_left) = channel();
    let info = lens.info();
    let watched = Watched { lens, departures: departures.clone(), left };
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
        while has_left.try_recv().is_ok() {}
        let share = if index % 4 < 2 { 0.6 } else { 0.4 };
        let target = LensPosition(info.range.min().0 + share * info.range.length());
        let order = if index % 2 == 0 {
            Action::MoveLens { target, speed: info.max_speed }
        } else {
            Action::StopLens
        };
        let decided = clock.now();
        orders_in.send(order);
        match has_left.recv_timeout(LOST) {
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
