//! Host time: the system's monotonic clock, and a clock that a simulation moves.

use std::sync::atomic::{AtomicI64, Ordering};
use std::time::{Duration, Instant, SystemTime};

use evfocus_core::HostMicros;

/// Where host time comes from, and how to wait for it.
pub trait Clock: Send + Sync {
    /// Now.
    fn now(&self) -> HostMicros;

    /// Returns once `now()` is at or after `time`.
    fn sleep_until(&self, time: HostMicros);
}

/// The operating system's monotonic clock; zero is when it was made.
#[derive(Debug)]
pub struct SystemClock {
    origin: Instant,
}

impl SystemClock {
    /// A clock that starts at zero now.
    #[expect(clippy::disallowed_methods, reason = "this is the one place where the system clock is read")]
    #[expect(
        clippy::new_without_default,
        reason = "reading the clock is an effect; a default must have none"
    )]
    pub fn new() -> Self {
        Self { origin: Instant::now() }
    }
}

impl Clock for SystemClock {
    fn now(&self) -> HostMicros {
        HostMicros(i64::try_from(self.origin.elapsed().as_micros()).unwrap_or(i64::MAX))
    }

    #[expect(clippy::disallowed_methods, reason = "this is the one place that sleeps")]
    fn sleep_until(&self, time: HostMicros) {
        let wait = time.since(self.now());
        if wait > Duration::ZERO {
            std::thread::sleep(wait);
        }
    }
}

/// The date: time since the beginning of 1970 (UTC). For records only; it may jump.
#[expect(clippy::disallowed_methods, reason = "this is the one place where the date is read")]
pub fn unix_time() -> Duration {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default()
}

/// A clock that stands still until somebody sleeps on it or advances it.
#[derive(Debug, Default)]
pub struct VirtualClock {
    micros: AtomicI64,
}

impl VirtualClock {
    /// A clock at zero.
    pub fn new() -> Self {
        Self::default()
    }

    /// Moves the clock forward to `time`; a time in the past does nothing.
    pub fn advance_to(&self, time: HostMicros) {
        self.micros.fetch_max(time.0, Ordering::SeqCst);
    }
}

impl Clock for VirtualClock {
    fn now(&self) -> HostMicros {
        HostMicros(self.micros.load(Ordering::SeqCst))
    }

    fn sleep_until(&self, time: HostMicros) {
        self.advance_to(time);
    }
}
