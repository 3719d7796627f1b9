//! The simulated motorised lens: a motor whose position is known in closed form for any time, the play between motor and
//! glass, a read-out with noise, and the faults that strike.
//!
//! The sensor asks for positions of the past while the daemon commands new motions: both go through one short lock and
//! nobody computes anything long under it.

mod config;
mod profile;
mod state;
mod trajectory;
mod warp;

use std::cell::Cell;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use evfocus_core::{HostMicros, LensPosition, LensSample, LensSpeed};
use evfocus_hal::{Clock, DeviceError, DeviceErrorKind, Lens, LensClass, LensInfo};

pub use config::{LensConfig, LensKind};
pub(crate) use profile::Spring;
pub(crate) use state::LensState;
pub(crate) use trajectory::Command;

/// How long a caller waits for a lens that has fallen silent.
const REPLY_TIMEOUT: std::time::Duration = std::time::Duration::from_millis(50);

const MODEL: &str = "simulated lens";

/// The simulated lens, as the focus loop sees it.
pub struct SimLens {
    state: Arc<Mutex<LensState>>,
    clock: Arc<dyn Clock>,
    epoch: HostMicros,
    serial: String,
    /// Whether this handle has noticed that the lens was unplugged: it stays dead, as a file handle would.
    gone: Cell<bool>,
}

impl std::fmt::Debug for SimLens {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SimLens").field("serial", &self.serial).finish_non_exhaustive()
    }
}

/// The lens's state; a panic elsewhere leaves it usable, since no change is ever half done.
pub(crate) fn lock(state: &Mutex<LensState>) -> MutexGuard<'_, LensState> {
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

impl SimLens {
    pub(crate) fn new(
        state: Arc<Mutex<LensState>>,
        clock: Arc<dyn Clock>,
        epoch: HostMicros,
        serial: String,
    ) -> Self {
        Self { state, clock, epoch, serial, gone: Cell::new(false) }
    }

    /// Seconds since the rig was made.
    fn seconds(&self, time: HostMicros) -> f64 {
        time.micros_since(self.epoch) as f64 / 1e6
    }

    fn error(&self, kind: DeviceErrorKind, what: String) -> DeviceError {
        DeviceError::new(kind, format!("{MODEL} {}", self.serial), what)
    }

    /// Runs `action` on the state at the present time, unless a fault keeps the lens from answering.
    fn talk<T>(
        &self,
        what: &str,
        action: impl FnOnce(&mut LensState, HostMicros) -> Result<T, DeviceError>,
    ) -> Result<T, DeviceError> {
        let now = {
            let mut state = lock(&self.state);
            // Read under the lock: the sensor never sees a command that is older than what it has already computed.
            let now = self.clock.now();
            let seconds = self.seconds(now);
            if self.gone.get() || state.unplugged(seconds) {
                self.gone.set(true);
                return Err(self
                    .error(DeviceErrorKind::Disconnected, format!("cannot {what}: the lens is unplugged")));
            }
            if !state.silent(seconds) {
                return action(&mut state, now);
            }
            now
        };
        self.clock.sleep_until(now + REPLY_TIMEOUT);
        Err(self
            .error(DeviceErrorKind::TimedOut, format!("cannot {what}: no answer within {REPLY_TIMEOUT:?}")))
    }
}

impl Lens for SimLens {
    fn info(&self) -> LensInfo {
        let state = lock(&self.state);
        LensInfo {
            model: MODEL.to_owned(),
            class: LensClass::Positioner,
            speed_is_share: false,
            serial: self.serial.clone(),
            range: state.config().range,
            max_speed: state.config().max_speed,
            needs_homing: state.config().needs_homing,
        }
    }

    fn home(&mut self) -> Result<(), DeviceError> {
        self.talk("home", |state, now| {
            state.home(self.seconds(now));
            Ok(())
        })
    }

    fn move_to(&mut self, target: LensPosition, speed: LensSpeed) -> Result<(), DeviceError> {
        self.talk("move", |state, now| {
            let range = state.config().range;
            if !range.contains(target) {
                let what = format!("target {target} is outside of {range}; choose one inside");
                return Err(self.error(DeviceErrorKind::OutOfRange, what));
            }
            if !state.homed() {
                let what = format!("cannot move to {target} before the lens was homed; call home first");
                return Err(self.error(DeviceErrorKind::Fault, what));
            }
            let speed = speed.counts_per_second().min(state.config().max_speed.counts_per_second());
            state.command(self.seconds(now), Command::Travel { target: target.0, speed });
            Ok(())
        })
    }

    fn stop(&mut self) -> Result<(), DeviceError> {
        self.talk("stop", |state, now| {
            state.command(self.seconds(now), Command::Brake);
            Ok(())
        })
    }

    fn sample(&mut self) -> Result<LensSample, DeviceError> {
        let requested = self.clock.now();
        let round_trip = lock(&self.state).config().round_trip;
        if !round_trip.is_zero() {
            self.clock.sleep_until(requested + round_trip);
        }
        self.talk("read the position", |state, replied| {
            let middle = f64::midpoint(self.seconds(requested), self.seconds(replied));
            let (position, moving) = state.report(middle);
            Ok(LensSample { requested, replied, position: LensPosition(position), moving })
        })
    }
}
