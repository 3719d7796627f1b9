//! GRBL 1.1 and firmwares that speak as it does: a stepper motor on one axis of a CNC controller, moved by jogs.
//!
//! One count is one step: $100 of them are a millimetre. Positions and targets are machine coordinates, so that nobody's work
//! offset matters. A jog can be ended at any time without losing count; it is ended when the driver is dropped. If the host
//! dies, a jog goes on to its target, which lies within the limits of the configuration.
//!
//! The firmware hears while it speaks: bytes that act at once are picked out as they arrive, lines wait in its buffer. So an order
//! is written before a status report under way has come, and reports are told from acknowledgements by their form.
//!
//! Grbl's paper advises to ask for the status 5 times a second, 10 at most, for the processor's sake; measured on a simulated
//! processor it stands 100. The pace is the caller's.

mod greeting;
pub mod protocol;

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::{HostMicros, LensPosition, LensRange, LensSample, LensSpeed};
use evfocus_hal::{Bell, Clock, DeviceError, DeviceErrorKind, Lens, LensClass, LensInfo};

use crate::Port;
use crate::continuity::Continuity;
use crate::line::{Line, Timed};
use greeting::{greet, next};
use protocol::{Axis, Lines, Message, State};

/// Baud rate of version 1.1.
pub const BAUD: u32 = 115_200;

/// Longest wait for a status report or an `ok`.
const ANSWER: Duration = Duration::from_millis(300);
const ATTEMPTS: u32 = 3;
/// A motor whose controller is silent is stopped within 100 ms; question and answer take 3 to 12.
const MOVING_ANSWER: Duration = Duration::from_millis(40);
const MOVING_ATTEMPTS: u32 = 2;
/// An idle machine this near to its target has arrived, steps.
const ARRIVED: f64 = 1.5;
/// A jog that was taken and does not show by then has ended before anybody looked.
const SETTING_OUT: Duration = Duration::from_millis(100);

/// What the protocol does not tell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GrblConfig {
    /// The axis that turns the lens.
    pub axis: Axis,
    /// The positions that the lens may be sent to, steps in machine coordinates; homed machines count below zero.
    pub range: LensRange,
    /// Whether the machine must be homed before it moves; it needs $22=1.
    pub needs_homing: bool,
}

/// What the machine was told last.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Motion {
    Rest,
    /// A jog, since when.
    Jogging {
        target: f64,
        since: HostMicros,
    },
    /// A jog that waits for the one before to end: the firmware would do one after the other.
    Turning {
        target: f64,
        speed: f64,
    },
    Stopping,
    Homing,
}

/// A status report as it concerns the lens.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Report {
    state: State,
    steps: f64,
}

/// One axis of a GRBL controller.
#[derive(Debug)]
pub struct Grbl {
    line: Line,
    lines: Lines,
    config: GrblConfig,
    steps_per_mm: f64,
    max_speed: LensSpeed,
    /// Machine minus work coordinates, for controllers that report work coordinates.
    offset: [f64; 3],
    motion: Motion,
    /// Until when a report that was asked for may still come.
    asked: Option<HostMicros>,
    last_steps: f64,
    continuity: Continuity,
}

impl Grbl {
    /// Opens the port, makes sure that a GRBL answers there, and reads its settings.
    ///
    /// # Errors
    /// What keeps the port from being opened, or that nothing, or something else, answers.
    pub fn open(port: Port, config: GrblConfig, clock: Arc<dyn Clock>) -> Result<Self, DeviceError> {
        let mut line = Line::new("GRBL controller", port, clock);
        let mut lines = Lines::default();
        line.open()?;
        let greeted = greet(&mut line, &mut lines, &config);
        let (steps_per_mm, max_speed) = line.greeted(greeted)?;
        Ok(Self {
            line,
            lines,
            config,
            steps_per_mm,
            max_speed,
            offset: [0.0; 3],
            motion: Motion::Rest,
            asked: None,
            last_steps: 0.0,
            continuity: Continuity::new(config.range, max_speed),
        })
    }

    fn ready(&mut self) -> Result<(), DeviceError> {
        if self.line.is_open() {
            return Ok(());
        }
        self.line.open()?;
        self.lines = Lines::default();
        self.motion = Motion::Rest;
        self.continuity.forget();
        self.asked = None;
        let greeted = greet(&mut self.line, &mut self.lines, &self.config);
        (self.steps_per_mm, self.max_speed) = self.line.greeted(greeted)?;
        Ok(())
    }

    /// Asks where the axis is.
    fn report(&mut self) -> Result<Timed<Report>, DeviceError> {
        let (patience, attempts) =
            if self.motion == Motion::Rest { (ANSWER, ATTEMPTS) } else { (MOVING_ANSWER, MOVING_ATTEMPTS) };
        for _ in 0..attempts {
            self.settle(patience)?;
            self.heed_waiting()?;
            let requested = self.line.now();
            self.line.send(&[protocol::STATUS])?;
            let deadline = self.line.now() + patience;
            self.asked = Some(deadline);
            while let Some(message) = next(&mut self.line, &mut self.lines, deadline)? {
                if let Message::Status { state, machine, work, offset } = message {
                    self.offset = offset.unwrap_or(self.offset);
                    let axis = self.config.axis;
                    let of_work = work.map(|work| protocol::of(axis, work) + protocol::of(axis, self.offset));
                    let Some(mm) = machine.map(|machine| protocol::of(axis, machine)).or(of_work) else {
                        continue;
                    };
                    self.asked = None;
                    let value = Report { state, steps: mm * self.steps_per_mm };
                    return Ok(Timed { requested, replied: self.line.now(), value });
                }
                self.heed(message)?;
            }
            self.asked = None;
        }
        let what =
            format!("no status report within {patience:?}, asked {attempts} times; check power and cable");
        Err(self.line.error(DeviceErrorKind::TimedOut, what))
    }

    /// Waits for the report that was left open for an order: the next one must not be taken for it.
    fn settle(&mut self, patience: Duration) -> Result<(), DeviceError> {
        let limit = self.line.now() + patience;
        while let Some(deadline) = self.asked {
            match next(&mut self.line, &mut self.lines, deadline.min(limit))? {
                Some(message) => self.heed(message)?,
                None => self.asked = None,
            }
        }
        Ok(())
    }

    /// Heeds what has come in by itself; late reports among it are of no use.
    fn heed_waiting(&mut self) -> Result<(), DeviceError> {
        let now = self.line.now();
        while let Some(message) = next(&mut self.line, &mut self.lines, now)? {
            self.heed(message)?;
        }
        Ok(())
    }

    /// Messages that mean trouble, whenever they come.
    fn heed(&mut self, message: Message) -> Result<(), DeviceError> {
        let what = match message {
            Message::Alarm(code) => format!("ALARM:{code}: {}", protocol::alarm_text(code)),
            Message::Error(code) => format!("error:{code}: {}", protocol::error_text(code)),
            Message::Banner => "it was reset, and its count with it; home it, or set its position".to_owned(),
            Message::Status { .. } => {
                self.asked = None;
                return Ok(());
            }
            Message::Ok | Message::Setting(..) | Message::Other => return Ok(()),
        };
        self.motion = Motion::Rest;
        Err(self.line.error(DeviceErrorKind::Fault, what))
    }

    fn jog(&mut self, target: f64, speed: f64) -> Result<(), DeviceError> {
        let (mm, feed) = (target / self.steps_per_mm, 60.0 * speed / self.steps_per_mm);
        self.line.send(&protocol::jog(self.config.axis, mm, feed))?;
        self.motion = Motion::Jogging { target, since: self.line.now() };
        let deadline = self.line.now() + ANSWER;
        while let Some(message) = next(&mut self.line, &mut self.lines, deadline)? {
            if message == Message::Ok {
                return Ok(());
            }
            self.heed(message)?;
        }
        let what = format!("did not take a jog to {target} within {ANSWER:?}; check power and cable");
        Err(self.line.error(DeviceErrorKind::TimedOut, what))
    }

    /// Whether the lens is on its way, by what it was told and what it reports.
    fn is_moving(&mut self, report: Report, now: HostMicros) -> Result<bool, DeviceError> {
        let is_idle = match report.state {
            State::Idle => true,
            State::Moving | State::Homing => false,
            State::Alarm if self.config.needs_homing && self.motion == Motion::Rest => true,
            State::Alarm => {
                self.motion = Motion::Rest;
                return Err(self
                    .line
                    .error(DeviceErrorKind::Fault, "it is locked; home it, or unlock it with $X"));
            }
            State::Held => {
                let what = "it is on hold, or its door is open; end that at the controller";
                return Err(self.line.error(DeviceErrorKind::Fault, what));
            }
        };
        match self.motion {
            Motion::Turning { target, speed } if is_idle => self.jog(target, speed).map(|()| true),
            Motion::Jogging { target, since } if is_idle => {
                let is_there = (report.steps - target).abs() <= ARRIVED;
                let has_ended = is_there || now.since(since) >= SETTING_OUT;
                self.motion = if has_ended { Motion::Rest } else { self.motion };
                Ok(!has_ended)
            }
            Motion::Rest | Motion::Stopping | Motion::Homing if is_idle => {
                self.motion = Motion::Rest;
                Ok(false)
            }
            Motion::Rest
            | Motion::Jogging { .. }
            | Motion::Turning { .. }
            | Motion::Stopping
            | Motion::Homing => Ok(true),
        }
    }

    /// A homing cycle answers nothing before it ends; then comes its `ok`.
    fn look_homing(&mut self) -> Result<Option<LensSample>, DeviceError> {
        let now = self.line.now();
        while let Some(message) = next(&mut self.line, &mut self.lines, now)? {
            if message == Message::Ok {
                self.motion = Motion::Rest;
                self.continuity.forget();
                return Ok(None);
            }
            self.heed(message)?;
        }
        let position = LensPosition(self.last_steps);
        Ok(Some(LensSample { requested: now, replied: self.line.now(), position, moving: true }))
    }
}

impl Lens for Grbl {
    fn info(&self) -> LensInfo {
        LensInfo {
            model: "GRBL controller".to_owned(),
            class: LensClass::Positioner,
            serial: self.line.place().to_owned(),
            range: self.config.range,
            max_speed: self.max_speed,
            speed_is_share: false,
            needs_homing: self.config.needs_homing,
        }
    }

    fn listen(&mut self, bell: &Bell) {
        self.line.listen(bell);
    }

    fn home(&mut self) -> Result<(), DeviceError> {
        if !self.config.needs_homing {
            return Ok(());
        }
        self.ready()?;
        self.line.drain()?;
        self.line.send(protocol::HOME)?;
        self.motion = Motion::Homing;
        Ok(())
    }

    fn move_to(&mut self, target: LensPosition, speed: LensSpeed) -> Result<(), DeviceError> {
        self.line.check_target(target, self.config.range)?;
        self.ready()?;
        let target = target.0.round();
        let speed = speed.counts_per_second().min(self.max_speed.counts_per_second());
        match self.motion {
            Motion::Rest => self.jog(target, speed),
            Motion::Jogging { .. } | Motion::Turning { .. } | Motion::Stopping => {
                self.motion = Motion::Turning { target, speed };
                self.line.send(&[protocol::JOG_CANCEL])
            }
            Motion::Homing => Err(self.line.error(DeviceErrorKind::Busy, "it is homing; wait for its end")),
        }
    }

    fn stop(&mut self) -> Result<(), DeviceError> {
        self.ready()?;
        if self.motion != Motion::Homing {
            self.motion = Motion::Stopping;
            return self.line.send(&[protocol::JOG_CANCEL]);
        }
        self.line.send(&[protocol::SOFT_RESET])?;
        (self.motion, self.asked) = (Motion::Rest, None);
        // Its greeting is expected here, and news anywhere else.
        let deadline = self.line.now() + ANSWER;
        while let Some(message) = next(&mut self.line, &mut self.lines, deadline)? {
            if message == Message::Banner {
                return Ok(());
            }
        }
        let what = format!("did not start anew within {ANSWER:?}, and may still be homing");
        Err(self.line.error(DeviceErrorKind::TimedOut, what))
    }

    fn sample(&mut self) -> Result<LensSample, DeviceError> {
        self.ready()?;
        if self.motion == Motion::Homing
            && let Some(sample) = self.look_homing()?
        {
            return Ok(sample);
        }
        let report = self.report();
        if report.as_ref().is_err_and(|error| !error.is_interruption()) && self.line.is_open() {
            // It may hear what it does not answer.
            self.line.send(&[protocol::JOG_CANCEL])?;
        }
        let Timed { requested, replied, value } = report?;
        self.last_steps = value.steps;
        let position = LensPosition(value.steps);
        if let Err(what) = self.continuity.check(replied, position) {
            return Err(self.line.error(DeviceErrorKind::Fault, what));
        }
        let moving = self.is_moving(value, replied)?;
        Ok(LensSample { requested, replied, position, moving })
    }
}

impl Drop for Grbl {
    fn drop(&mut self) {
        if self.line.is_open()
            && let Err(error) = self.line.send(&[match self.motion {
                Motion::Homing => protocol::SOFT_RESET,
                Motion::Rest | Motion::Jogging { .. } | Motion::Turning { .. } | Motion::Stopping => {
                    protocol::JOG_CANCEL
                }
            }])
        {
            tracing::warn!(%error, "the lens could not be stopped");
        }
    }
}
