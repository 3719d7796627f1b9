//! Lens controllers as they are on the wire: models that take bytes, move the rig's lens, and answer with bytes, each at a time
//! that is an argument. What carries the bytes is apart: [`WirePort::open`] within the process, on any clock, and
//! [`Server`] on a pseudo-terminal or a TCP port for other programs.
//!
//! The models are written from the protocols' own papers, not from the drivers that they test.

mod fault;
mod firmata;
mod grbl;
mod indi;
mod labjack;
mod line;
mod moonlite;
mod motor;
mod optotune;
mod port;
mod server;

use std::fmt;
use std::time::Duration;

use evfocus_core::HostMicros;

pub use fault::WireFault;
use firmata::FirmataModel;
use grbl::GrblModel;
use indi::IndiModel;
use labjack::LabJackModel;
use moonlite::MoonLiteModel;
pub(crate) use motor::Motor;
use optotune::OptotuneModel;
pub use port::WirePort;
pub use server::Server;

use crate::names::named;

/// A lens controller as a state machine: bytes in, bytes out, at a time.
pub(crate) trait Device: Send {
    /// Takes bytes that have arrived by `now`, and appends what it answers.
    fn receive(&mut self, bytes: &[u8], now: HostMicros, replies: &mut Vec<u8>);

    /// When it next speaks without being asked.
    fn due(&self) -> Option<HostMicros> {
        None
    }

    /// Appends what it says of its own accord at `now`, which is the time that [`due`](Self::due) gave.
    fn speak(&mut self, _now: HostMicros, _said: &mut Vec<u8>) {}

    /// Power is cut and comes back at `now`.
    fn reset(&mut self, now: HostMicros);

    /// The controller miscounts by `counts` from now on.
    fn miscount(&mut self, counts: f64);
}

/// The protocols that there are models of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Protocol {
    /// MoonLite focusers.
    MoonLite,
    /// Optotune's Lens Driver 4.
    Optotune,
    /// A GRBL 1.1 CNC controller.
    Grbl,
    /// An Arduino with StandardFirmata, an H-bridge and a potentiometer.
    Firmata,
    /// A LabJack T7 with a motor stage and a potentiometer.
    LabJack,
    /// An INDI server with a focuser.
    Indi,
}

named!(Protocol, "protocol", {
    MoonLite => "moonlite",
    Optotune => "optotune",
    Grbl => "grbl",
    Firmata => "firmata",
    LabJack => "labjack",
    Indi => "indi",
});

impl Protocol {
    /// Bytes a second of the line: a tenth of the baud rate; nothing for TCP, where the line is not what takes time.
    fn bytes_per_second(self) -> Option<f64> {
        match self {
            Self::MoonLite => Some(960.0),
            Self::Optotune | Self::Grbl => Some(11_520.0),
            Self::Firmata => Some(5_760.0),
            Self::LabJack | Self::Indi => None,
        }
    }

    /// From a question to the answer, besides their time on the line.
    fn latency(self) -> Duration {
        match self {
            Self::MoonLite | Self::Optotune | Self::Grbl | Self::Firmata => Duration::ZERO,
            // On Ethernet, by its data sheet.
            Self::LabJack => Duration::from_millis(1),
            // Two programs on the same machine.
            Self::Indi => Duration::from_micros(200),
        }
    }

    fn device(self, motor: Motor) -> Box<dyn Device> {
        match self {
            Self::MoonLite => Box::new(MoonLiteModel::new(motor)),
            Self::Optotune => Box::new(OptotuneModel::new(motor)),
            Self::Grbl => Box::new(GrblModel::new(motor)),
            Self::Firmata => Box::new(FirmataModel::new(motor)),
            Self::LabJack => Box::new(LabJackModel::new(motor)),
            Self::Indi => Box::new(IndiModel::new(motor)),
        }
    }
}

impl fmt::Debug for dyn Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Device")
    }
}
