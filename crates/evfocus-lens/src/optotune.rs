//! Optotune Lens Driver 4, 4i and E-4i, with a polymer lens: an open loop that is told a current or a focal power.
//!
//! One count is one raw unit of what is set: current in 1/4095 of the hardware's maximum, or focal power in 1/200 dioptre
//! (firmware type `A` adds 5 dioptres first). The device only repeats what it was told; positions come from a model of
//! how the glass follows ([`ResponseConfig`]). A sweep is a staircase whose steps leave with each sample, so it is as fine as
//! the samples are frequent, and ends if they do.
//!
//! A lens that sticks, or is not there, is not noticed: the device has nothing that measures where the glass is.
//!
//! A host that dies leaves the lens where it is. Temperature shifts the focus of a given current, not of a focal power.
//!
//! Not certain from the public sources: the letters of some answers (they are not looked at) and error codes other than `N`.

pub mod protocol;
mod response;

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::{HostMicros, LensPosition, LensRange, LensSample, LensSpeed};
use evfocus_hal::{Bell, Clock, DeviceError, DeviceErrorKind, Lens, LensClass, LensInfo};

use crate::Port;
use crate::line::{Line, Patience};
use protocol::Command;
use response::Response;

pub use response::ResponseConfig;

/// Baud rate; USB does not heed it.
pub const BAUD: u32 = 115_200;

const USUAL: Patience = Patience { timeout: Duration::from_millis(100), attempts: 3 };
/// The driver wakes up with its port.
const GREETING: Patience = Patience { timeout: Duration::from_millis(500), attempts: 3 };
/// How often the set-point of a moving lens is read back. Question and answer take as long as three set-points: with each of them, the
/// steps would be so coarse that the glass swings with their rhythm.
const READ_BACK: Duration = Duration::from_millis(10);
/// However seldom the samples come, a step is no longer than the way of this time.
const LONGEST_STEP: Duration = Duration::from_millis(20);
/// The glass has settled when it is this near to its rest, counts,
const SETTLED: f64 = 1.0;
/// and this slow, counts per second.
const SETTLED_SPEED: f64 = 200.0;

/// What is set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// The coil's current.
    Current,
    /// The lens's focal power; the device corrects for temperature.
    FocalPower,
}

/// What the protocol does not tell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OptotuneConfig {
    /// What is set.
    pub quantity: Quantity,
    /// The fastest sweep, counts per second.
    pub max_speed: LensSpeed,
    /// How the glass follows.
    pub response: ResponseConfig,
}

/// A staircase under way.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Sweep {
    target: f64,
    /// Counts per second.
    speed: f64,
    /// Where the staircase is, between the steps.
    at: f64,
    /// When it was there.
    time: HostMicros,
}

/// An Optotune Lens Driver.
#[derive(Debug)]
pub struct Optotune {
    line: Line,
    config: OptotuneConfig,
    serial: String,
    range: LensRange,
    set_point: i16,
    /// The set-point before.
    before: i16,
    /// When it was read back last.
    checked: HostMicros,
    sweep: Option<Sweep>,
    response: Response,
}

impl Optotune {
    /// Opens the port, makes sure that a Lens Driver answers there, and asks for its limits. The lens stays where it is,
    /// unless another quantity than before is to be set.
    ///
    /// # Errors
    /// What keeps the port from being opened, or that nothing, or something else, answers.
    pub fn open(port: Port, config: OptotuneConfig, clock: Arc<dyn Clock>) -> Result<Self, DeviceError> {
        let mut line = Line::new("Optotune Lens Driver", port, clock);
        let Greeting { serial, range, set_point } = greet(&mut line, config.quantity)?;
        let checked = line.now();
        let response = Response::new(config.response, checked, f64::from(set_point));
        let (before, sweep) = (set_point, None);
        Ok(Self { line, config, serial, range, set_point, before, checked, sweep, response })
    }

    fn ready(&mut self) -> Result<(), DeviceError> {
        if !self.line.is_open() {
            let Greeting { serial, range, set_point } = greet(&mut self.line, self.config.quantity)?;
            self.response = Response::new(self.config.response, self.line.now(), f64::from(set_point));
            (self.serial, self.range, self.sweep) = (serial, range, None);
            (self.before, self.set_point) = (set_point, set_point);
        }
        Ok(())
    }

    fn set(&mut self, raw: i16) -> Result<(), DeviceError> {
        let command = match self.config.quantity {
            Quantity::Current => Command::SetCurrent(raw),
            Quantity::FocalPower => Command::SetFocalPower(raw),
        };
        self.line.send(&command.encode())?;
        (self.before, self.set_point) = (self.set_point, raw);
        self.response.follow(self.line.now(), f64::from(raw));
        Ok(())
    }

    /// Takes the next step of the staircase.
    fn step(&mut self) -> Result<(), DeviceError> {
        let Some(mut sweep) = self.sweep else { return Ok(()) };
        let now = self.line.now();
        let farthest = sweep.speed * now.since(sweep.time).min(LONGEST_STEP).as_secs_f64();
        sweep.at += (sweep.target - sweep.at).clamp(-farthest, farthest);
        sweep.time = now;
        let raw = sweep.at.round() as i16;
        let has_ended = (sweep.target - sweep.at).abs() < 1e-9;
        self.sweep = (!has_ended).then_some(sweep);
        if raw == self.set_point { Ok(()) } else { self.set(raw) }
    }

    /// Set-points are obeyed without a word, so the last one is read back. A command that was spoilt on the way has left the
    /// one before in force.
    fn check(&mut self) -> Result<(), DeviceError> {
        let expected = [self.set_point, self.before];
        let mut heard = read_back(&mut self.line, self.config.quantity)?;
        for _ in 1..USUAL.attempts {
            if heard == self.set_point || !expected.contains(&heard) {
                break;
            }
            self.set(self.set_point)?;
            heard = read_back(&mut self.line, self.config.quantity)?;
        }
        if heard == self.set_point {
            self.checked = self.line.now();
            return Ok(());
        }
        self.line.close();
        let what = format!(
            "was set to {}, and says {heard}: it was reset, or something else sets it, or it heeds nobody; connecting again \
             sets it up anew",
            self.set_point
        );
        Err(self.line.error(DeviceErrorKind::Fault, what))
    }
}

/// What the device says of itself.
struct Greeting {
    serial: String,
    range: LensRange,
    set_point: i16,
}

fn greet(line: &mut Line, quantity: Quantity) -> Result<Greeting, DeviceError> {
    line.open()?;
    let greeting = introduce(line, quantity);
    line.greeted(greeting)
}

fn introduce(line: &mut Line, quantity: Quantity) -> Result<Greeting, DeviceError> {
    line.ask(protocol::START, GREETING, protocol::ready)?;
    let firmware = line.ask(&Command::FirmwareType.encode(), USUAL, protocol::payload::<2>)?.value;
    let serial = line.ask(&Command::SerialNumber.encode(), USUAL, protocol::payload::<9>)?.value;
    let serial = String::from_utf8_lossy(serial.get(1..).unwrap_or_default()).trim().to_owned();
    let (low, high) = match quantity {
        Quantity::Current => {
            line.ask(&Command::CurrentMode.encode(), USUAL, protocol::payload::<3>)?;
            let high = line.ask(&Command::UpperCurrent.encode(), USUAL, protocol::number::<5>)?.value;
            (line.ask(&Command::LowerCurrent.encode(), USUAL, protocol::number::<5>)?.value, high)
        }
        Quantity::FocalPower => {
            line.ask(&Command::FocalPowerMode.encode(), USUAL, protocol::focal_power_limits)?.value
        }
    };
    let ends = LensRange::new(LensPosition(f64::from(low)), LensPosition(f64::from(high)));
    let range = ends.map_err(|error| {
        line.error(
            DeviceErrorKind::Fault,
            format!("its limits make no sense: {error}; set them with Lens Driver Controller"),
        )
    })?;
    let set_point = read_back(line, quantity)?;
    tracing::info!(
        port = line.place(), firmware = %char::from(firmware[1]), serial, %range, set_point, "Optotune Lens Driver"
    );
    Ok(Greeting { serial, range, set_point })
}

fn read_back(line: &mut Line, quantity: Quantity) -> Result<i16, DeviceError> {
    let answer = match quantity {
        Quantity::Current => line.ask(&Command::Current.encode(), USUAL, protocol::number::<3>),
        Quantity::FocalPower => line.ask(&Command::FocalPower.encode(), USUAL, protocol::number::<4>),
    };
    Ok(answer?.value)
}

impl Lens for Optotune {
    fn info(&self) -> LensInfo {
        LensInfo {
            model: "Optotune Lens Driver".to_owned(),
            class: LensClass::Setpoint,
            serial: self.serial.clone(),
            range: self.range,
            max_speed: self.config.max_speed,
            speed_is_share: false,
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
        self.line.check_target(target, self.range)?;
        self.ready()?;
        let speed = speed.counts_per_second().min(self.config.max_speed.counts_per_second());
        let (at, time) = (f64::from(self.set_point), self.line.now());
        self.sweep = Some(Sweep { target: target.0.round(), speed, at, time });
        Ok(())
    }

    fn stop(&mut self) -> Result<(), DeviceError> {
        self.sweep = None;
        self.ready()
    }

    fn sample(&mut self) -> Result<LensSample, DeviceError> {
        self.ready()?;
        self.step()?;
        if self.sweep.is_none() || self.line.now().since(self.checked) >= READ_BACK {
            self.check()?;
        }
        let now = self.line.now();
        let (position, velocity) = self.response.at(now);
        let is_settled =
            (position - f64::from(self.set_point)).abs() < SETTLED && velocity.abs() < SETTLED_SPEED;
        let moving = self.sweep.is_some() || !is_settled;
        Ok(LensSample { requested: now, replied: now, position: LensPosition(position), moving })
    }
}
