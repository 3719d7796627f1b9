//! Orders to the lens: the latest motion counts, and a stop is never lost.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use evfocus_core::HostMicros;
use evfocus_core::controller::Action;
use evfocus_hal::Bell;

/// What the lens is to do next. A slot rather than a queue: a motion that has been replaced need not be begun, so there is
/// always room, however many callers move the lens at once.
#[derive(Debug)]
struct Slot {
    stop: bool,
    motion: Option<Action>,
    closed: bool,
    /// What is being done.
    at_work: Option<Action>,
    obeyed: HostMicros,
}

impl Default for Slot {
    fn default() -> Self {
        Self { stop: false, motion: None, closed: false, at_work: None, obeyed: HostMicros(i64::MIN) }
    }
}

#[derive(Debug, Default)]
struct Shared {
    slot: Mutex<Slot>,
    filled: Condvar,
    /// Rings for an order that need not wait for what the lens thread does.
    bell: Bell,
}

impl Shared {
    /// The slot holds plain data that is whole after every statement, so a panic elsewhere does not spoil it.
    fn slot(&self) -> MutexGuard<'_, Slot> {
        self.slot.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The control thread's end. Dropping it ends the orders.
#[derive(Debug)]
pub(crate) struct OrderSender(Arc<Shared>);

/// The lens thread's end.
#[derive(Debug)]
pub(crate) struct OrderReceiver(Arc<Shared>);

/// What comes out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Received {
    /// Do this.
    Order(Action),
    /// Nothing was ordered in time.
    Nothing,
    /// There will be no more orders.
    End,
}

/// The two ends of a slot.
pub(crate) fn orders() -> (OrderSender, OrderReceiver) {
    let shared = Arc::new(Shared::default());
    (OrderSender(Arc::clone(&shared)), OrderReceiver(shared))
}

impl OrderSender {
    /// Orders `action`. A stop takes back a motion that has not been begun; a motion replaces one.
    pub(crate) fn send(&self, action: Action) {
        let mut slot = self.0.slot();
        match action {
            Action::StopLens => (slot.stop, slot.motion) = (true, None),
            Action::Home | Action::MoveLens { .. } => {
                (slot.motion, slot.obeyed) = (Some(action), HostMicros(i64::MAX));
            }
            Action::RunEnded => return,
        }
        // A motion cut short by each one that follows would never be done, and nothing is more urgent than a stop.
        let may_interrupt = match slot.at_work {
            None => true,
            Some(Action::StopLens) => false,
            Some(_) => slot.stop,
        };
        if may_interrupt {
            self.0.bell.ring();
        }
        self.0.filled.notify_one();
    }

    /// When the last motion was begun; the end of time if it has not been. What the lens answered to an earlier question does
    /// not show that motion.
    pub(crate) fn obeyed(&self) -> HostMicros {
        self.0.slot().obeyed
    }
}

impl Drop for OrderSender {
    fn drop(&mut self) {
        self.0.slot().closed = true;
        self.0.bell.ring();
        self.0.filled.notify_one();
    }
}

impl OrderReceiver {
    /// Rings while an order has come that should not wait.
    pub(crate) fn bell(&self) -> &Bell {
        &self.0.bell
    }

    /// Waits for an order for at most `timeout`; a stop comes before the motion that was ordered after it.
    pub(crate) fn receive(&self, timeout: Duration) -> Received {
        let is_empty = |slot: &mut Slot| !slot.stop && slot.motion.is_none() && !slot.closed;
        let slot = self.0.filled.wait_timeout_while(self.0.slot(), timeout, is_empty);
        let mut slot = slot.unwrap_or_else(PoisonError::into_inner).0;
        self.0.bell.hush();
        slot.at_work =
            if std::mem::take(&mut slot.stop) { Some(Action::StopLens) } else { slot.motion.take() };
        if let Some(order) = slot.at_work {
            Received::Order(order)
        } else if slot.closed {
            Received::End
        } else {
            Received::Nothing
        }
    }

    /// Everything received was done, or failed, by `now`.
    pub(crate) fn done(&self, now: HostMicros) {
        let mut slot = self.0.slot();
        slot.at_work = None;
        if slot.motion.is_none() {
            slot.obeyed = now;
        }
    }
}

#[cfg(test)]
mod tests {
    use evfocus_core::{LensPosition, LensSpeed};

    use super::*;

    fn to(position: f64) -> Action {
        Action::MoveLens { target: LensPosition(position), speed: LensSpeed::new(1.0).unwrap() }
    }

    fn all(receiver: &OrderReceiver) -> Vec<Received> {
        std::iter::from_fn(|| Some(receiver.receive(Duration::ZERO)))
            .take_while(|received| matches!(received, Received::Order(_)))
            .collect()
    }

    #[test]
    fn the_latest_motion_counts_and_there_is_always_room() {
        let (sender, receiver) = orders();
        for position in 0..1000 {
            sender.send(to(f64::from(position)));
        }
        assert_eq!(all(&receiver), [Received::Order(to(999.0))]);
    }

    #[test]
    fn a_stop_is_never_lost_and_takes_back_what_was_not_begun() {
        let (sender, receiver) = orders();
        sender.send(to(1.0));
        sender.send(Action::StopLens);
        assert_eq!(all(&receiver), [Received::Order(Action::StopLens)]);
        sender.send(Action::StopLens);
        sender.send(to(2.0));
        sender.send(to(3.0));
        assert_eq!(all(&receiver), [Received::Order(Action::StopLens), Received::Order(to(3.0))]);
    }

    #[test]
    fn a_motion_counts_as_begun_when_it_and_every_later_one_was_done() {
        let (sender, receiver) = orders();
        sender.send(to(1.0));
        assert_eq!(sender.obeyed(), HostMicros(i64::MAX));
        assert_eq!(receiver.receive(Duration::ZERO), Received::Order(to(1.0)));
        sender.send(to(2.0));
        receiver.done(HostMicros(10));
        assert_eq!(sender.obeyed(), HostMicros(i64::MAX), "the second waits still");
        assert_eq!(receiver.receive(Duration::ZERO), Received::Order(to(2.0)));
        receiver.done(HostMicros(20));
        assert_eq!(sender.obeyed(), HostMicros(20));
        sender.send(to(3.0));
        sender.send(Action::StopLens);
        assert_eq!(all(&receiver), [Received::Order(Action::StopLens)]);
        receiver.done(HostMicros(30));
        assert_eq!(sender.obeyed(), HostMicros(30), "the stop took the third back");
    }

    #[test]
    fn an_order_rings_unless_it_must_wait_for_the_one_before() {
        let (sender, receiver) = orders();
        let rings = |order| {
            sender.send(order);
            receiver.bell().rings()
        };
        assert!(rings(to(1.0)), "whatever was asked of the lens, it waits");
        assert_eq!(receiver.receive(Duration::ZERO), Received::Order(to(1.0)));
        assert!(!receiver.bell().rings(), "the call was heard");
        assert!(!rings(to(2.0)), "or no motion would ever be done");
        assert!(rings(Action::StopLens), "nothing is more urgent");
        assert_eq!(receiver.receive(Duration::ZERO), Received::Order(Action::StopLens));
        assert!(!rings(to(3.0)) && !rings(Action::StopLens), "nothing cuts a stop short");
        receiver.done(HostMicros(10));
        assert_eq!(receiver.receive(Duration::ZERO), Received::Order(Action::StopLens));
        receiver.done(HostMicros(20));
        assert!(rings(to(4.0)));
        drop(sender);
        assert!(receiver.bell().rings());
    }

    #[test]
    fn the_end_comes_after_the_last_order() {
        let (sender, receiver) = orders();
        assert_eq!(receiver.receive(Duration::ZERO), Received::Nothing);
        sender.send(Action::StopLens);
        drop(sender);
        assert_eq!(receiver.receive(Duration::ZERO), Received::Order(Action::StopLens));
        assert_eq!(receiver.receive(Duration::ZERO), Received::End);
    }
}
