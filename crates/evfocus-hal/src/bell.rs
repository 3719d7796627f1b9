//! What calls a lens away from waiting for its device.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::Waker;

/// Rung when there is something more urgent to do than to wait for a device's answer: an order. It goes on ringing until it is
/// hushed. Clones are the same bell.
#[derive(Debug, Clone, Default)]
pub struct Bell(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    rings: AtomicBool,
    sleeper: Mutex<Option<Waker>>,
}

impl Bell {
    /// Calls whoever waits, or is about to.
    pub fn ring(&self) {
        self.0.rings.store(true, Ordering::SeqCst);
        if let Some(sleeper) = self.sleeper().as_ref() {
            sleeper.wake_by_ref();
        }
    }

    /// The call has been heard.
    pub fn hush(&self) {
        self.0.rings.store(false, Ordering::SeqCst);
    }

    /// Whether it was rung and not hushed since.
    pub fn rings(&self) -> bool {
        self.0.rings.load(Ordering::SeqCst)
    }

    /// From now on ringing wakes `sleeper`, and no longer an earlier one.
    pub fn wakes(&self, sleeper: Waker) {
        *self.sleeper() = Some(sleeper);
    }

    fn sleeper(&self) -> MutexGuard<'_, Option<Waker>> {
        self.0.sleeper.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
