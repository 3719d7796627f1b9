//! Any focuser that an INDI server drives: absolute positions, abort, and updates while it moves.
//!
//! The server polls the focuser and sends on what it sees, at most every 10 to 50 ms; its times are whole seconds, so positions
//! are dated by their arrival. Speeds are the focuser's affair: where it has a `FOCUS_SPEED`, that is set in proportion
//! (`lens.indi.set_speed`); else it moves as it does. If the host dies, the focuser goes on to its target and stays there.

pub mod protocol;
mod session;
mod xml;

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::{HostMicros, LensPosition, LensRange, LensSample, LensSpeed};
use evfocus_hal::{Bell, Clock, DeviceError, DeviceErrorKind, Lens, LensClass, LensInfo};

use crate::Port;
use crate::continuity::Continuity;
use protocol::{Kind, State};
use session::Session;

/// TCP port of an INDI server.
pub const PORT: u16 = 7624;

/// A moving focuser is waited for this long, in polling periods.
const PERIODS: u32 = 3;
/// An update this soon after a command may still be about the command before.
const STALE: Duration = Duration::from_millis(300);
/// So many updates are a stream; one that ceases for this long, and for three times its longest gap, has been cut off.
const STREAM: u32 = 3;
const CEASED: Duration = Duration::from_millis(60);
/// A focuser at rest this near to its target has arrived.
const ARRIVED: f64 = 1.5;
/// What a motion may take beyond twice its way by speed: some drivers say nothing before its end.
const SLACK: Duration = Duration::from_secs(5);

/// A value that is set before the device is connected, such as its serial port.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Setting {
    /// The property, for example `DEVICE_PORT`.
    pub property: String,
    /// Its member, for example `PORT`.
    pub member: String,
    /// The value; `On` and `Off` for switches.
    pub value: String,
}

/// What the protocol does not tell.
#[derive(Debug, Clone, PartialEq)]
pub struct IndiConfig {
    /// The device's name, as the server calls it.
    pub device: String,
    /// Set before the device is connected, in this order.
    pub settings: Vec<Setting>,
    /// How often the server shall ask the focuser.
    pub polling: Duration,
    /// The focuser's speed, counts per second; timed, for the protocol does not tell.
    pub max_speed: LensSpeed,
    /// Whether `FOCUS_SPEED` is set in proportion to the speed asked.
    pub set_speed: bool,
    /// Whether a focuser that cannot be stopped will do.
    pub without_abort: bool,
}

/// What the focuser was told last.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Motion {
    Rest,
    /// With the updates since then.
    Going {
        target: f64,
        since: HostMicros,
        until: HostMicros,
        stream: Stream,
    },
    /// It was at `seen` since `changed`: many say that they rest as soon as they are told to.
    Stopping {
        since: HostMicros,
        seen: f64,
        changed: HostMicros,
    },
}

/// The updates of a motion.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Stream {
    updates: u32,
    last: Option<HostMicros>,
    longest_gap: Duration,
}

impl Stream {
    fn note(&mut self, time: HostMicros) {
        if let Some(last) = self.last.filter(|last| time > *last) {
            self.longest_gap = self.longest_gap.max(time.since(last));
            self.updates += 1;
        }
        self.last = Some(time);
    }

    /// Whether updates came regularly, and have ceased. Some servers say nothing before the end of a motion; for those this is never so.
    fn has_ceased(&self, now: HostMicros) -> bool {
        let longest = CEASED.max(3 * self.longest_gap);
        self.updates >= STREAM && self.last.is_some_and(|last| now.since(last) >= longest)
    }
}

/// A focuser behind an INDI server.
#[derive(Debug)]
pub struct Indi {
    session: Session,
    config: IndiConfig,
    range: LensRange,
    motion: Motion,
    continuity: Continuity,
}

impl Indi {
    /// Connects to the server and the device, and learns its limits.
    ///
    /// # Errors
    /// What keeps it from connecting; that there is no such device, or that it is no focuser, or one without abort.
    pub fn open(port: Port, config: IndiConfig, clock: Arc<dyn Clock>) -> Result<Self, DeviceError> {
        let mut session = Session::new(port, clock);
        let range = session.begin(&config)?;
        let continuity = Continuity::new(range, config.max_speed);
        Ok(Self { session, config, range, motion: Motion::Rest, continuity })
    }

    fn ready(&mut self) -> Result<(), DeviceError> {
        if !self.session.line.is_open() {
            self.motion = Motion::Rest;
            self.continuity.forget();
            self.range = self.session.begin(&self.config)?;
            self.abort()?;
        }
        Ok(())
    }

    fn abort(&mut self) -> Result<(), DeviceError> {
        let since = self.session.line.now();
        self.motion = Motion::Stopping { since, seen: self.session.position.steps, changed: since };
        self.session.set("FOCUS_ABORT_MOTION", Kind::Switch, "ABORT", "On")
    }

    fn fault(&self, what: String) -> DeviceError {
        self.session.line.error(DeviceErrorKind::Fault, what)
    }

    /// Whether the focuser is on its way, by the newest update.
    fn is_moving(&mut self, now: HostMicros) -> Result<bool, DeviceError> {
        let update = self.session.position;
        let state = update.state;
        match self.motion {
            Motion::Rest => Ok(state == State::Busy),
            Motion::Going { target, since, until, mut stream } => {
                let is_news = update.time > since;
                if is_news {
                    stream.note(update.time);
                }
                self.motion = Motion::Going { target, since, until, stream };
                let is_there = (update.steps - target).abs() <= ARRIVED;
                if is_news && state == State::Alert {
                    self.motion = Motion::Rest;
                    let words = self.session.wait_for_words()?;
                    return Err(self.fault(format!("did not go to {target}: {words}")));
                }
                let has_ended = is_news && state != State::Busy && (is_there || update.time > since + STALE);
                if has_ended {
                    self.motion = Motion::Rest;
                    return Ok(false);
                }
                if state == State::Busy && stream.has_ceased(now) {
                    let what = format!(
                        "has said nothing for {:?} on its way to {target}, at {} last; it was told to stop. Is the server still there?",
                        now.since(update.time),
                        update.steps
                    );
                    self.abort()?;
                    return Err(self.session.line.error(DeviceErrorKind::TimedOut, what));
                }
                if now > until {
                    self.motion = Motion::Rest;
                    let what = format!(
                        "is not at {target}, but at {} and {state:?}, long after it should be",
                        update.steps
                    );
                    return Err(self.session.line.error(DeviceErrorKind::TimedOut, what));
                }
                Ok(true)
            }
            Motion::Stopping { since, seen, changed } => {
                let is_news = update.time > since || now > since + STALE;
                let has_moved = (update.steps - seen).abs() >= 0.5;
                let changed = if has_moved { now } else { changed };
                let stands = now.since(changed) >= self.config.polling.mul_f64(1.5);
                let has_stopped = is_news && state != State::Busy && stands;
                let stopping = Motion::Stopping { since, seen: update.steps, changed };
                self.motion = if has_stopped { Motion::Rest } else { stopping };
                Ok(!has_stopped)
            }
        }
    }
}

impl Lens for Indi {
    fn info(&self) -> LensInfo {
        LensInfo {
            model: self.config.device.clone(),
            class: LensClass::Positioner,
            serial: format!("INDI {}", self.session.line.place()),
            range: self.range,
            max_speed: self.config.max_speed,
            speed_is_share: self.config.set_speed,
            needs_homing: false,
        }
    }

    fn listen(&mut self, bell: &Bell) {
        self.session.line.listen(bell);
    }

    fn home(&mut self) -> Result<(), DeviceError> {
        Ok(())
    }

    fn move_to(&mut self, target: LensPosition, speed: LensSpeed) -> Result<(), DeviceError> {
        self.session.line.check_target(target, self.range)?;
        self.ready()?;
        self.session.read_waiting()?;
        let share = (speed.counts_per_second() / self.config.max_speed.counts_per_second()).min(1.0);
        if self.config.set_speed {
            self.session.set_speed(share)?;
        }
        self.session.forget_words();
        let target = target.0.round();
        let since = self.session.line.now();
        let way = Duration::from_secs_f64(
            2.0 * (target - self.session.position.steps).abs()
                / (share * self.config.max_speed.counts_per_second()),
        );
        self.motion = Motion::Going { target, since, until: since + way + SLACK, stream: Stream::default() };
        let position = target.to_string();
        self.session.set("ABS_FOCUS_POSITION", Kind::Number, "FOCUS_ABSOLUTE_POSITION", &position)
    }

    fn stop(&mut self) -> Result<(), DeviceError> {
        self.ready()?;
        self.session.read_waiting()?;
        if self.motion == Motion::Rest && self.session.position.state != State::Busy {
            return Ok(());
        }
        self.abort()
    }

    fn sample(&mut self) -> Result<LensSample, DeviceError> {
        self.ready()?;
        let requested = self.session.line.now();
        self.session.read_waiting()?;
        if self.motion != Motion::Rest || self.session.position.state == State::Busy {
            // What waited is old; the next update is dated by its arrival.
            self.session.next_position(requested + PERIODS * self.config.polling)?;
        }
        let update = self.session.position;
        let position = LensPosition(update.steps);
        if let Err(what) = self.continuity.check(update.time.max(requested), position) {
            return Err(self.fault(what));
        }
        let replied = self.session.line.now();
        let moving = self.is_moving(replied)?;
        // An update that arrived during this call belongs to its arrival, which ends the call; a focuser at rest, to now.
        Ok(LensSample { requested: replied, replied, position, moving })
    }
}

impl Drop for Indi {
    fn drop(&mut self) {
        if self.session.line.is_open()
            && self.motion != Motion::Rest
            && let Err(error) = self.abort()
        {
            tracing::warn!(%error, "the lens could not be stopped");
        }
    }
}
