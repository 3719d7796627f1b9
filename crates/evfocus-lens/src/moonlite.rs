//! MoonLite focusers, and the many firmwares that speak their protocol: a stepper motor that counts its steps.
//!
//! The protocol is on no paper that is both public and readable; what is written here is what INDI's driver and several
//! firmwares agree on. Their quirks are expected: `#` after the version or not, an early start at `SN`, a "moving" that is
//! late, a reset by opening the port.
//!
//! An order does not wait for the answer to a question: `FQ`, and what sets speed and target, are written while it comes. Whether every
//! firmware hears while it speaks is not known, small ones may not; so they are written once more when the answer is in. `FG` goes out
//! when the target has been read back, an exchange later. At 9600 baud the question's own bytes are on the line for 4 ms, which no order
//! can overtake.
//!
//! The position is a count: play and lost steps are invisible to it. The protocol knows no limits, so the range comes from the
//! configuration. If the host dies, the motor goes on to its target and stays there.

pub mod protocol;

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::{HostMicros, LensPosition, LensRange, LensSample, LensSpeed};
use evfocus_hal::{Bell, Clock, DeviceError, DeviceErrorKind, Lens, LensClass, LensInfo};

use crate::Port;
use crate::continuity::Continuity;
use crate::line::{Line, Patience, Timed};
use protocol::{Command, Divisor, StepMode};

/// Baud rate of all of them.
pub const BAUD: u32 = 9600;

/// Question and answer take 10 ms; a firmware that steps in its main loop may be as late as this.
const USUAL: Patience = Patience { timeout: Duration::from_millis(300), attempts: 3 };
/// A motor whose controller is silent is stopped within 100 ms; question and answer take 10, behind an adapter that
/// gathers for 16 ms some 30.
const MOVING: Patience = Patience { timeout: Duration::from_millis(40), attempts: 2 };
/// Opening the port resets an Arduino, which is deaf for up to 2 s.
const BOOTING: Patience = Patience { timeout: Duration::from_secs(1), attempts: 3 };
/// A motor that has stood for this long away from its target, and says that it does not move, has been stopped.
const GIVEN_UP: Duration = Duration::from_millis(200);

/// What the protocol does not tell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MoonLiteConfig {
    /// The positions that the lens may be sent to, steps; 0 to 16,777,215.
    pub range: LensRange,
    /// Speed at the fastest setting, steps per second; 250 on the original, more on most copies.
    pub max_speed: LensSpeed,
    /// Full or half steps; `None` leaves it as it is.
    pub step_mode: Option<StepMode>,
}

/// What the motor was told last.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Motion {
    /// Nothing, or it has done so.
    Rest,
    /// To go to a target; it has been at `seen` since `since`.
    Going { target: u32, seen: u32, since: HostMicros },
    /// To stop; it was at `seen` then.
    Stopping { seen: Option<u32> },
}

/// A MoonLite focuser.
#[derive(Debug)]
pub struct MoonLite {
    line: Line,
    config: MoonLiteConfig,
    motion: Motion,
    /// The target that the controller must remember, or one between it and where the motor was seen last, if it was stopped.
    told: Option<u32>,
    /// Where the motor was seen last.
    seen: u32,
    /// Whether an answer was missed, so that the controller may have been reset meanwhile.
    in_doubt: bool,
    continuity: Continuity,
}

impl MoonLite {
    /// Opens the port and makes sure that a focuser answers there.
    ///
    /// # Errors
    /// What keeps the port from being opened, or that nothing, or something else, answers.
    pub fn open(port: Port, config: MoonLiteConfig, clock: Arc<dyn Clock>) -> Result<Self, DeviceError> {
        let mut lens = Self {
            line: Line::new("MoonLite focuser", port, clock),
            config,
            motion: Motion::Rest,
            told: None,
            seen: 0,
            in_doubt: false,
            continuity: Continuity::new(config.range, config.max_speed),
        };
        lens.ready()?;
        Ok(lens)
    }

    /// Connects, if need be. A motor that is found moving is stopped: nobody knows where to.
    fn ready(&mut self) -> Result<(), DeviceError> {
        if self.line.is_open() {
            return Ok(());
        }
        self.line.open()?;
        (self.motion, self.told) = (Motion::Rest, None);
        self.continuity.forget();
        let greeted = self.greet();
        self.line.greeted(greeted)
    }

    fn greet(&mut self) -> Result<(), DeviceError> {
        let version = self.line.ask(&Command::Version.encode(), BOOTING, protocol::version)?.value;
        self.line.send(&Command::Stop.encode())?;
        if let Some(mode) = self.config.step_mode {
            self.line.send(&Command::Steps(mode).encode())?;
        }
        let position = self.position()?.value;
        tracing::info!(port = self.line.place(), firmware = %version.escape_ascii(), position, "MoonLite focuser");
        Ok(())
    }

    fn patience(&self) -> Patience {
        if self.motion == Motion::Rest { USUAL } else { MOVING }
    }

    fn position(&mut self) -> Result<Timed<u32>, DeviceError> {
        self.line.ask(&Command::Position.encode(), self.patience(), protocol::position)
    }

    fn says_moving(&mut self) -> Result<bool, DeviceError> {
        Ok(self.line.ask(&Command::IsMoving.encode(), self.patience(), protocol::is_moving)?.value)
    }

    /// Whether the motor, now at `position`, is still on its way. Firmwares that step in a timer may say "not moving" right
    /// after they were sent off: only at the target, or after a while of standing still, is that believed.
    fn is_moving(&mut self, position: u32, now: HostMicros) -> Result<bool, DeviceError> {
        match self.motion {
            Motion::Rest => self.says_moving(),
            Motion::Going { target, seen, since } => {
                let moved = position != seen;
                let since = if moved { now } else { since };
                self.motion = Motion::Going { target, seen: position, since };
                if moved && position != target {
                    return Ok(true);
                }
                let has_ended = position == target || now.since(since) >= GIVEN_UP;
                if self.says_moving()? || !has_ended {
                    return Ok(true);
                }
                self.motion = Motion::Rest;
                Ok(false)
            }
            Motion::Stopping { seen } => {
                self.motion = Motion::Stopping { seen: Some(position) };
                if seen != Some(position) || self.says_moving()? {
                    return Ok(true);
                }
                self.motion = Motion::Rest;
                Ok(false)
            }
        }
    }

    /// After a reset the count begins anew, which no answer tells; but the target is forgotten too. One that was stopped since has its
    /// target on the way to the one it was told.
    fn check_memory(&mut self) -> Result<(), DeviceError> {
        let heard = self.line.ask(&Command::Target.encode(), USUAL, protocol::position)?.value;
        let seen = self.seen;
        let is_on_the_way = |told: u32| (seen.min(told)..=seen.max(told)).contains(&heard);
        match self.told.take_if(|told| !is_on_the_way(*told)) {
            None => Ok(()),
            Some(told) => {
                let what = format!(
                    "the controller has forgotten its target {told} for {heard}: it was reset, and its count with it; \
                     set its position"
                );
                Err(self.line.error(DeviceErrorKind::Fault, what))
            }
        }
    }

    /// Nothing acknowledges a target, so it is read back.
    fn set_target(&mut self, target: u32) -> Result<(), DeviceError> {
        let mut heard = 0;
        self.told = None;
        for _ in 0..USUAL.attempts {
            self.line.send(&Command::SetTarget(target).encode())?;
            heard = self.line.ask(&Command::Target.encode(), USUAL, protocol::position)?.value;
            if heard == target {
                self.told = Some(target);
                return Ok(());
            }
        }
        let what =
            format!("was told to go to {target}, and heard {heard}; check the cable and the baud rate");
        Err(self.line.error(DeviceErrorKind::Protocol, what))
    }

    fn look(&mut self) -> Result<LensSample, DeviceError> {
        if self.in_doubt {
            self.check_memory()?;
        }
        let Timed { requested, replied, value } = self.position()?;
        self.seen = value;
        let position = LensPosition(f64::from(value));
        if let Err(what) = self.continuity.check(replied, position) {
            return Err(self.line.error(DeviceErrorKind::Fault, what));
        }
        let moving = self.is_moving(value, replied)?;
        Ok(LensSample { requested, replied, position, moving })
    }
}

impl Lens for MoonLite {
    fn info(&self) -> LensInfo {
        LensInfo {
            model: "MoonLite focuser".to_owned(),
            class: LensClass::Positioner,
            serial: self.line.place().to_owned(),
            range: self.config.range,
            max_speed: self.config.max_speed,
            speed_is_share: true,
            needs_homing: false,
        }
    }

    fn listen(&mut self, bell: &Bell) {
        self.line.listen(bell);
    }

    fn home(&mut self) -> Result<(), DeviceError> {
        Ok(())
    }

    fn move_to(&mut self, target: LensPosition, speed: LensSpeed) -> Result<(), DeviceError> {
        self.line.check_target(target, self.config.range)?;
        self.ready()?;
        let target = target.0.round().clamp(0.0, f64::from(protocol::HIGHEST)) as u32;
        let share = speed.counts_per_second() / self.config.max_speed.counts_per_second();
        self.line.send(&Command::Speed(Divisor::for_share(share)).encode())?;
        self.set_target(target)?;
        self.line.send(&Command::Go.encode())?;
        let since = self.line.now();
        // No position is seen twice before the motor has had a chance to move.
        self.motion = Motion::Going { target, seen: u32::MAX, since };
        Ok(())
    }

    fn stop(&mut self) -> Result<(), DeviceError> {
        self.ready()?;
        self.motion = Motion::Stopping { seen: None };
        if !self.in_doubt {
            self.told = None;
        }
        self.line.send(&Command::Stop.encode())
    }

    fn sample(&mut self) -> Result<LensSample, DeviceError> {
        let sample = self.ready().and_then(|()| self.look());
        if sample.as_ref().is_err_and(DeviceError::is_interruption) {
            return sample;
        }
        self.in_doubt = sample.is_err();
        if sample.is_err() && self.motion != Motion::Rest && self.line.is_open() {
            // It may hear what it does not answer.
            self.motion = Motion::Stopping { seen: None };
            self.line.send(&Command::Stop.encode())?;
        }
        sample
    }
}

impl Drop for MoonLite {
    fn drop(&mut self) {
        if self.line.is_open()
            && let Err(error) = self.line.send(&Command::Stop.encode()).and_then(|()| self.line.settle())
        {
            tracing::warn!(%error, "the lens could not be stopped");
        }
    }
}
