//! What may go wrong with a lens, and what comes of it.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use evfocus_core::controller::{Command, FocusRequest};
use evfocus_core::{HostMicros, LensPosition, Outcome, Phase};
use evfocus_hal::{Clock, DeviceError, Lens, SystemClock, VirtualClock};
use evfocus_lens::Port;
use evfocusd::config::{LensBackend, LensDriver};
use evfocusd::{VirtualRig, devices};
use hil_sim::wire::{Protocol, Server, WireFault, WirePort};
use hil_sim::{Fault, FaultKind, FaultTrigger, Rig};

use crate::lenses::{EmulatedLens, config};

/// Where a fault strikes in mid-sweep, counts.
const WHERE: f64 = 1500.0;

/// A glass that has not moved for so long has come to a standstill.
const STANDSTILL: Duration = Duration::from_millis(60);

/// A fault at the time a lens is opened.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Opening {
    /// The port does not exist.
    NoSuchPort,
    /// Another program holds it, or nobody listens there.
    InUse,
    /// Another device is on it.
    OtherDevice,
    /// Nothing answers.
    Silence,
    /// What answers is garbage: a wrong baud rate.
    WrongBaud,
    /// One bit of each answer is wrong.
    WrongBits,
}

/// All of them.
pub const OPENINGS: [Opening; 6] = [
    Opening::NoSuchPort,
    Opening::InUse,
    Opening::OtherDevice,
    Opening::Silence,
    Opening::WrongBaud,
    Opening::WrongBits,
];

impl Opening {
    /// For the table.
    pub fn name(self) -> &'static str {
        match self {
            Self::NoSuchPort => "no such port, nobody listens",
            Self::InUse => "port in use",
            Self::OtherDevice => "another device on it",
            Self::Silence => "silence",
            Self::WrongBaud => "wrong baud rate",
            Self::WrongBits => "wrong bits",
        }
    }
}

fn driver(lens: &EmulatedLens) -> Result<LensDriver> {
    match config(lens.section, 1)?.lens {
        LensBackend::Driver { driver, .. } => Ok(driver),
        LensBackend::Simulated => bail!("{} is no driver", lens.name),
    }
}

/// A model of `protocol` on `clock`.
fn model(protocol: Protocol, lens: &EmulatedLens, clock: &Arc<dyn Clock>) -> Result<WirePort> {
    Ok(WirePort::with_a_motor(protocol, config(lens.section, 1)?.rig.lens, Arc::clone(clock)))
}

fn port(wire: &WirePort) -> Port {
    let wire = wire.clone();
    Port::new("emulated", Box::new(move || wire.open()))
}

/// The error of opening `lens` under `opening`.
///
/// # Errors
/// It was opened all the same.
pub fn open_error(lens: &EmulatedLens, opening: Opening) -> Result<DeviceError> {
    let driver = driver(lens)?;
    let protocol = driver.protocol();
    let clock: Arc<dyn Clock> = Arc::new(VirtualClock::new());
    let is_tcp = matches!(protocol, Protocol::LabJack | Protocol::Indi);
    let place = match opening {
        Opening::NoSuchPort if is_tcp => Port::tcp("127.0.0.1:1", Arc::clone(&clock)),
        Opening::NoSuchPort => Port::serial("/dev/ttyNOBODY", 9600, Arc::clone(&clock)),
        Opening::InUse => return in_use(&driver, lens),
        Opening::OtherDevice => {
            let other = if protocol == Protocol::Grbl { Protocol::Firmata } else { Protocol::Grbl };
            port(&model(other, lens, &clock)?)
        }
        Opening::Silence | Opening::WrongBaud | Opening::WrongBits => {
            let wire = model(protocol, lens, &clock)?;
            wire.strike(match opening {
                Opening::Silence => WireFault::Silence,
                Opening::WrongBaud => WireFault::Garbage,
                Opening::NoSuchPort | Opening::InUse | Opening::OtherDevice | Opening::WrongBits => {
                    WireFault::WrongBit
                }
            });
            port(&wire)
        }
    };
    match devices::open_driver(&driver, place, clock) {
        Ok(_) => bail!("{} was opened: {}", lens.name, opening.name()),
        Err(error) => Ok(error),
    }
}

/// The error of opening a pseudo-terminal that is open already, in real time.
fn in_use(driver: &LensDriver, lens: &EmulatedLens) -> Result<DeviceError> {
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    let server = Server::pty(model(driver.protocol(), lens, &clock)?)?;
    let serial = || Port::serial(server.address(), 9600, Arc::clone(&clock));
    let _held = devices::open_driver(driver, serial(), Arc::clone(&clock))?;
    match devices::open_driver(driver, serial(), Arc::clone(&clock)) {
        Ok(_) => bail!("{} was opened twice", lens.name),
        Err(error) => Ok(error),
    }
}

/// What the driver says when `lens` is opened under `opening`.
///
/// # Errors
/// As [`open_error`].
pub fn open(lens: &EmulatedLens, opening: Opening) -> Result<String> {
    if opening == Opening::InUse && matches!(lens.name, "labjack" | "indi") {
        return Ok("-: TCP".to_owned());
    }
    Ok(match open_error(lens, opening) {
        Ok(error) => format!("**{}**: {}", error.kind, error.what),
        // Drivers that do not look at each answer notice later.
        Err(opened) => opened.to_string(),
    })
}

/// A fault in the middle of a sweep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MidSweep {
    /// The controller says nothing any more; it hears.
    Silence,
    /// What it says is garbage.
    Garbage,
    /// One bit of each answer is wrong: a storm of checksum errors.
    WrongBits,
    /// Each answer ends in its middle.
    HalfReplies,
    /// Answers come half a second late.
    SlowReplies,
    /// The cable is pulled, the server drops; the controller goes on.
    Unplugged,
    /// Power fails and comes back: the controller starts anew.
    PowerLost,
    /// The motor stands: an end stop, no motor power.
    Stalled,
    /// It miscounts by 500 counts.
    Jump,
}

/// All of them.
pub const FAULTS: [MidSweep; 9] = [
    MidSweep::Silence,
    MidSweep::Garbage,
    MidSweep::WrongBits,
    MidSweep::HalfReplies,
    MidSweep::SlowReplies,
    MidSweep::Unplugged,
    MidSweep::PowerLost,
    MidSweep::Stalled,
    MidSweep::Jump,
];

impl MidSweep {
    /// For the table.
    pub fn name(self) -> &'static str {
        match self {
            Self::Silence => "silence",
            Self::Garbage => "garbage",
            Self::WrongBits => "wrong bits",
            Self::HalfReplies => "half replies",
            Self::SlowReplies => "slow replies",
            Self::Unplugged => "cable pulled, server gone",
            Self::PowerLost => "power lost, and back",
            Self::Stalled => "end stop, motor without power",
            Self::Jump => "miscount by 500",
        }
    }

    fn on_the_wire(self) -> Option<WireFault> {
        Some(match self {
            Self::Silence => WireFault::Silence,
            Self::Garbage => WireFault::Garbage,
            Self::WrongBits => WireFault::WrongBit,
            Self::HalfReplies => WireFault::HalfReplies,
            Self::SlowReplies => WireFault::SlowReplies(Duration::from_millis(500)),
            Self::Unplugged => WireFault::Unplugged,
            Self::PowerLost => WireFault::Reset,
            Self::Jump => WireFault::PositionJump(500.0),
            Self::Stalled => return None,
        })
    }
}

/// What came of a fault.
#[derive(Debug, Clone)]
pub struct Aftermath {
    /// The reason that the run's report gives; `focused` if the run did not mind.
    pub reason: &'static str,
    /// How long the glass moved on, and the time it needs to stop from its speed.
    pub moved_on: Duration,
    /// See [`moved_on`](Self::moved_on).
    pub stopping: Duration,
    /// What the driver said, if anything.
    pub error: Option<DeviceError>,
    /// What a run after the repair came to.
    pub afterwards: String,
}

impl fmt::Display for Aftermath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let millis = |time: Duration| time.as_secs_f64() * 1e3;
        write!(
            f,
            "`{}`, {:.0} ms of which {:.0}",
            self.reason,
            millis(self.moved_on),
            millis(self.stopping)
        )?;
        if let Some(error) = &self.error {
            write!(f, "; **{}**: {}", error.kind, error.what.replace('|', "\\|"))?;
        }
        write!(f, "; then {}", self.afterwards)
    }
}

/// A focus run through `lens` in whose first sweep `fault` strikes, and one after it has been repaired.
///
/// # Errors
/// The rig could not be made.
pub fn strike(lens: &EmulatedLens, fault: MidSweep) -> Result<Aftermath> {
    let mut config = config(lens.section, 1)?;
    if fault == MidSweep::Stalled {
        let trigger = FaultTrigger::AtPosition(LensPosition(WHERE));
        config.rig.faults = vec![Fault { kind: FaultKind::LensStalled, trigger }];
    }
    let driver = driver(lens)?;
    let mut wire = None;
    let mut rig = VirtualRig::with_lens(&config, |rig: &Rig, clock| -> Result<Box<dyn Lens>, DeviceError> {
        let line = rig.wire(driver.protocol());
        let port = port(&line);
        wire = Some(line);
        devices::open_driver(&driver, port, clock)
    })?;
    let wire = wire.context("a wire")?;
    rig.command(Command::Focus(FocusRequest::default()))?;
    let mut struck = None;
    let end = rig.now() + Duration::from_secs(60);
    while rig.now() < end && (struck.is_none() || rig.controller().snapshot().run.is_some()) {
        rig.step();
        let phase = rig.controller().snapshot().phase;
        if struck.is_none() && phase == Some(Phase::Sweeping) && rig.rig().glass(rig.now()).0 >= WHERE {
            struck = Some(rig.now());
            if let Some(fault) = fault.on_the_wire() {
                wire.strike(fault);
            }
        }
    }
    let struck = struck.context("the fault did not strike")?;
    rig.run_for(Duration::from_secs(1));
    let moved_on = moved_on(rig.rig(), struck, rig.now());
    let reason = match rig.controller().report().map(|report| report.outcome) {
        Some(Outcome::Failed(failure)) => failure.name(),
        Some(Outcome::Focused { .. }) => "focused",
        Some(Outcome::Aborted) => "aborted",
        None => "none",
    };
    let error = rig.lens_error().cloned();
    let speed = rig.controller().config().sweep_speed.counts_per_second();
    let stopping = Duration::from_secs_f64(speed / config.rig.lens.acceleration);
    wire.repair();
    rig.rig().repair();
    // The daemon tries again every second, and boards boot.
    rig.run_for(Duration::from_secs(6));
    let afterwards = match rig.focus(FocusRequest::default(), |_, _, _| {}) {
        Ok(report) => match report.outcome {
            Outcome::Focused { .. } => "focused".to_owned(),
            Outcome::Failed(failure) => format!("`{}`", failure.name()),
            Outcome::Aborted => "aborted".to_owned(),
        },
        Err(refused) => refused.to_string(),
    };
    Ok(Aftermath { reason, moved_on, stopping, error, afterwards })
}

/// How long the glass goes on after `struck`: until it first stands still.
fn moved_on(rig: &Rig, struck: HostMicros, end: HostMicros) -> Duration {
    let step = Duration::from_millis(1);
    let (mut time, mut moved) = (struck, struck);
    while time < end && time.since(moved) < STANDSTILL {
        let before = rig.glass(time);
        time += step;
        if rig.glass(time).distance(before) > 0.02 {
            moved = time;
        }
    }
    moved.since(struck)
}
